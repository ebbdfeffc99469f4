"""Tensor-product B-splines fitted to a piece of a mesh by weighted least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.shapes.patches._surfaces import DEGREE, SplinePatch

_CELLS = (2, 4, 8, 16, 32)
"""Spans along the longer side of a patch, until more of them say no more."""
_POINTS = 4.0
"""Points for each control point, at the least."""
_GAIN = 0.99
"""Of its score: a finer grid has to do better than this."""
_PATIENCE = 2
"""Finer grids that are tried after one that was better."""
_SMOOTH = 1e-4
"""Weight of the roughness, of the usual weight of a control point: it counts where nothing else
does, outside of the trimmed part, and where points are few."""
_MARGIN = 0.05
"""Of its size: how far a patch reaches beyond its points, for edges that are moved a little."""
_FILLED = 0.05
"""Of the weight of a measured point: what one in a filling has."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Points that a patch is fitted to."""

    points: Floats
    """(n, 3) mm."""
    normals: Floats
    """(n, 3) unit."""
    sigma: Floats
    """(n,) mm."""
    known: Bools
    """(n,) True where measured."""
    within: Bools
    """(n,) True on the piece itself; the rest lies just beyond its border."""


def fitted_patch(sample: Sample, up: Floats) -> tuple[SplinePatch, Floats]:
    """The patch over the plane across ``up`` (3,), and (n,) mm that the points lie outside of it.

    Its grid is the one with the least generalised cross-validation score (Craven & Wahba 1979,
    Numer. Math. 31): n χ² / (n − p)² over p control points. So it follows the surface and not its
    noise.
    """
    X = sample.points
    origin = X.mean(axis=0)
    axes = _axes(X - origin, up)
    x = (X - origin) @ axes.T
    low, high = x[:, :2].min(axis=0), x[:, :2].max(axis=0)
    margin = _MARGIN * float(np.max(high - low)) + float(np.median(sample.sigma))
    low, high = low - margin, high + margin
    steep = np.clip(sample.normals @ axes[2], 0.2, 1.0)
    weight = np.where(sample.known, 1.0, _FILLED) * (steep / sample.sigma) ** 2
    best: tuple[float, SplinePatch] | None = None
    worse = 0
    for cells in _CELLS:
        spans = np.maximum(np.ceil(cells * (high - low) / np.max(high - low)), 1).astype(int)
        if best is not None and np.prod(spans + DEGREE) * _POINTS > len(X):
            break
        knots = tuple(
            np.r_[[a] * DEGREE, np.linspace(a, b, n + 1), [b] * DEGREE]
            for a, b, n in zip(low, high, spans, strict=True)
        )
        score, height = _solved(x, weight, (knots[0], knots[1]))
        if best is None or score < _GAIN * best[0]:
            best, worse = (score, SplinePatch(origin, axes, (knots[0], knots[1]), height)), 0
            continue
        worse += 1
        if worse == _PATIENCE:
            break
    assert best is not None
    return best[1], best[1].offsets(X)[0]


def _axes(x: Floats, up: Floats) -> Floats:
    """(3, 3) rows: across ``up`` along the longest extent of points (n, 3), the other, and up."""
    flat = x - (x @ up)[:, None] * up
    long = np.linalg.eigh(flat.T @ flat)[1][:, 2]
    long = long - (long @ up) * up
    long = long / np.linalg.norm(long)
    return np.stack([long, np.cross(up, long), up])


def _solved(x: Floats, weight: Floats, knots: tuple[Floats, Floats]) -> tuple[float, Floats]:
    """The score of a grid, and its heights (nu, nv) mm over points (n, 3): u, v and height."""
    from scipy.interpolate import BSpline
    from scipy.linalg import solve
    from scipy.sparse import csr_array

    shape = tuple(len(t) - DEGREE - 1 for t in knots)
    design = [BSpline.design_matrix(x[:, k], knots[k], DEGREE) for k in (0, 1)]
    (a, b), n = (d.data.reshape(len(x), DEGREE + 1) for d in design), len(x)
    i, j = (d.indices.reshape(n, DEGREE + 1) for d in design)
    at = (i[:, :, None] * shape[1] + j[:, None, :]).reshape(-1)
    value = (a[:, :, None] * b[:, None, :]).reshape(-1)
    A = csr_array((value, at, np.arange(n + 1) * (DEGREE + 1) ** 2), shape=(n, shape[0] * shape[1]))
    scaled = A.multiply(weight[:, None]).tocsr()
    normal = (A.T @ scaled).toarray()
    own = np.diagonal(normal)
    normal = normal + _SMOOTH * float(own[own > 0].mean()) * _roughness(*shape)
    c = solve(normal, scaled.T @ x[:, 2], assume_a="pos")
    chi2 = float(weight @ (x[:, 2] - A @ c) ** 2)
    free = max(n - int(np.count_nonzero(own > 0)), 1)
    return n * chi2 / free**2, c.reshape(shape)


def _roughness(nu: int, nv: int) -> Floats:
    """(nu nv, nu nv): the sum of squared second differences of a grid, as a quadratic form."""

    def squared(n: int, order: int) -> Floats:
        d = np.diff(np.eye(n), order, axis=0)
        return np.asarray(d.T @ d)

    twice = np.kron(squared(nu, 2), np.eye(nv)) + np.kron(np.eye(nu), squared(nv, 2))
    return np.asarray(twice + 2 * np.kron(squared(nu, 1), squared(nv, 1)))

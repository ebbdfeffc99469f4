"""Tensor-product B-splines fitted to a piece of a mesh by weighted least squares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.shapes.patches._surfaces import DEGREE, SplinePatch

_CELLS = (2, 4, 8, 16, 32)
"""Spans along the longer side of a patch, until more of them say no more."""
_SPANS = (2, 4, 8, 16, 32, 64)
"""The same of a profile."""
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

Fit = TypeVar("Fit")


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

    def weight(self, lean: Floats) -> Floats:
        """(n,) 1/mm² of the heights of points whose normals have these cosines (n,) with up."""
        steep = np.clip(lean, 0.2, 1.0)
        return np.asarray(np.where(self.known, 1.0, _FILLED) * (steep / self.sigma) ** 2)


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
    weight = sample.weight(sample.normals @ axes[2])

    def tries() -> Iterator[tuple[float, SplinePatch]]:
        for cells in _CELLS:
            spans = np.maximum(np.ceil(cells * (high - low) / np.max(high - low)), 1).astype(int)
            if cells > _CELLS[0] and np.prod(spans + DEGREE) * _POINTS > len(X):
                return
            u, v = (_clamped(a, b, n) for a, b, n in zip(low, high, spans, strict=True))
            score, height = _solved(x, weight, (u, v))
            yield score, SplinePatch(origin, axes, (u, v), height)

    patch = _best(tries())
    return patch, patch.offsets(X)[0]


def fitted_profile(
    along: Floats, height: Floats, weight: Floats, margin: float
) -> tuple[Floats, Floats]:
    """Knots and heights of the B-spline over a line through points (n,), chosen the same way.

    It reaches ``margin`` mm and a little more beyond them.
    """
    low, high = float(along.min()), float(along.max())
    margin += _MARGIN * (high - low)

    def tries() -> Iterator[tuple[float, tuple[Floats, Floats]]]:
        for spans in _SPANS:
            if spans > _SPANS[0] and (spans + DEGREE) * _POINTS > len(along):
                return
            knots = _clamped(low - margin, high + margin, spans)
            score, heights = _solved_profile(along, height, weight, knots)
            yield score, (knots, heights)

    return _best(tries())


def _clamped(low: float, high: float, spans: int) -> Floats:
    """Even knots of a B-spline that ends in its first and last control point."""
    return np.asarray(np.r_[[low] * DEGREE, np.linspace(low, high, spans + 1), [high] * DEGREE])


def _best(tries: Iterable[tuple[float, Fit]]) -> Fit:
    """The fit of the least score, the finer ones last; none after some that were no better."""
    best: tuple[float, Fit] | None = None
    worse = 0
    for score, fit in tries:
        if best is None or score < _GAIN * best[0]:
            best, worse = (score, fit), 0
            continue
        worse += 1
        if worse == _PATIENCE:
            break
    assert best is not None
    return best[1]


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


def _solved_profile(x: Floats, y: Floats, weight: Floats, knots: Floats) -> tuple[float, Floats]:
    """The score of a line of knots, and its heights (n,) mm over points (n,)."""
    from scipy.interpolate import BSpline
    from scipy.linalg import solve

    A = BSpline.design_matrix(x, knots, DEGREE).toarray()
    scaled = weight[:, None] * A
    normal = A.T @ scaled
    own = np.diagonal(normal)
    normal = normal + _SMOOTH * float(own[own > 0].mean()) * _squared(len(own), 2)
    c = solve(normal, scaled.T @ y, assume_a="pos")
    free = max(len(x) - int(np.count_nonzero(own > 0)), 1)
    return len(x) * float(weight @ (y - A @ c) ** 2) / free**2, c


def _squared(n: int, order: int) -> Floats:
    """(n, n): the sum of the squared differences of that order, as a quadratic form."""
    d = np.diff(np.eye(n), order, axis=0)
    return np.asarray(d.T @ d)


def _roughness(nu: int, nv: int) -> Floats:
    """(nu nv, nu nv): the sum of squared second differences of a grid, as a quadratic form."""
    twice = np.kron(_squared(nu, 2), np.eye(nv)) + np.kron(np.eye(nu), _squared(nv, 2))
    return np.asarray(twice + 2 * np.kron(_squared(nu, 1), _squared(nv, 1)))

"""Points of one surface and the patches of another that lie under them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats

_NEIGHBOURS = 24
_FEWEST = 12
_BESIDE, _BOTH_SIDES = 0.1, 4
"""Points of a patch to either side of a place, at least, beyond this part of the patch's size."""
_STEEP = 0.5
"""Sum of squared weights above which a patch says little of the place asked for."""
_EDGE = 1.6
"""Times the usual χ² of a patch about its quadric: more is an edge."""
_ACROSS = 6.0
"""Slope at the ends of a patch, in terms of its second derivative: it reaches 1.5 of its size."""
_BEND = np.tan(np.radians(20.0))
"""A patch that bends by more from end to end may hide an edge."""

Index = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Patches:
    """Which points of a surface stand under points of another, by weights that take a quadric."""

    query: Index
    """(m,) of the points asked about."""
    near: Index
    """(m, k) of the other surface's points."""
    weights: Floats
    """(m, k), sum 1: the surface under the point is at Σ weight · point, along the normal."""
    normal: Floats
    """(m, 3)."""

    def gaps(self, asked: Floats, others: Floats) -> Floats:
        """(m, …) mm along the normals, of points (n, …, 3) above the other surface's points; or
        of slopes of both."""
        off = asked[self.query] - self._under(others)
        gaps: Floats = np.einsum("mi,m...i->m...", self.normal, off)
        return gaps

    def _under(self, others: Floats) -> Floats:
        """(m, …, 3): the surface under each point."""
        from scipy.sparse import csr_array

        m, k = self.near.shape
        begin = np.arange(m + 1) * k
        rows = csr_array((self.weights.ravel(), self.near.ravel(), begin), shape=(m, len(others)))
        under: Floats = rows @ others.reshape(len(others), -1)
        return under.reshape(m, *others.shape[1:])


def patches_under(asked: Floats, others: Floats, noise: Floats, reach: float) -> Patches:
    """The patches of ``others`` (n, 3) mm under the points ``asked`` (m, 3), at most ``reach`` off.

    ``noise`` (n, 3) mm is how one standard deviation moves each of the others.

    A quadric over the plane of the nearest points is fitted to them (moving least squares, Levin,
    The approximation power of moving least squares, 1998); points beside a patch, on an edge or
    where the patch is a line are left out.
    """
    from scipy.spatial import cKDTree

    k = min(_NEIGHBOURS, len(others))
    if k < _FEWEST or not len(asked):
        none = np.zeros((0, max(k, 1)))
        return Patches(np.zeros(0, np.intp), none.astype(np.intp), none, np.zeros((0, 3)))
    found = cKDTree(others).query(asked, k)
    far, near = np.asarray(found[0]), np.asarray(found[1])
    radius = np.maximum(np.median(far[:, -1]), 1e-9)
    query = np.flatnonzero(far[:, 0] < reach + radius)
    near = near[query]
    points = others[near]
    middle = points.mean(axis=1, keepdims=True)
    off = points - middle
    spread = np.einsum("mki,mkj->mij", off, off)
    values, axes = np.linalg.eigh(spread)
    size = np.sqrt(values[:, 2] / k)
    local = np.einsum("mki,mij->mkj", off, axes[:, :, ::-1]) / size[:, None, None]
    x, y, z = np.moveaxis(local, -1, 0)
    here = np.einsum("mi,mij->mj", asked[query] - middle[:, 0], axes[:, :, ::-1]) / size[:, None]
    design = _quadric(x, y)
    normal_matrix = np.einsum("mka,mkb->mab", design, design) + 1e-9 * np.eye(6)
    weights = np.einsum(
        "mka,ma->mk", design,
        np.linalg.solve(normal_matrix, _quadric(here[:, 0], here[:, 1])[:, :, None])[:, :, 0],
    )  # fmt: skip
    solved = np.linalg.solve(normal_matrix, np.einsum("mka,mk->ma", design, z)[:, :, None])
    _, _, _, xx, xy, yy = solved[:, :, 0].T
    bend = _ACROSS * (np.abs(xx + yy) + np.hypot(xx - yy, xy)) / 2
    rough = np.einsum("mki,mi->mk", noise[near], axes[:, :, 0])
    least = 0.2 * np.sqrt(np.median(rough**2, axis=1, keepdims=True))
    away = size[:, None] * (z - (design @ solved)[:, :, 0]) / np.maximum(np.abs(rough), least)
    scatter = np.mean(away**2, axis=1)
    blur = _ACROSS * np.sqrt(np.mean(rough**2, axis=1) / k) / size
    good = np.ones(len(query), dtype=bool)
    for own, across in ((here[:, 0], x), (here[:, 1], y)):
        # Others on both sides, and more than one line of them: no extrapolation.
        below = np.count_nonzero(across < own[:, None] - _BESIDE, axis=1)
        above = np.count_nonzero(across > own[:, None] + _BESIDE, axis=1)
        good &= np.minimum(below, above) >= _BOTH_SIDES
    good &= bend - 2 * blur < _BEND
    good &= (weights**2).sum(axis=1) < _STEEP
    good &= np.abs(here[:, 2]) * size < reach
    good &= values[:, 1] > 0.05 * values[:, 2]
    good &= scatter < _EDGE * max(float(np.median(scatter)), 1e-12)
    return Patches(query[good], near[good], weights[good], axes[good, :, 0])


def _quadric(x: Floats, y: Floats) -> Floats:
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)

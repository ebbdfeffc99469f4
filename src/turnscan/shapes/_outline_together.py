"""How far noise hangs together along a section, as sections beside it show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh
from turnscan.shapes._outline_noise import Noise, chain_noise
from turnscan.shapes._section import Chain, Cut, segments_of

_ROWS = 3.0
"""Rows of vertices from one cut to the next: so far apart they share no noise."""
_CUTS = 4
"""Sections on either side whose noise is looked at, beside that of the cut itself."""
_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Fourth difference from cut to cut: no surface that is smooth from row to row is in it."""
_FEWEST = 24
"""Points of a chain, of which anything follows."""
_LAGS = 24
"""Points along the chain that may share noise, at the most."""
_OWN = 3
"""Of these, points that share vertices on any mesh."""
_CLIPPED = 3.0
"""Usual noise beyond which a point is no more off: one beside an edge says nothing of noise."""
_FORM = 2.0
"""Times sigma: what differs more from cut to cut is the form of the part."""
_MOST = 16.0
_NEAR = 6
"""Segments of another cut that are tried, those next to a point."""


def held_together(mesh: Mesh, cut: Cut, chains: Sequence[Chain]) -> float:
    """So many times the variance has a mean over points of the ``cut`` that it would have if each
    vertex of the mesh were off by itself; 1 where nothing tells.

    Where several lasers were merged, or voxels lie between profiles, vertices share measurements.
    The longest of the ``chains`` is held against cuts beside it: fourth differences across them
    leave its noise alone, whose correlation along the chain is summed and divided by what sharing
    vertices accounts for. A line through few profiles takes such noise for its own place, so that
    its own residuals do not show it.
    """
    if not chains or chains[0].stripes is None:
        return 1.0
    chain = chains[0]
    use = chain.measured
    if int(use.sum()) < _FEWEST:
        return 1.0
    noise = chain_noise(chain, use)
    if not noise.known:
        return 1.0
    height = mesh.vertices @ cut.normal - cut.distance
    low, high = height[mesh.faces].min(axis=1), height[mesh.faces].max(axis=1)
    met = (low <= 0) & (high >= 0) & (low < high)
    if not met.any():  # faces that lie in the cut alone
        return 1.0
    off = _differences(mesh, cut, chain, (low, high), _ROWS * float(np.median((high - low)[met])))
    off[:, ~use] = np.nan
    return _ratio(off / noise.point, noise, use)


def _differences(
    mesh: Mesh, cut: Cut, chain: Chain, heights: tuple[Floats, Floats], step: float
) -> Floats:
    """(cuts, m) mm that points of a chain are off, less what the surface does about them.

    ``heights`` (f,) mm over the cut of the lowest and the highest vertex of each face; ``step`` mm
    from one cut to the next.
    """
    low, high = heights
    reach = _CUTS + len(_DIFFERENCE) // 2
    near = (low < (reach + 1) * step) & (high > -(reach + 1) * step)
    measured = None if mesh.measured is None else mesh.measured[near]
    slab = replace(mesh, faces=mesh.faces[near], measured=measured)
    away = np.stack(
        [
            _away(chain.points, chain.normals, slab, replace(cut, distance=cut.distance + k * step))
            for k in range(-reach, reach + 1)
        ]
    )
    many = 2 * _CUTS + 1
    off = sum(weight * away[k : k + many] for k, weight in enumerate(_DIFFERENCE))
    return np.asarray(off / np.linalg.norm(_DIFFERENCE))


def _away(points: Floats, across: Floats, mesh: Mesh, cut: Cut) -> Floats:
    """(m,) mm from points (m, 2) along ``across`` to a cut's section; NaN where it has none."""
    from scipy.spatial import cKDTree

    s = segments_of(mesh, cut)
    if not len(s.nodes):
        return np.full(len(points), np.nan)
    start, way = s.points[s.nodes[:, 0]], s.points[s.nodes[:, 1]] - s.points[s.nodes[:, 0]]
    near = cKDTree(start + way / 2).query(points, k=min(_NEAR, len(start)))[1]
    near = near.reshape(len(points), -1)
    to, way = start[near] - points[:, None], way[near]
    n = across[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = n[..., 0] * way[..., 1] - n[..., 1] * way[..., 0]
        away = (to[..., 0] * way[..., 1] - to[..., 1] * way[..., 0]) / flat
        at = (to[..., 0] * n[..., 1] - to[..., 1] * n[..., 0]) / flat
    met = (at >= -1e-6) & (at <= 1 + 1e-6)
    best = np.argmin(np.where(met, np.abs(away), np.inf), axis=1)[:, None]
    found = np.where(met, away, np.nan)
    return np.asarray(np.take_along_axis(found, best, axis=1)[:, 0])


def _ratio(off: Floats, noise: Noise, use: Bools) -> float:
    """How many times more neighbours share than their vertices do; ``off`` (cuts, m) in sigma."""
    off = off[np.isfinite(off).sum(axis=1) >= _FEWEST]
    if not len(off):
        return 1.0
    size = np.nanmedian(np.abs(off), axis=1) / 0.6745
    off, size = off[(size > 0) & (size <= _FORM)], size[(size > 0) & (size <= _FORM)]
    if not len(off):
        return 1.0
    off = np.clip(off, -_CLIPPED * size[:, None], _CLIPPED * size[:, None])
    # Along an edge of the part all points of one cut are off alike: the median of cuts counts.
    like = np.array([np.median(_correlation(off, lag)) for lag in range(min(_LAGS, off.shape[1]))])
    chance = np.flatnonzero(like < np.sqrt(2.0 / int(use.sum())))
    most = max(int(chance[0]) if len(chance) else len(like), _OWN)
    return float(np.clip((1.0 + 2.0 * like[1:most].sum()) / noise.overlap, 1.0, _MOST))


def _correlation(off: Floats, lag: int) -> Floats:
    """(cuts,) of each with itself so many points on; 0 where no two points are known."""
    product = off[:, : off.shape[1] - lag] * off[:, lag:]
    have = np.isfinite(product).sum(axis=1)
    mean = np.nansum(product, axis=1) / np.maximum(have, 1)
    return np.asarray(mean / np.nanmean(off * off, axis=1))

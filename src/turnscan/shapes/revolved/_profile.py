"""The profile of a turned part's wall: the mean over all angles, as one chain of points."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.shapes._section import Chain, Cut, cross_section, half_plane_cut
from turnscan.shapes.revolved._axis import Turned

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_ANGLES = 24
"""Half-planes that are tried: the profile follows the one that shows most of the wall, which one
through a keyway does not."""
_WINDOW = 1.5
"""Steps of the mesh along the wall, to both sides, whose points say where it is."""
_ALIKE = float(np.cos(np.radians(30.0)))
"""Between the normal of a point and that of the profile there."""
_SECTORS = 8
"""All round: the scatter of their means is what the mean profile is known by."""
_LEAST = 8
"""Points that a place of the profile must have, and angles in which it must be seen."""
_BENT = 5.0
"""Standard deviations by which a wall is bent within the window, for its bend to be fitted, too."""
_BESIDE = 0.1
"""Of the window: how far the wall may end before a place on it."""
_BEND, _AHEAD = float(np.cos(np.radians(20.0))), 3.0
"""Where the profile turns by more between two places, it has a corner there: at most so many steps
of the mesh ahead of both."""
_GAP, _CLOSE = 4.0, 0.75
"""Steps of the mesh: a longer way between points was not measured, shorter ones are one place."""
_SHORT = 0.03
"""Of the longest chain: shorter ones are left out."""
_ALONG = 0.75
"""Of the length of an edge of the mesh: one that is so long along the wall goes along it."""


def wall_profile(turned: Turned) -> tuple[Cut, tuple[Chain, ...]]:
    """The wall in the half-plane (r, z) of the axis, the longest chain first.

    It follows the section that shows most of the wall; each of its points goes along its normal to
    the mean of the points of all angles beside it. Its sigma is that of this mean: from the scatter
    of the means of eight sectors, for a part that is not round has no sharper profile.

    Raises InputError where no half-plane from the axis meets the wall.
    """
    from scipy.spatial import cKDTree

    on = np.flatnonzero(turned.on)
    tree = cKDTree(np.column_stack([turned.r[on], turned.z[on]]))
    cut, chains = max(
        (_section(turned, k) for k in range(_ANGLES)),
        key=lambda o: sum(_on_wall(turned, c, tree) for c in o[1]),
    )
    if not chains:
        raise InputError("no half-plane from the axis meets the wall", hint="measure more of it")
    long = [c for c in chains if c.length >= _SHORT * chains[0].length]
    flat = replace(cut, name="profile of the wall", turned=True)
    made = [m for c in long if (m := _averaged(turned, c, on, tree)) is not None]
    if not made:
        raise InputError("no half-plane from the axis meets the wall", hint="measure more of it")
    return flat, tuple(sorted(made, key=lambda c: -c.length))


def _section(turned: Turned, k: int) -> tuple[Cut, list[Chain]]:
    cut = half_plane_cut(2 * np.pi * k / _ANGLES)
    try:
        return cut, cross_section(turned.mesh, cut)
    except InputError:
        return cut, []


def _on_wall(turned: Turned, chain: Chain, tree: cKDTree) -> float:
    """mm of a chain beside points that are on the surface of revolution."""
    near = np.asarray(tree.query(chain.points)[0]) <= turned.spacing / 2 + 4 * turned.sigma
    ways = np.linalg.norm(np.diff(chain.points, axis=0), axis=1)
    return float(ways[near[1:] & near[:-1]].sum())


def _averaged(turned: Turned, chain: Chain, on: np.ndarray, tree: cKDTree) -> Chain | None:
    """A chain whose points are means over all angles; each its own, so that none share a vertex.

    None where there is no mean of most of it, as of a handle.
    """
    p = chain.points
    out = chain.normals
    pitch = _pitches(turned, chain)
    near = tree.query_ball_point(p, _WINDOW * pitch + 6 * turned.sigma)
    points, sigma = p.copy(), np.full(len(p), np.nan)
    for k, found in enumerate(near):
        mean = _mean_at(turned, on[found], p[k], out[k], _WINDOW * float(pitch[k]))
        if mean is not None:
            points[k] = p[k] + mean[0] * out[k]
            sigma[k] = mean[1]
    index = _kept(points, np.isfinite(sigma), pitch)
    if len(index) < _LEAST:
        return None
    closed = chain.closed
    if closed and float(np.linalg.norm(points[index[-1]] - points[index[0]])) < _CLOSE * (
        turned.spacing
    ):
        index = index[:-1]
    points, sigma = _with_corners(points[index], sigma[index], turned.spacing)
    at = np.concatenate([points, points[:1]]) if closed else points
    gaps = np.linalg.norm(np.diff(at, axis=0), axis=1) > _GAP * turned.spacing
    n = len(points)
    number = np.arange(n, dtype=np.int32)
    return Chain(
        points, closed, gaps, sigma, np.zeros((n, 2)), np.column_stack([number, number]),
        np.column_stack([np.ones(n), np.zeros(n)]),
    )  # fmt: skip


def _with_corners(points: Floats, sigma: Floats, spacing: float) -> tuple[Floats, Floats]:
    """The places, and between two of them the corner in which the walls beside it meet: stripes are
    bent there, so nothing was measured that could say how sharp it is."""
    out, known = [points[0]], [sigma[0]]
    for k in range(1, len(points)):
        if 2 <= k < len(points) - 1:
            corner = _corner(points[k - 2 : k + 2], spacing)
            if corner is not None:
                out.append(corner)
                known.append(2 * max(sigma[k - 1], sigma[k]))
        out.append(points[k])
        known.append(sigma[k])
    return np.array(out), np.array(known)


def _corner(four: Floats, spacing: float) -> Floats | None:
    """Where the line through the first two of four places meets that through the last two."""
    a, b, c, d = four
    if float(np.linalg.norm(c - b)) < spacing:
        return None
    u, v = (b - a) / np.linalg.norm(b - a), (d - c) / np.linalg.norm(d - c)
    if float(u @ v) > _BEND:
        return None
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 1e-6:
        return None
    way = c - b
    ahead = (way[0] * v[1] - way[1] * v[0]) / cross
    back = (way[0] * u[1] - way[1] * u[0]) / cross
    if not (0 < ahead < _AHEAD * spacing and 0 < -back < _AHEAD * spacing):
        return None
    return np.asarray(b + ahead * u)


def _mean_at(
    turned: Turned, some: np.ndarray, at: Floats, out: Floats, window: float
) -> tuple[float, float] | None:
    """How far the wall stands off a place along its normal, and how well that is known, mm."""
    d = np.column_stack([turned.r[some], turned.z[some]]) - at
    along, off = d @ np.array([-out[1], out[0]]), d @ out
    keep: Bools = np.asarray((np.abs(along) <= window) & (turned.normal[some] @ out >= _ALIKE))
    if int(keep.sum()) < _LEAST:
        return None
    along, off = along[keep], off[keep]
    if min(float(along.max()), -float(along.min())) < -_BESIDE * window:
        return None  # beyond the end of the wall
    sector = ((turned.angle[some][keep] / (2 * np.pi) % 1.0) * _SECTORS).astype(np.int64) % _SECTORS
    (mean, *_), rest = _fitted(along, off)
    count = np.bincount(sector, minlength=_SECTORS)
    seen = count >= 2
    if int(seen.sum()) < 2:
        return None
    means = np.bincount(sector, rest, minlength=_SECTORS)[seen] / count[seen]
    sigma = float(means.std(ddof=1)) / np.sqrt(int(seen.sum()))
    if abs(mean) > window:
        return None
    return float(mean), max(sigma, float(rest.std()) / np.sqrt(len(rest)))


def _fitted(along: Floats, off: Floats) -> tuple[Floats, Floats]:
    """Coefficients of a straight wall, or of a bent one where its bend is more than its points'
    noise; and what is left of the points."""
    A = np.column_stack([np.ones(len(off)), along, along**2])
    line = np.linalg.lstsq(A[:, :2], off, rcond=1e-9)[0]
    straight = off - A[:, :2] @ line
    bent = np.linalg.lstsq(A, off, rcond=1e-9)[0]
    rest = off - A @ bent
    gain = float(straight @ straight - rest @ rest)
    noise = float(rest @ rest) / max(len(off) - 3, 1)
    if len(np.unique(np.sign(along))) > 1 and gain > _BENT**2 * noise:
        return np.asarray(bent), np.asarray(rest)
    return np.asarray(line), np.asarray(straight)


def _kept(points: Floats, known: Bools, pitch: Floats) -> np.ndarray:
    """Points of which there is a mean, none much closer to the last than they stand there."""
    out = list[int]()
    for k in np.flatnonzero(known).tolist():
        if not out or float(np.linalg.norm(points[k] - points[out[-1]])) >= _CLOSE * pitch[k]:
            out.append(k)
    return np.array(out, dtype=np.int64)


def _pitches(turned: Turned, chain: Chain) -> Floats:
    """(m,) mm between places of the profile: the step of the mesh.

    A mesh of few profiles has coarser steps about the axis than along the wall. Where an open chain
    ends at the foot or at the top of the part, places stand as close as points do along the wall:
    else it would end a whole step too early.
    """
    pitch = np.full(len(chain.points), turned.spacing)
    if chain.closed:
        return pitch
    at = np.r_[0.0, np.cumsum(chain.steps)]
    wide, z = _WINDOW * turned.spacing, turned.z[turned.on]
    last = np.minimum(at, at[-1] - at) < wide
    height = chain.points[:, 1]
    last &= (height < z.min() + wide) | (height > z.max() - wide)
    pitch[last] = _step_along(turned)
    return pitch


def _step_along(turned: Turned) -> float:
    """mm between neighbours along the wall; no more than between any."""
    faces = turned.mesh.faces
    a, b = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    along = np.hypot(turned.r[a] - turned.r[b], turned.z[a] - turned.z[b])
    whole = np.linalg.norm(turned.mesh.vertices[a] - turned.mesh.vertices[b], axis=1)
    some = along > np.maximum(_ALONG * whole, 1e-12)
    return min(float(np.median(along[some])), turned.spacing) if some.any() else turned.spacing

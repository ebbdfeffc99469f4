"""What a part may look like beyond a border at which it turns off: faces that could not be seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.surface.holes._hole_places import Places
from turnscan.surface.holes._holes import Hole
from turnscan.surface.holes._spans import smoothed, unit
from turnscan.surface.holes._thin_sides import opposite

_CORNERS = 60
"""Corners of a border from which a face is searched, about."""
_BENDS = np.deg2rad([0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0, 135.0])
"""How far the part may turn off at its border."""
_MORE = np.deg2rad(20.0)
"""A bend beyond a square one that hides a face is only just enough: as much more is usual."""
_FAR = 0.5
"""Of the size of its hole: how far a face goes that comes to nothing."""
_FOOT, _LINE = 0.25, 0.1
"""Of the size of its hole: how much of the face that the part stands on goes with each mm of border
at which it is cut, a disc having a quarter of its diameter; and the area, in squares of its length,
below which such a border is a line that says nothing of that face's depth."""
_FACES = 0.5
"""Cosine between the way across a line and a normal that looks that way."""
_CROWD = 2.0
"""Of the side of the area that a place stands for: radius within which places are counted."""
_LIFT = 0.125
"""Of a margin: how far places lie off their face."""
_DEPTHS = np.array([1.0, 3.0, 5.0, 7.0]) / 8.0
"""Where a face is asked: in the middle of each quarter of the way to what it comes to."""

Measurable = Callable[[Places], Bools]
"""(m,) True for places that the camera would have seen lit."""
Ahead = Callable[[Floats, Floats], Floats]
"""(m,) how far rays from (m, 3) along (m, 3) go to what was measured; infinite for none."""
Ends = Callable[[Floats], Bools]
"""(m,) True for places (m, 3) at which the surface ends because what is kept of it ends there."""
Apart = Callable[[Floats], Floats]
"""(m,) mm from sample to sample at places (m, 3)."""


@dataclass(frozen=True)
class _Borders:
    """Corners of borders from which faces are searched."""

    X: Floats
    """(m, 3) mm."""
    n: Floats
    """(m, 3) normals there."""
    outward: Floats
    """(m, 3) along the surface and off it."""
    hole: Ints
    """(m,)."""
    width: Floats
    """(m,) mm of border that each stands for."""

    def some(self, which: Bools) -> _Borders:
        """Those alone."""
        X, n, outward = self.X[which], self.n[which], self.outward[which]
        return _Borders(X, n, outward, self.hole[which], self.width[which])

    def bent(self, which: Ints, by: float) -> tuple[Floats, Floats]:
        """Ways (k, 3) and normals (k, 3) of faces that turn off by an angle, radians."""
        c, s = np.cos(by), np.sin(by)
        n, outward = self.n[which], self.outward[which]
        return c * outward - s * n, c * n + s * outward


class Beyond(NamedTuple):
    """Places on faces that the part has, or may have, beyond the borders of holes."""

    sides: Places
    area: Floats
    """(m,) mm² that each place stands for."""
    cut: Bools
    """(m,) True where the surface ends because what is kept of it ends there."""
    known: Bools
    """(m,) True on sides beyond which another border follows (`opposite`): no guess."""


def faces_beyond(
    mesh: Mesh,
    found: Sequence[Hole],
    places: Places,
    measurable: Measurable,
    ahead: Ahead,
    ends: Ends,
    apart: Apart,
) -> Beyond:
    """Places on the faces that the part may have beyond the borders of holes that no smooth surface
    spans.

    Where another border follows within two samples, a side lies between that is known. At each
    other corner of such a border the part turns off by little more than the least that would not
    have been measured, and goes on straight as far as to something that was, or to the platter.
    Where what is kept ends, the face that the part stands on is missing, too (`_feet`). What is
    reached from several vertices counts once (`_crowd`).
    """
    b = _borders(mesh, found, ~places.smooth)
    guessed = ends(b.X)
    own = b.some(~guessed)
    thin, sides, areas = _thin(mesh, found, own, places, apart(own.X))
    guessed[~guessed] = ~thin
    at, weight, cut = _guessed(mesh, found, b.some(guessed), places, measurable, ahead, ends)
    asked = _asked(
        places,
        np.concatenate([at.at, sides.at]),
        np.concatenate([at.normal, sides.normal]),
        np.concatenate([at.hole, sides.hole]),
    )
    asked = replace(asked, bent=np.concatenate([at.bent, sides.bent]))
    known = np.arange(len(asked.at)) >= len(at.at)
    cut = np.concatenate([cut, np.zeros(len(areas), dtype=np.bool_)])
    return Beyond(asked, np.concatenate([weight, areas]), cut, known)


def _guessed(
    mesh: Mesh,
    found: Sequence[Hole],
    b: _Borders,
    places: Places,
    measurable: Measurable,
    ahead: Ahead,
    ends: Ends,
) -> tuple[Places, Floats, Bools]:
    """Places on faces that are guessed from the corners of borders, mm² that each stands for (m,),
    and (m,) True where the surface ``ends``."""
    way, up = _turned_off(b, places, measurable)
    kept = np.flatnonzero(np.abs(way).sum(axis=1) > 0).astype(np.int32)
    way, up, X, hole = way[kept], up[kept], b.X[kept], b.hole[kept]
    step, lift = 0.5 * places.margin, _LIFT * places.margin
    size = places.reach[hole]
    reach = ahead(X + step * way - lift * up, way)
    within = _within(mesh, found, X, way, hole)
    free = np.where(within < places.margin, _FAR * size, np.minimum(within, _FAR * size))
    reach = np.where(np.isinf(reach), free, np.minimum(reach, size)) + step
    reach = np.minimum(reach, np.maximum(X[:, 2], 0.1) / np.maximum(-way[:, 2], 1e-9))
    at = X[:, None] + (_DEPTHS * reach[:, None])[..., None] * way[:, None] + lift * up[:, None]
    count, cut = len(_DEPTHS), ends(X)
    weight = np.repeat(b.width[kept] * reach / count, count)
    ups, holes = np.repeat(up, count, axis=0), np.repeat(hole, count)
    weight /= _crowd(at.reshape(-1, 3), ups, holes, weight)
    foot = np.repeat(_feet(X, b.n[kept], cut, b.width[kept], size) / count, count)
    weight = np.where(np.repeat(cut, count), foot, weight)
    bent = np.einsum("ij,ij->i", up, b.n[kept]) < 1.0 - 1e-6
    asked = _asked(places, at.reshape(-1, 3), ups, holes)
    asked = replace(asked, bent=np.repeat(bent, count))
    return asked, np.asarray(weight), np.repeat(cut, count)


def _thin(
    mesh: Mesh, found: Sequence[Hole], b: _Borders, places: Places, apart: Floats
) -> tuple[Bools, Places, Floats]:
    """(m,) True at corners beyond whose side another border follows, where samples are ``apart``
    (m,) mm from each other, the middles of such sides (k,), and their areas (k,), mm².

    How far samples are apart goes by the widest steps along a border: a side is one, and beside the
    axis, where steps are short, light and look graze it or the clean-up took it.
    """
    widest = np.zeros(len(found))
    np.maximum.at(widest, b.hole, apart)
    vertex = opposite(mesh, found, widest[b.hole], b.X, b.n, b.outward)
    thin = vertex >= 0
    other, up = mesh.vertices[vertex[thin]], b.outward[thin]
    # A border ends about half a sample before the edge.
    at = 0.5 * (b.X[thin] + other + apart[thin, None] * up)
    area = b.width[thin] * np.linalg.norm(other - b.X[thin], axis=1)
    return thin, _asked(places, at, up, b.hole[thin]), area


def _within(mesh: Mesh, found: Sequence[Hole], X: Floats, way: Floats, hole: Ints) -> Floats:
    """(m,) mm from border vertices X (m, 3) along ways (m, 3) to where they leave the convex hull
    of their hole's border; infinite where it has none.

    What a border bounds lies within its hull unless it bulges.
    """
    from scipy.spatial import ConvexHull, QhullError

    out = np.full(len(X), np.inf)
    for k in np.unique(hole):
        own = np.flatnonzero(hole == k)
        try:
            sides = ConvexHull(mesh.vertices[found[k].loop], qhull_options="QJ").equations
        except QhullError:  # a border of few vertices
            continue
        rate = way[own] @ sides[:, :3].T
        left = np.maximum(-(X[own] @ sides[:, :3].T + sides[:, 3]), 0.0)
        out[own] = np.where(rate > 1e-9, left / np.maximum(rate, 1e-9), np.inf).min(axis=1)
    return out


def _feet(X: Floats, n: Floats, cut: Bools, width: Floats, size: Floats) -> Floats:
    """(m,) mm² of the face that the part stands on, for each border vertex X (m, 3) at which what
    is kept ends (``cut``), by the ``width`` (m,) of border that it stands for; 0 for the others.

    Seen from above it is as large as the hull of all of them: it is one, whatever holes its rim
    belongs to. Where they lie in a line its depth is not known, and it goes by the ``size`` (m,) of
    their holes (`_FOOT`), unless that line has two sides, as the foot of a plate: their normals
    ``n`` (m, 3) say so.
    """
    from scipy.spatial import ConvexHull, QhullError

    foot = np.where(cut, _FOOT * size * width, 0.0)
    try:
        area = float(ConvexHull(X[cut, :2]).volume)
    except (QhullError, ValueError):  # fewer than three, or in one line
        return foot
    far = float(np.linalg.norm(np.ptp(X[cut, :2], axis=0)))
    if area < _LINE * far**2 and not _two_sided(X[cut, :2], n[cut, :2]):
        return foot
    return np.asarray(np.where(cut, area * width / max(float(width[cut].sum()), 1e-9), 0.0))


def _two_sided(X: Floats, n: Floats) -> bool:
    """Whether normals n (m, 2) at places X (m, 2) in a line look away from both of its sides."""
    across = np.linalg.svd(X - X.mean(axis=0), full_matrices=False)[2][1]
    looks = n @ across
    return bool(looks.max() > _FACES and looks.min() < -_FACES)


def _crowd(at: Floats, normal: Floats, hole: Ints, weight: Floats) -> Floats:
    """(m,) how many times over the places (m, 3) of a hole cover the face that they lie on; at
    least 1.

    Faces that are searched from opposite borders, or from inside a bend, come to lie on each other.
    Where the weights (m,), mm², of places that look alike within a radius are more than its disc,
    they count for that.
    """
    from scipy.spatial import cKDTree

    out = np.ones(len(at))
    for k in np.unique(hole):
        own = np.flatnonzero(hole == k)
        radius = _CROWD * float(np.sqrt(np.median(weight[own])))
        near = cKDTree(at[own]).query_pairs(radius, output_type="ndarray")
        alike = np.einsum("ij,ij->i", normal[own][near[:, 0]], normal[own][near[:, 1]]) > 0.5
        a, b = near[alike].T
        total = weight[own] + np.bincount(a, weight[own][b], len(own))
        total += np.bincount(b, weight[own][a], len(own))
        out[own] = np.maximum(total / (np.pi * radius**2), 1.0)
    return out


def _turned_off(b: _Borders, places: Places, measurable: Measurable) -> tuple[Floats, Floats]:
    """Ways (m, 3) in which the part turns off at border vertices, and normals (m, 3) there; both
    zero where none would have hidden it."""
    way, up = np.zeros_like(b.X), np.zeros_like(b.X)
    left = np.arange(len(b.X), dtype=np.int32)
    for bend in _BENDS:
        d, m = b.bent(left, float(bend))
        at = b.X[left] + places.margin * (d + _LIFT * m)
        out = ~measurable(_asked(places, at, m, b.hole[left]))
        way[left[out]], up[left[out]] = b.bent(left[out], _likely(float(bend)))
        left = left[~out]
    return way, up


def _likely(least: float) -> float:
    """How far a part turns off that must turn off by ``least``, rad.

    What goes on straight need not turn off; most edges are square; and where that is not enough,
    the least that hides a face is only just enough.
    """
    if least == 0.0:
        return 0.0
    square = 0.5 * np.pi
    return square if least <= square + 1e-6 else least + _MORE


def _asked(places: Places, at: Floats, normal: Floats, hole: Ints) -> Places:
    straight = np.zeros(len(at), dtype=np.bool_)
    return replace(places, at=at, normal=normal, hole=hole, bent=straight)


def _borders(mesh: Mesh, found: Sequence[Hole], some: Bools) -> _Borders:
    """Those of some holes (h,)."""
    normals = np.nan_to_num(vertex_normals(mesh))
    X, n, outward, width = (list[Floats]() for _ in range(4))
    which = [int(k) for k in np.flatnonzero(some)]
    for k in which:
        loop = found[k].loop
        corners = mesh.vertices[loop]
        up = unit(smoothed(normals[loop]))
        along = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
        few = slice(None, None, max(1, len(loop) // _CORNERS))
        X.append(corners[few])
        n.append(up[few])
        outward.append(unit(np.cross(smoothed(along), up))[few])
        width.append(np.full(len(X[-1]), found[k].perimeter / len(X[-1])))
    none = np.zeros((0, 3))
    hole = np.repeat(which, [len(x) for x in X]).astype(np.int32)
    return _Borders(
        np.concatenate([none, *X]),
        np.concatenate([none, *n]),
        np.concatenate([none, *outward]),
        hole,
        np.concatenate([np.zeros(0), *width]),
    )

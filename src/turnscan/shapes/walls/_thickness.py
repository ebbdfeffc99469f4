"""Thickness of walls: from each place of a surface straight through the material to its far side.

Rays go from each point against the mean normal about it, and the mean of those of some 25
neighbouring points that look one way stands for a place, so that noise hardly counts. A ray aslant
is longer whichever way it leans: places where an edge bends the normals count for nothing, and what
noise turns them is taken off. A wall has a thickness where both of its sides were measured. What is
as thick as a third of the part is no wall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints, Longs
from turnscan.mesh import Caster, Mesh, measured_vertices, smoothed_normals, vertex_normals
from turnscan.shapes._stripe_numbers import doubt_along, stripes_of
from turnscan.shapes.verification._statistics import noise_range

_CELL, _LEAST = 25, 10
"""Points of a place, about and at the least."""
_MOSTLY = 0.7
"""Of the points of a place: how many must have a far side."""
_ACROSS = 0.8
"""Cosine between a ray and the normal of the far side, from which on the two are a wall."""
_PLACES, _SHARE = 20, 0.02
"""Places that must have a far side, and which share of all they must be."""
_EDGE, _EVEN = 6.0, 3e-4
"""Where normals are so many times as uneven as most, and as 1°, there is an edge."""
_FLAT = 0.01
"""Share of the largest eigenvalue under which a place has no extent."""
_LIFT = 1e-3
"""Of a face's size: a ray starts so far below it, lest it meets the face that it starts on."""
_THIN = 1 / 3
"""Of the middle one of the part's three extents: more is solid, and has a diameter or a height."""
_RAYS = 100_000
"""Rays at the most, about."""
_MEDIAN = float(np.sqrt(np.pi / 2))
"""How much more the median of normal values scatters than their mean."""
_BLOCK = 9
"""Places of a block, about, over which a wall is even but for noise."""
_FREE = 3
"""What an even wall may be in a block: thick, and thicker to either side."""
_TELLING = 10
"""Places beyond those that their blocks take, from which on they tell how noise goes together."""
_ROBUST = 1.4826
"""Standard deviation of normal values over the median of their sizes."""


@dataclass(frozen=True)
class Walls:
    """How thick the material is between measured sides. All in mm."""

    least: float
    """At the thinnest place."""
    least_sigma: float
    """Standard uncertainty: of the noise, of what walls cut into places, of the calibration."""
    median: float
    """Half of the places are thinner."""
    median_sigma: float
    where: Floats
    """(3,) mm: the thinnest place."""
    noise: float
    """How much thinner than the median noise alone makes the thinnest of as many places."""
    places: int
    """Places that have a measured far side."""
    share: float
    """Share of the measured places that these are."""


def wall_thickness(mesh: Mesh, moves: Sequence[Floats] = ()) -> Walls | None:
    """How thick the material of a part is; None where hardly any wall was measured on both sides.

    A far side that was not measured gives no thickness, nor one more than 37° askew.

    ``moves`` are (v, 3) mm each: how the vertices move with one standard deviation of each common
    cause (`calibration_moves`).
    """
    known = np.flatnonzero(measured_vertices(mesh))
    some = known[:: 1 + len(known) // _RAYS]
    if not len(some):
        return None
    place = _places(mesh, some, _CELL)
    normals = smoothed_normals(mesh)
    face, thick = _through(mesh, mesh.vertices[some], normals[some])
    crossed = thick <= _THIN * _extent(mesh.vertices[some])
    spread = normals[mesh.faces[face[crossed]]].var(axis=1).sum(axis=1)
    crossed[crossed] = _without_edges(spread)
    if not crossed.any():
        return None
    near = some[crossed]
    own, count = np.unique(place[crossed], return_inverse=True, return_counts=True)[1:]
    uneven = _uneven(own, mesh.vertices[near], normals[near])
    good = _without_edges(uneven)
    good &= (count >= _LEAST) & (count >= _MOSTLY * np.bincount(place)[np.unique(place[crossed])])
    total = int((np.bincount(place) >= _LEAST).sum())
    if good.sum() < max(_PLACES, _SHARE * total):
        return None
    of = np.where(good, np.cumsum(good) - 1, -1)[own]
    on = of >= 0
    block = _places(mesh, some, _CELL * _BLOCK)[crossed]
    rays = _Rays(
        of[on], near[on], mesh.faces[face[crossed][on]], normals[near[on]],
        (thick[crossed] * (1.0 - uneven[own] / 2))[on],
        np.unique(block[on], return_inverse=True)[1], face[crossed][on],
    )  # fmt: skip
    return _known(mesh, rays, moves, total)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays through walls, those of the places that count."""

    of: Longs
    """(n,) the place of each."""
    near: Longs
    """(n,) the vertex that it starts from."""
    far: Ints
    """(n, 3) those of the face that it ends in."""
    normals: Floats
    """(n, 3) outward, where it starts."""
    thick: Floats
    """(n,) mm."""
    block: Longs
    """(n,) some `_BLOCK` places on one side of a wall."""
    face: Ints
    """(n,) that it ends in."""


def _known(mesh: Mesh, rays: _Rays, moves: Sequence[Floats], total: int) -> Walls:
    """The thinnest place and the median, with their uncertainties; of ``total`` places."""
    mean = _means(rays.of, rays.thick)
    noise = _noise(rays.of, rays.thick, rays.face) * np.sqrt(_together(mesh, rays))
    variance, middle = noise**2, _of_median(noise, rays) ** 2
    for move in moves:
        apart = move[rays.near] - move[rays.far].mean(axis=1)
        change = _means(rays.of, np.einsum("ij,ij->i", apart, rays.normals))
        variance += change**2
        middle += float(np.median(change)) ** 2
    bent = _bent(mesh, rays, mean)
    middle += float((_felt(bent, mean).mean(axis=0) ** 2).sum())
    variance += (bent**2).sum(axis=1)
    at = int(mean.argmin())
    where = mesh.vertices[rays.near][rays.of == at].mean(axis=0)
    even = noise_range(np.full(len(mean), float(np.median(noise))))
    return Walls(
        float(mean[at]), float(np.sqrt(variance[at])),
        float(np.median(mean)), float(np.sqrt(middle)),
        where, even[0] / 2, len(mean), len(mean) / total,
    )  # fmt: skip


def _together(mesh: Mesh, rays: _Rays) -> float:
    """How many times the variance of their noise the means of places have about walls that are even
    over a block, by the middle one of them: points that share measurements are off together."""
    X = mesh.vertices[rays.near]
    left = _means(rays.of, _off_even(rays.block, X, rays.thick[:, None])[:, 0])
    many = len(left)
    free = many - _FREE * (int(rays.block.max()) + 1)
    noise = float(np.median(_noise(rays.of, rays.thick, rays.face)))
    if free < _TELLING or not noise > 0:
        return 1.0
    spread = _ROBUST * float(np.median(np.abs(left))) * np.sqrt(many / free)
    return max(1.0, float(spread / noise) ** 2)


def _of_median(noise: Floats, rays: _Rays) -> float:
    """mm: the scatter of the median of places that have so much ``noise`` (c,) each, mm.

    The well known ones count by their density about it. A wall that rays cross from both sides is
    measured once: what its points are off by counts twice.
    """
    if not noise.all():
        return 0.0
    ends = np.bincount(rays.far.ravel(), minlength=int(rays.near.max()) + 1) / 3
    seen = np.zeros(len(ends))
    seen[rays.near] = 1.0
    both = float(ends @ seen) / len(rays.near)
    alone = 1.0 / float(np.sqrt(len(noise)) * np.mean(1.0 / noise))
    return _MEDIAN * alone * float(np.sqrt(1.0 + both))


def _bent(mesh: Mesh, rays: _Rays, mean: Floats) -> Floats:
    """(c, s) mm: by how much stripes that are known worse than usual may change each place, each of
    them all its points alike, on either side of the wall. None where they are not known."""
    stripes, p = stripes_of(mesh), mesh.provenance
    if stripes is None or p is None:
        return np.zeros((len(mean), 0))
    known = measured_vertices(mesh) & (stripes.number >= 0) & (p.sigma > 0)
    known &= np.isfinite(p.sigma)
    places = np.concatenate([rays.of, np.repeat(rays.of, 3)])
    ends = np.concatenate([rays.near, rays.far.ravel()])
    one = np.concatenate([np.ones(len(rays.near)), np.full(rays.far.size, 1 / 3)])
    off = rays.thick - mean[rays.of]
    left = np.concatenate([off, np.repeat(off, 3)])
    there = known[ends]
    places, ends, one, left = places[there], ends[there], one[there], left[there]
    if not len(ends):
        return np.zeros((len(mean), 0))
    stripe = np.unique(stripes.number[ends], return_inverse=True)[1]
    doubt = doubt_along(stripe, left, p.sigma[ends], float(np.median(p.sigma[known])))
    many = int(stripe.max()) + 1
    sums = np.bincount(places * many + stripe, one * doubt, len(mean) * many)
    return np.asarray(sums.reshape(len(mean), many) / np.bincount(rays.of)[:, None])


def _felt(changes: Floats, mean: Floats) -> Floats:
    """(c, s) mm: what the median of places feels of ``changes`` of each, were they all changed so.

    However far a place goes, it only goes to the other side: the share of normal values that a
    change takes past their middle, over their density there.
    """
    from scipy.special import ndtr

    spread = max(_ROBUST * float(np.median(np.abs(mean - np.median(mean)))), 1e-12)
    return np.asarray(2.0 * _MEDIAN * spread * (ndtr(changes / spread) - 0.5))


def _extent(X: Floats) -> float:
    """mm: the middle one of the extents of points (n, 3) along their principal axes."""
    away = X - X.mean(axis=0)
    axes = np.linalg.eigh(away.T @ away)[1]
    return float(np.sort(np.ptp(away @ axes, axis=0))[1])


def _through(mesh: Mesh, start: Floats, normals: Floats) -> tuple[Ints, Floats]:
    """From places (n, 3) against their normals: the face (n,) of the far side, and mm to it; NaN
    where it was not measured, or is askew."""
    size = float(np.sqrt(mesh.area_of() / max(len(mesh.faces), 1)))
    way = -normals
    caster = Caster(mesh.vertices, mesh.faces)
    face = caster.first_hits_between(start + _LIFT * size * way, way)
    a, b, c = (mesh.vertices[mesh.faces[face, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    good = (face >= 0) & (length > 0) & measured_vertices(mesh)[mesh.faces[face]].all(axis=1)
    if mesh.measured is not None:
        good &= mesh.measured[face]
    leaning = np.einsum("ij,ij->i", across, way)
    good &= leaning > _ACROSS * length
    out = np.full(len(start), np.nan)
    way_in = np.einsum("ij,ij->i", a - start, across)
    out[good] = way_in[good] / leaning[good]
    return face, out


def _places(mesh: Mesh, some: Longs, many: int) -> Longs:
    """(n,) The place of each vertex: cubes of so ``many`` of them, about, those of each side of a
    thin wall apart, by where they look."""
    normals = np.nan_to_num(vertex_normals(mesh)[some])
    X = mesh.vertices[some]
    side = float(np.sqrt(many * mesh.area_of() / len(some)))
    at = np.floor((X - X.min(axis=0)) / max(side, 1e-12)).astype(np.int64)
    wide = at.max(axis=0) + 1
    chief = np.abs(normals).argmax(axis=1)
    looks = 2 * chief + (np.take_along_axis(normals, chief[:, None], axis=1)[:, 0] < 0)
    keys = ((at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2]) * 6 + looks
    return np.asarray(np.unique(keys, return_inverse=True)[1].ravel(), dtype=np.int64)


def _without_edges(uneven: Floats) -> npt.NDArray[np.bool_]:
    """Which of places, or of faces, have no edge, by the mean squares (n,) of how uneven the unit
    normals at their points are. A face that spans an edge lies in the material."""
    if not len(uneven):
        return np.zeros(0, np.bool_)
    return np.asarray(uneven <= _EDGE * max(float(np.median(uneven)), _EVEN))


def _uneven(of: Longs, X: Floats, normals: Floats) -> Floats:
    """(c,) Mean square of what the unit normals (n, 3) at points of each place are off from a turn
    that is even over the place, as it is on a wall that is curved."""
    left = _off_even(of, X, normals)
    return np.asarray(np.bincount(of, (left**2).sum(axis=1)) / np.maximum(np.bincount(of) - 3, 1))


def _off_even(of: Longs, X: Floats, values: Floats) -> Floats:
    """(n, k) Values (n, k) at points X (n, 3), without what is even over the place of each: the
    same everywhere, or more and more to one side."""
    order = np.argsort(of, kind="stable")
    count = np.bincount(of)
    starts = np.cumsum(count) - count
    away = X - np.column_stack([_means(of, X[:, k]) for k in range(3)])[of]
    away /= max(float(np.sqrt((away**2).sum(axis=1).mean())), 1e-12)
    A = np.column_stack([np.ones(len(X)), away])
    G = np.add.reduceat((A[:, :, None] * A[:, None])[order], starts)
    B = np.add.reduceat((A[:, :, None] * values[:, None])[order], starts)
    # Across the wall the points scatter by their noise alone: that tells nothing of what they do.
    turns = np.linalg.pinv(G, rcond=_FLAT, hermitian=True) @ B
    return np.asarray(values - np.einsum("ij,ijk->ik", A, turns[of]))


def _means(of: Longs, values: Floats) -> Floats:
    """(c,) means of values (n,) by the number of their place."""
    return np.asarray(np.bincount(of, values) / np.bincount(of))


def _noise(of: Longs, values: Floats, far: Ints) -> Floats:
    """(c,) standard uncertainty of those means. Rays that end in one face of the far side share
    what that is off by, so there are as many as such faces at the most."""
    count = np.bincount(of)
    mean = _means(of, values)
    square = np.bincount(of, (values - mean[of]) ** 2) / np.maximum(count - 1, 1)
    ends = np.unique(np.column_stack([of, far]), axis=0)[:, 0]
    return np.sqrt(square / np.minimum(count, np.bincount(ends)))

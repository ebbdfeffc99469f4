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

from turnscan.arrays import Floats, Ints
from turnscan.mesh import Caster, Mesh, measured_vertices, smoothed_normals, vertex_normals
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
    place = _places(mesh, some)
    every = smoothed_normals(mesh)
    normals = every[some]
    face, thick = _through(mesh, mesh.vertices[some], normals)
    crossed = thick <= _THIN * _extent(mesh.vertices[some])
    crossed[crossed] = _without_edges(every[mesh.faces[face[crossed]]].var(axis=1).sum(axis=1))
    rays = np.flatnonzero(crossed)
    if not len(rays):
        return None
    own, count = np.unique(place[crossed], return_inverse=True, return_counts=True)[1:]
    uneven = _uneven(own, mesh.vertices[some[rays]], normals[rays])
    good = _without_edges(uneven)
    good &= (count >= _LEAST) & (count >= _MOSTLY * np.bincount(place)[np.unique(place[crossed])])
    total = int((np.bincount(place) >= _LEAST).sum())
    if good.sum() < max(_PLACES, _SHARE * total):
        return None
    thick[rays] *= 1.0 - uneven[own] / 2
    mean = _means(own, thick[rays])[good]
    far = mesh.faces[face[rays]]
    noise = _noise(own, thick[rays], face[rays])[good]
    common, middle = np.zeros(len(mean)), 0.0
    for move in moves:
        apart = move[some[rays]] - move[far].mean(axis=1)
        change = _means(own, np.einsum("ij,ij->i", apart, normals[rays]))[good]
        common += change**2
        middle += float(np.median(change)) ** 2
    at = int(mean.argmin())
    where = mesh.vertices[some[rays]][own == np.flatnonzero(good)[at]].mean(axis=0)
    even = noise_range(np.full(len(mean), float(np.median(noise))))
    spread = _MEDIAN * float(np.sqrt(np.mean(noise**2) / len(mean)))
    return Walls(
        float(mean[at]), float(np.sqrt(noise[at] ** 2 + common[at])),
        float(np.median(mean)), float(np.hypot(spread, np.sqrt(middle))),
        where, even[0] / 2, len(mean), len(mean) / total,
    )  # fmt: skip


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


def _places(mesh: Mesh, some: npt.NDArray[np.intp]) -> npt.NDArray[np.int64]:
    """(n,) The place of each vertex: cubes of some 25 of them, those of each side of a thin wall
    apart, by where they look."""
    normals = np.nan_to_num(vertex_normals(mesh)[some])
    X = mesh.vertices[some]
    side = float(np.sqrt(_CELL * mesh.area_of() / len(some)))
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


def _uneven(of: npt.NDArray[np.intp], X: Floats, normals: Floats) -> Floats:
    """(c,) Mean square of what the unit normals (n, 3) at points of each place are off from a turn
    that is even over the place, as it is on a wall that is curved."""
    order = np.argsort(of, kind="stable")
    count = np.bincount(of)
    starts = np.cumsum(count) - count
    away = X - np.column_stack([_means(of, X[:, k]) for k in range(3)])[of]
    away /= max(float(np.sqrt((away**2).sum(axis=1).mean())), 1e-12)
    A = np.column_stack([np.ones(len(X)), away])
    G = np.add.reduceat((A[:, :, None] * A[:, None])[order], starts)
    B = np.add.reduceat((A[:, :, None] * normals[:, None])[order], starts)
    # Across the wall the points scatter by their noise alone: that tells nothing of its turn.
    turns = np.linalg.pinv(G, rcond=_FLAT, hermitian=True) @ B
    left = normals - np.einsum("ij,ijk->ik", A, turns[of])
    return np.asarray(np.bincount(of, (left**2).sum(axis=1)) / np.maximum(count - 3, 1))


def _means(of: npt.NDArray[np.intp], values: Floats) -> Floats:
    """(c,) means of values (n,) by the number of their place."""
    return np.asarray(np.bincount(of, values) / np.bincount(of))


def _noise(of: npt.NDArray[np.intp], values: Floats, far: Ints) -> Floats:
    """(c,) standard uncertainty of those means. Rays that end in one face of the far side share
    what that is off by, so there are as many as such faces at the most."""
    count = np.bincount(of)
    mean = _means(of, values)
    square = np.bincount(of, (values - mean[of]) ** 2) / np.maximum(count - 1, 1)
    ends = np.unique(np.column_stack([of, far]), axis=0)[:, 0]
    return np.sqrt(square / np.minimum(count, np.bincount(ends)))

"""The part of a volume, or of an area, that fillings hold, and how well it is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import (
    Mesh,
    components,
    half_edges,
    measured_vertices,
    smoothed_normals,
    submesh,
    vector_areas,
    vertex_normals,
)

_EDGE = float(np.cos(np.radians(60.0)))
"""Along most of the border of a lid the surface stands steeper than this on it."""
_RING = 0.3
"""Of a patch's area, the least that its vector sum must be for it to face one way at all."""
_LID, _WRAPS = 0.8, 0.5
"""The same of a lid, which is about flat; and below which a patch with steep borders wraps round a
side of the part that nobody saw, of which all is doubted."""
_BESIDE = 7
"""Vertices of a border whose normals are averaged where an edge of the part runs beside it …"""
_CREASE = float(np.cos(np.radians(25.0)))
"""… which is where that mean differs from the mean over all that is about by more than this."""
_FLAT, _SMOOTH = 0.6, 0.15
"""Of the doubt, what a flat filling and one in the tangent planes of its border are wrong by: on
balls, cones, cups and the outside of tori 30 to 80 % and up to 20 %."""
_STEEPEST = float(np.radians(60.0))
"""A cap that slopes more at its border is not known to be one."""
_MOSTLY = 0.5
"""Of a surface, the part that was not measured beyond which it is unknown what its fillings hold.
"""
_GOES_ON = (0.35, 0.6)
"""A filling goes on in the tangent planes where it leaves its border at less than this part of the
angle at which a flat one does; from the second figure on it is a flat one."""


@dataclass(frozen=True)
class Added:
    """What was filled."""

    volume: float
    """mm³ between the fillings and straight fans over their borders."""
    sigma: float
    """mm³: its standard uncertainty."""


def added_part(mesh: Mesh, faces: Bools | None = None) -> Added:
    """What the faces of a closed mesh that were not measured add to its volume; with ``faces`` (f,)
    only as much of each filling is doubted as these have of its area.

    Each patch of them is doubted by Σ A δ, δ the distance of a face's middle from the tangent plane
    of the measured vertex nearest to it. A flat filling of a round part is wrong by about 0.6 of
    that, one that goes on in those tangent planes by 0.15; between the two the angle at which it
    leaves its border decides. A patch over an edge of the part is a lid: that it is there was
    chosen, but the edge lies anywhere up to two samples beyond the border, for one is the sampling
    and the clean-up takes one. So a lid is doubted by one sample's distance times its area. Patches
    add up with their signs unknown.

    Where more than half of the surface was not measured, its fillings may as well hold nothing, as
    those over the hole of a ring that no light reached do: they are doubted by at least what makes
    all and nothing equally likely, 1/√2 of it.
    """
    real = mesh.measured
    if real is None or real.all():
        return Added(0.0, 0.0)
    known = measured_vertices(mesh)
    if not known.any():
        return Added(0.0, abs(mesh.volume))
    normals = border_normals(mesh, known, real)
    area = vector_areas(mesh.triangles)
    size = np.linalg.norm(area, axis=1)
    doubt = np.zeros(len(area))
    doubt[~real] = _doubt(mesh, known, normals, area[~real])
    volume = sigma = 0.0
    for mine, border in fillings(mesh, known, real):
        from_middle = mesh.triangles[mine] - mesh.vertices[border].mean(axis=0)
        across = np.cross(from_middle[:, 1], from_middle[:, 2])
        volume += float(np.einsum("ij,ij->", from_middle[:, 0], across)) / 6
        lean = _lean(mesh, mine, border, area[mine], normals)
        part = 1.0 if faces is None else float(size[mine] @ faces[mine] / size[mine].sum())
        if lean.share is None:
            lid = float(np.linalg.norm(area[mine].sum(axis=0)))
            sigma += part * lid * _sample(mesh, real, border)
        else:
            sigma += part * lean.share * float(doubt[mine].sum())
    filled = float(size[~real].sum())
    if filled > _MOSTLY * float(size.sum()):
        chosen = ~real if faces is None else ~real & faces
        part = float(size[chosen].sum()) / filled
        sigma = max(sigma, part * abs(volume) / float(np.sqrt(2)))
    return Added(volume, sigma)


def filled_area_sigma(mesh: Mesh, faces: Bools | None = None) -> float:
    """mm²: how well the area of the fillings among the faces (f,), or among all, is known.

    A cap of a ball over a border where it slopes by β holds tan² β/4 more than the disc of the
    border: by as much a flat filling is doubted, and one that goes on in the tangent planes by as
    much less as its volume is. A lid may lie a sample too low: the wall between is not there. Of a
    filling that wraps round an unseen side, all is doubted. They add up with their signs unknown.
    """
    real = mesh.measured
    chosen = np.ones(len(mesh.faces), dtype=np.bool_) if faces is None else faces
    if real is None or real[chosen].all():
        return 0.0
    known = measured_vertices(mesh)
    area = vector_areas(mesh.triangles)
    size = np.linalg.norm(area, axis=1)
    if not known.any():
        return float(size[chosen].sum())
    normals = border_normals(mesh, known, real)
    sigma = 0.0
    for mine, border in fillings(mesh, known, real):
        some = float(size[mine[chosen[mine]]].sum())
        if not some:
            continue
        whole = float(size[mine].sum())
        lean = _lean(mesh, mine, border, area[mine], normals)
        if lean.share is None:
            doubt = _rim(mesh, mine) * _sample(mesh, real, border)
        elif lean.share == 1.0:
            doubt = whole
        else:
            slope = np.tan(min(lean.beta, _STEEPEST))
            doubt = whole * lean.share / _FLAT * float(slope**2) / 4
        sigma += doubt * some / whole
    return sigma


def fillings(mesh: Mesh, known: Bools, real: Bools) -> Iterator[tuple[Ints, Ints]]:
    """The faces of each patch that was not measured, and the measured vertices of its border."""
    faces = np.flatnonzero(~real).astype(np.int32)
    patch = components(submesh(mesh, ~real))
    ends = np.cumsum(np.bincount(patch))[:-1]
    for mine in np.split(faces[np.argsort(patch, kind="stable")], ends):
        border = np.unique(mesh.faces[mine])
        border = border[known[border]]
        if len(border):
            yield mine, border


def _rim(mesh: Mesh, mine: Ints) -> float:
    """mm: the length of the border of some faces."""
    a, b = half_edges(mesh.faces[mine])
    return float(np.linalg.norm(mesh.vertices[b] - mesh.vertices[a], axis=1).sum())


def _sample(mesh: Mesh, real: Bools, border: Ints) -> float:
    """mm: how far the measured faces along a border reach from it, the usual one."""
    on = np.zeros(len(mesh.vertices), dtype=np.bool_)
    on[border] = True
    beside = np.flatnonzero(real)[on[mesh.faces[real]].sum(axis=1) == 2]
    if not len(beside):
        return 0.0
    # The corner that is not on the border stands so high over the side that is.
    corner = np.argmin(on[mesh.faces[beside]], axis=1)
    t = mesh.triangles[beside]
    k = np.arange(len(t))
    a, b, c = (t[k, (corner + i) % 3] for i in range(3))
    side = np.linalg.norm(c - b, axis=1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(side, 1e-12)
    return float(np.median(height))


def usual_side(triangles: Floats) -> float:
    """mm: the usual side of triangles (f, 3, 3)."""
    sides = triangles - np.roll(triangles, 1, axis=1)
    return float(np.median(np.linalg.norm(sides, axis=2)))


def border_normals(mesh: Mesh, known: Bools, real: Bools) -> Floats:
    """(v, 3) unit normals of what was measured; at its borders those of its own side of an edge.

    A mean over rings of neighbours is steady against noise, and leans half way to the next face
    where an edge is near: a lid on a strip of its own plane would seem to bulge. There the mean
    goes along the border alone.
    """
    from scipy.spatial import cKDTree

    own = replace(mesh, faces=mesh.faces[real], measured=None)
    normals = smoothed_normals(own)
    filled = np.zeros(len(mesh.vertices), dtype=np.bool_)
    filled[mesh.faces[~real]] = True
    border = np.flatnonzero(filled & known)
    if len(border) < _BESIDE:
        return normals
    near = cKDTree(mesh.vertices[border]).query(mesh.vertices[border], _BESIDE)[1]
    along = np.nan_to_num(vertex_normals(own))[border][near].sum(axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    edge = np.einsum("ij,ij->i", along, normals[border]) < _CREASE
    normals = normals.copy()
    normals[border[edge]] = along[edge]
    return normals


def _doubt(mesh: Mesh, known: Bools, normals: Floats, area: Floats) -> Floats:
    """(k,) mm³ for each face that was not measured, ``area`` (k, 3) its vector area."""
    from scipy.spatial import cKDTree

    seen = np.flatnonzero(known)
    middle = mesh.triangles[~np.asarray(mesh.measured)].mean(axis=1)
    near = seen[cKDTree(mesh.vertices[seen]).query(middle)[1]]
    away = np.einsum("ij,ij->i", middle - mesh.vertices[near], normals[near])
    return np.asarray(np.linalg.norm(area, axis=1) * np.abs(away))


class _Lean(NamedTuple):
    """How a patch stands to the surface about it."""

    share: float | None
    """How much of its doubt it deserves, most for a flat filling; None for a lid."""
    beta: float
    """rad: how much the surface about it slopes against it, rms along its border."""


def _lean(mesh: Mesh, mine: Ints, border: Ints, area: Floats, normals: Floats) -> _Lean:
    over = area.sum(axis=0)
    size = float(np.linalg.norm(over))
    flatness = size / max(float(np.linalg.norm(area, axis=1).sum()), 1e-300)
    beta = np.arccos(np.clip(normals[border] @ over / max(size, 1e-300), -1, 1))
    one_way = flatness > _RING
    steep = bool((np.cos(beta) < _EDGE).mean() > 0.5)
    flat = float(np.sqrt(np.mean(beta**2))) if one_way else 1.0
    if flatness > _LID and steep:
        return _Lean(None, flat)
    if flatness < _WRAPS and steep:
        return _Lean(1.0, flat)
    on = np.isin(mesh.faces[mine], border)
    face, corner = np.nonzero(on)
    n = area[face] / np.maximum(np.linalg.norm(area[face], axis=1), 1e-300)[:, None]
    turn = np.einsum("ij,ij->i", n, normals[mesh.faces[mine][face, corner]])
    gamma = float(np.sqrt(np.mean(np.arccos(np.clip(turn, -1, 1)) ** 2)))
    low, high = _GOES_ON
    part = (gamma / max(flat, 1e-3) - low) / (high - low)
    return _Lean(_SMOOTH + (_FLAT - _SMOOTH) * float(np.clip(part, 0.0, 1.0)), flat)

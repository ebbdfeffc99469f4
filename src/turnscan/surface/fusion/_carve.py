"""Carve: a ray that reached its point passed through nothing, and no face may stand in its way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh._parts import submesh
from turnscan.mesh._rays import Caster
from turnscan.surface.fusion._range_surface import RangeSurface

_NOISE = 6.0
"""Sigma that a point has to lie behind a face for its ray to have passed through it …"""
_ROOM = 0.5
"""… on top of this part of the face's longest edge."""
_ROUNDS = 8
"""Faces that one ray may pass through."""
_ON = 0.02
"""mm that a ray goes on from behind a face it has met."""


def carved(surfaces: Sequence[RangeSurface], most: float) -> tuple[list[RangeSurface], int]:
    """The surfaces without the faces that a camera looked through, and how many those were.

    Examined are the faces on which nothing was measured: where the surface may be further than
    ``most`` mm off between its profiles. One is removed where a point that any of the surfaces
    measured was seen through it, from further behind than half its longest edge and six sigma
    explain.
    Source: space carving (Curless & Levoy 1996, §4), with single rays.
    """
    doubted = [s.between() > most for s in surfaces]
    if not any(d.any() for d in doubted):
        return list(surfaces), 0
    eyes = np.concatenate([s.eyes for s in surfaces])
    ends = np.concatenate([s.mesh.vertices for s in surfaces])
    noise = _NOISE * np.concatenate([s.sigma for s in surfaces])
    out, count = [], 0
    for s, which in zip(surfaces, doubted, strict=True):
        keep = np.ones(len(which), dtype=np.bool_)
        if which.any():
            keep[np.flatnonzero(which)[_pierced(s.mesh.triangles[which], eyes, ends, noise)]] = (
                False
            )
        count += int((~keep).sum())
        out.append(s if keep.all() else _part(s, keep))
    return out, count


def _pierced(corners: Floats, eyes: Floats, ends: Floats, noise: Floats) -> Bools:
    """(f,) True for triangles (f, 3, 3) that a ray passes through well before its end."""
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    caster = Caster(corners.reshape(-1, 3), faces)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    room = _ROOM * np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    out = np.zeros(len(corners), dtype=np.bool_)
    way = ends - eyes
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    at, left = eyes, np.arange(len(ends))
    for _ in range(_ROUNDS):
        hit = caster.first_hits_between(at, way[left])
        met = hit >= 0
        left, at, hit = left[met], at[met], hit[met]
        if not len(left):
            break
        n, ray = normal[hit], way[left]
        across = np.einsum("ij,ij->i", ray, n)
        far = np.einsum("ij,ij->i", corners[hit, 0] - at, n) / np.where(across == 0, 1e-12, across)
        place = at + far[:, None] * ray
        beyond = np.einsum("ij,ij->i", ends[left] - place, ray)
        out[hit[beyond > room[hit] + noise[left]]] = True
        on = beyond > 0
        left, at = left[on], place[on] + _ON * ray[on]
    return out


def _part(s: RangeSurface, keep: Bools) -> RangeSurface:
    """The surface of the faces where ``keep`` (f,) is True."""
    used = np.zeros(len(s.mesh.vertices), dtype=np.bool_)
    used[s.mesh.faces[keep]] = True
    random, along = (None if v is None else v[used] for v in (s.random, s.along))
    return replace(
        s, mesh=submesh(s.mesh, keep), eyes=s.eyes[used], normals=s.normals[used], random=random,
        along=along,
    )  # fmt: skip

"""Holes that are the ends of a bore: their lids lie in the air, and what is missing is the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.mesh._rays import Caster
from turnscan.surface.holes._hole_places import Places, flat_lids
from turnscan.surface.holes._holes import Hole
from turnscan.surface.holes._spans import smoothed, unit

_MOST = 0.5
"""Share of the places in either end that must look through the other."""
_RUNS_OUT = 0.5
"""Share of a border beyond which the surface runs on the way that its hole looks."""
_LIDS = 8
"""Lids that a ray may pass before it meets something that was measured."""
_CORNERS = 48
"""Corners of a rim below which its wall is asked, at most."""
_DEPTHS = (1.0 / 6.0, 3.0 / 6.0, 5.0 / 6.0)
"""Where it is asked: in the middle of each third of the way to the other end."""


def through(mesh: Mesh, found: Sequence[Hole], places: Places, some: Bools) -> Floats:
    """(h,) mm from each of ``some`` holes (h,) to the other end of its bore; 0 for no such end.

    Straight behind most of the one lies the other, and nothing that was measured between them;
    behind a dark patch lies the far side of the part. So it is with two missing faces of a solid
    part, too, but there the surface about runs on the way that they look (`_run_out`).
    """
    deep = np.zeros(len(found))
    some = some & ~_run_out(mesh, found, places)
    which = [int(k) for k in np.flatnonzero(some)]
    if len(which) < 2:
        return deep
    ends = [found[k] for k in which]
    asked = np.flatnonzero(some[places.hole])
    own = np.searchsorted(which, places.hole[asked])
    opening = np.zeros((len(ends), 3))
    np.add.at(opening, own, places.normal[asked])
    met = _met(mesh, ends, places.at[asked], -unit(opening)[own], 1e-3 * places.face)
    entered = met[np.arange(len(own)), own]
    passed = np.zeros((len(ends), len(ends)))
    np.add.at(passed, own[entered], met[entered])
    share = passed / np.maximum(np.diag(passed), 1.0)[:, None]
    apart = np.linalg.norm([[a.centre - b.centre for b in ends] for a in ends], axis=2)
    deep[which] = np.where((share >= _MOST) & (share.T >= _MOST), apart, 0.0).max(axis=1)
    return deep


def _run_out(mesh: Mesh, found: Sequence[Hole], places: Places) -> Bools:
    """(h,) True where the surface about a hole runs on the way that the hole looks, at most of its
    border: the end of a body is missing there.

    About a bore it lies across, or goes down into it. A tube whose end was not measured is no other
    than a bar: nothing tells of its bore.
    """
    normals = np.nan_to_num(vertex_normals(mesh))
    opening = np.zeros((len(found), 3))
    np.add.at(opening, places.hole, places.normal)
    # 60°: what turns off by more is the side of the body.
    share = [
        np.mean(_tangents(mesh, normals, h)[1] @ way > 0.5)
        for h, way in zip(found, unit(opening), strict=True)
    ]
    return np.asarray(np.array(share) > _RUNS_OUT)


def _tangents(mesh: Mesh, normals: Floats, hole: Hole) -> tuple[Floats, Floats]:
    """Normals (m, 3) of the surface at a border, and ways (m, 3) along it and off it."""
    corners = mesh.vertices[hole.loop]
    up = unit(smoothed(normals[hole.loop]))
    along = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
    return up, unit(np.cross(smoothed(along), up))


def _met(mesh: Mesh, found: Sequence[Hole], X: Floats, way: Floats, past: float) -> Bools:
    """(m, h) which holes' flat patches rays from X (m, 3) along (m, 3) pass before they meet
    anything that was measured; they go on ``past`` mm beyond each."""
    out = np.zeros((len(X), len(found)), dtype=np.bool_)
    lids, owner = flat_lids(mesh, found)
    closed = Mesh(lids.vertices, np.concatenate([mesh.faces, lids.faces]))
    owner = np.concatenate([np.full(len(mesh.faces), -1, np.int32), owner])
    caster = Caster(closed.vertices, closed.faces)
    X, going = X.copy(), np.arange(len(X))
    for _ in range(_LIDS):
        face = caster.first_hits_between(X[going], way[going])
        lid = np.where(face < 0, -1, owner[face])
        going, face, lid = going[lid >= 0], face[lid >= 0], lid[lid >= 0]
        if not len(going):
            break
        out[going, lid] = True
        corners = closed.vertices[closed.faces[face]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        slope = np.einsum("ij,ij->i", way[going], normal)
        ahead = np.einsum("ij,ij->i", corners[:, 0] - X[going], normal)
        X[going] += (ahead / np.where(slope == 0.0, 1.0, slope) + past)[:, None] * way[going]
    return out


def walls(mesh: Mesh, found: Sequence[Hole], places: Places, deep: Floats) -> Places:
    """Places on the walls of bores, which are ``deep`` (h,) mm from each hole that is an end.

    Where a border lies on the side that the hole opens to, the wall goes down from it; where it
    lies on the wall already, the wall goes on.
    """
    normals = np.nan_to_num(vertex_normals(mesh))
    at, normal, hole = [], [], []
    for k, h in enumerate(found):
        if deep[k] == 0.0:
            continue
        corners, (up, outward) = mesh.vertices[h.loop], _tangents(mesh, normals, h)
        opening = places.normal[places.hole == k].sum(axis=0)
        # 60°: rims that turn down by more are edges.
        outside = (up @ opening > 0.5 * np.linalg.norm(opening))[:, None]
        down, wall = np.where(outside, -up, outward), np.where(outside, outward, up)
        few = slice(None, None, max(1, len(corners) // _CORNERS))
        for depth in _DEPTHS:
            away = depth * deep[k] * down[few] + 0.25 * places.margin * wall[few]
            at.append(corners[few] + away)
            normal.append(wall[few])
            hole.append(np.full(len(wall[few]), k, dtype=np.int32))
    X = np.concatenate(at)
    straight = np.zeros(len(X), dtype=np.bool_)
    return replace(
        places, at=X, normal=np.concatenate(normal), hole=np.concatenate(hole), bent=straight
    )

"""Bridge: two borders, or a side of each, joined by faces that were not measured."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.errors import InputError
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._soundness import crossings
from turnscan.mesh._topology import half_edges, hanging_together
from turnscan.surface.holes._fill import FillHow, Patch, refined, side_lengths, with_patches
from turnscan.surface.holes._holes import Hole

Side = tuple[int, int]
"""Two vertex numbers, in either order."""
_LARGEST = 16_000_000
"""Product of the vertices of two borders that are joined, at most."""


def bridge(mesh: Mesh, a: Side | Hole, b: Side | Hole, how: FillHow = "tangent") -> Mesh:
    """Join two sides that lie on borders, or two whole borders, with faces not ``measured``.

    Two sides get a strip between them, which parts a hole in two or makes one of two holes. Two
    borders (those of an island and of the hole round it, or the two ends of a gap round the part)
    get a band of least area, refined and faired like a filling (`fill`; ``flat`` adds no vertices,
    and ``auto`` is ``tangent``: a bridge leads from one surface on to another).
    No vertex that is there moves.

    Raises InputError for a side or a hole that is not on a border, or where the faces would have
    sides in common with others, or would cut through them or lie on them.
    """
    if isinstance(a, Hole) and isinstance(b, Hole):
        return _checked(mesh, with_patches(mesh, [_band(mesh, a.loop, b.loop, how)]))
    if isinstance(a, Hole) or isinstance(b, Hole):
        raise InputError("a bridge joins two edges or two holes")
    return _checked(mesh, with_patches(mesh, [_strip(mesh, a, b)]))


def _checked(mesh: Mesh, done: Mesh) -> Mesh:
    """The mesh with its bridge, if that makes no side of three faces and no pinched vertex, and
    cuts through nothing.
    """
    before = {tuple(s) for s in np.stack(half_edges(mesh.faces), axis=1).tolist()}
    new = done.faces[len(mesh.faces) :]
    sides = np.sort(np.concatenate([new[:, [0, 1]], new[:, [1, 2]], new[:, [2, 0]]]), axis=1)
    old = mesh.faces[np.isin(mesh.faces, sides).sum(axis=1) >= 2]
    known = np.sort(np.concatenate([old[:, [0, 1]], old[:, [1, 2]], old[:, [2, 0]]]), axis=1)
    taken = {tuple(s) for s in known.tolist()} - {tuple(sorted(s)) for s in before}
    twice = any(tuple(s) in taken for s in sides.tolist())
    if twice or not hanging_together(done.faces)[len(mesh.faces) :].all():
        raise InputError(
            "a bridge there would touch the existing surface", hint="choose edges further apart"
        )
    added = np.arange(len(done.faces)) >= len(mesh.faces)
    if len(crossings(done, added)):
        raise InputError(
            "a bridge there would cut through the existing surface, or lie on it",
            hint="choose edges that face each other across a gap",
        )
    return done


def _strip(mesh: Mesh, a: Side, b: Side) -> Patch:
    begin, end = half_edges(mesh.faces)
    there = set(zip(begin.tolist(), end.tolist(), strict=True))
    (u, v), (p, q) = (_directed(there, side) for side in (a, b))
    if {u, v} == {p, q}:
        raise InputError(f"edges {a} and {b} are the same", hint="choose two edges")
    if u == q or v == p:
        # Neighbours round a notch: one face between them.
        corners = [v, u, p] if u == q else [v, u, q]
        return Patch(np.array(corners, np.int32), np.empty((0, 3)), np.array([[0, 1, 2]], np.int32))
    x = mesh.vertices[[v, u, q, p]]
    shorter = np.linalg.norm(x[0] - x[2]) <= np.linalg.norm(x[1] - x[3])
    faces = [[0, 1, 2], [0, 2, 3]] if shorter else [[0, 1, 3], [1, 2, 3]]
    return Patch(np.array([v, u, q, p], np.int32), np.empty((0, 3)), np.array(faces, np.int32))


def _directed(there: set[tuple[int, int]], side: Side) -> Side:
    for one in (side, side[::-1]):
        if one in there:
            return one
    raise InputError(f"edge {side} does not lie on a boundary", hint="take edges of holes(mesh)")


def _band(mesh: Mesh, one: Ints, other: Ints, how: FillHow) -> Patch:
    from turnscan.surface.holes import _patch_kernels as kernels

    if len(one) * len(other) > _LARGEST:
        raise InputError(
            f"boundaries of {len(one)} and {len(other)} vertices are too long to join",
            hint="decimate the mesh first",
        )
    for loop in (one, other):
        _on_border(mesh, loop)
    if np.isin(one, other).any():
        raise InputError("the two boundaries share vertices", hint="choose two holes")
    # The band runs against the winding of the faces on both sides.
    first, second = one[::-1], other[::-1]
    i, j = _nearest(mesh.vertices[first], mesh.vertices[second])
    first, second = np.roll(first, -i), np.roll(second, -j)
    faces = kernels.lace(mesh.vertices[first], mesh.vertices[second])
    ring = np.concatenate([first, second]).astype(np.int32)
    if how == "flat":
        return Patch(ring, np.empty((0, 3)), faces)
    used = np.zeros((len(ring), len(ring)), dtype=np.bool_)
    return refined(ring, mesh.vertices[ring], faces, side_lengths(mesh)[ring], used, how)


def _on_border(mesh: Mesh, loop: Ints) -> None:
    begin, end = half_edges(mesh.faces)
    size = len(mesh.vertices)
    rim = begin.astype(np.int64) * size + end
    there: npt.NDArray[np.int64] = np.array(loop, dtype=np.int64)
    if len(there) < 3 or not np.isin(there * size + np.roll(there, -1), rim).all():
        raise InputError(
            "a hole to bridge is not a boundary of this mesh",
            hint="take the holes of the mesh that is to be bridged",
        )


def _nearest(a: Floats, b: Floats) -> tuple[int, int]:
    from scipy.spatial import cKDTree

    distance, which = cKDTree(b).query(a)
    i = int(np.argmin(distance))
    return i, int(np.atleast_1d(which)[i])

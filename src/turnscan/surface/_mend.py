"""Mend: faces that cut through each other are taken away, and the places filled anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Ints
from turnscan.surface._fill import FillHow, patches, with_patches
from turnscan.surface._grid_mesh import half_edges, submesh
from turnscan.surface._mesh import Mesh
from turnscan.surface._paste import components, measured
from turnscan.surface._soundness import crossings
from turnscan.surface._topology import boundary_loops, hanging_together

_ROUNDS: tuple[FillHow, ...] = ("tangent", "tangent", "flat", "tangent", "flat")
"""How the places are filled in each round; a ring more is taken away in every other."""
_SIMPLE = 0.1
"""A larger share of faces than this that cut through others is no small flaw."""
_PIECE = 0.01
"""A piece of less than this share of the faces goes where its connection was taken away."""


def mend(mesh: Mesh) -> tuple[Mesh, int, int]:
    """The mesh with small self-intersections mended, how many faces were replaced, and how many
    pairs of faces still cut through each other.

    Where a measured face and a filled one cut through each other, the filled one gives way. The
    faces go with those round them, and what was open before stays open. Where more than 10 % of
    the faces cut through others, or it cannot be mended, the mesh stays as it is there.
    """
    replaced, pairs = 0, crossings(mesh)
    for number, how in enumerate(_ROUNDS):
        if not len(pairs) or len(np.unique(pairs)) > _SIMPLE * len(mesh.faces):
            break
        done, kept = _refilled(mesh, _giving_way(mesh, pairs, number), how)
        # What is left has no crossing: one of each pair went. Only new faces can make others.
        left = crossings(done, np.arange(len(done.faces)) >= kept)
        if len(left) <= len(pairs):
            replaced += len(mesh.faces) - kept
            mesh, pairs = done, left
    whole = np.ones(len(mesh.faces), dtype=np.bool_)
    return (submesh(mesh, whole) if replaced else mesh), replaced, len(pairs)


def _giving_way(mesh: Mesh, pairs: Ints, number: int) -> Bools:
    """(f,) True for the faces to be taken away in a round."""
    known, gentle = measured(mesh), number < 2
    bad = np.zeros(len(mesh.faces), dtype=np.bool_)
    mixed = known[pairs[:, 0]] != known[pairs[:, 1]]
    bad[pairs[mixed]] = True
    if gentle:
        bad &= ~known
    bad[pairs[~mixed]] = True
    for _ in range(1 + number // 2):
        near = np.zeros(len(mesh.vertices), dtype=np.bool_)
        near[mesh.faces[bad]] = True
        round_it = near[mesh.faces].any(axis=1)
        bad |= round_it & ~known if gentle else round_it
    return bad


def _refilled(mesh: Mesh, bad: Bools, how: FillHow) -> tuple[Mesh, int]:
    """The mesh without the faces ``bad``, the holes that this leaves filled, and how many faces
    (the first ones) stayed."""
    border = np.zeros(len(mesh.vertices), dtype=np.bool_)
    border[np.concatenate(half_edges(mesh.faces))] = True
    near = np.zeros(len(mesh.vertices), dtype=np.bool_)
    near[mesh.faces[bad]] = True
    keep = ~bad
    keep[keep] = hanging_together(mesh.faces[keep])
    near[mesh.faces[~keep]] = True
    keep[keep] = _not_cut_off(_part(mesh, keep), near)
    left = _part(mesh, keep)
    loops = [k for k in boundary_loops(left) if not border[k].any()]
    return with_patches(left, patches(left, loops, how), how), len(left.faces)


def _not_cut_off(mesh: Mesh, near: Bools) -> Bools:
    """(f,) False for small pieces that have lost their connection to the rest."""
    label = components(mesh)
    size = np.bincount(label)
    touched = np.bincount(label, near[mesh.faces].any(axis=1)) > 0
    lost = touched & (size < _PIECE * len(mesh.faces))
    return np.asarray(~lost[label])


def _part(mesh: Mesh, keep: Bools) -> Mesh:
    """Some faces of a mesh, all vertices in their places."""
    return replace(mesh, faces=mesh.faces[keep], measured=measured(mesh)[keep])

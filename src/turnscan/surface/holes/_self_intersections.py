"""Repair of self-intersections: faces that intersect are removed, and the places filled again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import components, measured
from turnscan.mesh._soundness import crossings
from turnscan.mesh._topology import boundary_loops, half_edges, hanging_together
from turnscan.surface.holes._fill import FillHow, patches, with_patches

_ROUNDS: tuple[FillHow, ...] = ("tangent", "tangent", "flat", "tangent", "flat")
"""How the places are filled in each round, those of flat patches always flat; a ring more is
removed in every other."""
_SIMPLE = 0.1
"""A larger share of faces than this that cut through others is no small flaw."""
_MOSTLY = 0.5
"""A place lies mostly in a patch where more than this share of its border does."""
_PIECE = 0.01
"""A piece of less than this share of the faces goes where its connection was removed."""


@dataclass(frozen=True)
class Repaired:
    """A mesh with small self-intersections repaired."""

    mesh: Mesh
    """With all vertices it had, in their places, also those that no face uses any more."""
    owner: Ints
    """(f,) the patch that each face belongs to, −1 for none."""
    replaced: int
    """How many faces were rebuilt."""
    pairs: Ints
    """(k, 2) faces that still cut through each other."""


def repair_self_intersections(mesh: Mesh, owner: Ints, flat: Bools, *, hold: bool) -> Repaired:
    """Take faces that cut through others away with those round them, and fill the places again.

    Where a measured face and a filled one cut through each other, the filled one gives way. What
    was open before stays open. Where more than 10 % of the faces cut through others, or it cannot
    be repaired, the mesh stays as it is there. ``owner`` (f,) is the patch of each face, −1 for
    none; places mostly in patches that are ``flat`` (n,) are filled flat. With ``hold``
    only faces of patches are asked for and taken away; all others stay, in their order.
    """
    replaced, pairs = 0, crossings(mesh, owner >= 0 if hold else None)
    for number, how in enumerate(_ROUNDS):
        if not len(pairs) or len(np.unique(pairs)) > _SIMPLE * len(mesh.faces):
            break
        bad = _giving_way(mesh, pairs, number)
        place = _refilled(mesh, bad & (owner >= 0) if hold else bad, owner, flat, how)
        if hold and not place.keep[owner < 0].all():
            break
        # What is left has no crossing: one of each pair went. Only new faces can make others.
        kept = int(place.keep.sum())
        left = crossings(place.mesh, np.arange(len(place.mesh.faces)) >= kept)
        if len(left) <= len(pairs):
            replaced += len(mesh.faces) - kept
            mesh, pairs = place.mesh, left
            owner = np.concatenate([owner[place.keep], place.owner])
    return Repaired(mesh, owner, replaced, pairs)


def _giving_way(mesh: Mesh, pairs: Ints, number: int) -> Bools:
    """(f,) True for the faces to be removed in a round."""
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


@dataclass(frozen=True)
class _Refilled:
    mesh: Mesh
    keep: Bools
    """(f,) which faces stayed; they are the first ones."""
    owner: Ints
    """(k,) the patches that the others belong to."""


def _refilled(mesh: Mesh, bad: Bools, owner: Ints, flat: Bools, how: FillHow) -> _Refilled:
    """The mesh without the faces ``bad``, the holes that this leaves filled."""
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
    of = np.full(len(mesh.vertices), -1, dtype=np.int32)
    np.maximum.at(of, mesh.faces[~keep], owner[~keep, None])
    level = np.append(flat, False)[of]
    owners = [_most(of[k]) for k in loops]
    calm: FillHow = "membrane" if how == "tangent" else how
    hows: list[FillHow] = [calm if level[k].mean() > _MOSTLY else how for k in loops]
    made = patches(left, loops, hows)
    again = np.repeat(np.array(owners, dtype=np.int32), [len(p.faces) for p in made])
    return _Refilled(with_patches(left, made), keep, again)


def _most(owners: Ints) -> int:
    """The patch that a place belonged to, by the vertices of its border; −1 where to none."""
    known = owners[owners >= 0]
    return int(np.bincount(known).argmax()) if len(known) else -1


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

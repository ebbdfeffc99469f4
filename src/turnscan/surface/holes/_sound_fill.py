"""Fill what can be filled: a hole whose patch would cut through the surface stays open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Ints
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._parts import measured, submesh
from turnscan.progress import Progress, no_progress
from turnscan.surface.holes._fill import FillHow, patches, unmeasured, with_patches
from turnscan.surface.holes._holes import Hole
from turnscan.surface.holes._self_intersections import Repaired, repair_self_intersections

_RINGS = 12
"""Rings of faces round a hole; its filling goes on with the curvature of those next to it."""


@dataclass(frozen=True)
class Filled:
    """A mesh whose holes were filled as far as nothing cuts through the surface for it."""

    mesh: Mesh
    """Begins with the vertices and faces that were there."""
    owner: Ints
    """(f,) which of the holes each face fills, −1 for the faces that were there."""
    flat: Bools
    """(n,) True for the holes whose patch is flat or a membrane."""
    left: list[Hole]
    """These stayed open."""
    replaced: int
    """Faces of patches that cut through others and were rebuilt."""


def fill_soundly(
    mesh: Mesh,
    which: Sequence[Hole],
    how: FillHow | Sequence[FillHow] = "auto",
    progress: Progress = no_progress,
    *,
    hold: bool = True,
    floor: float | None = None,
) -> Filled:
    """Fill holes of a mesh (`fill`), but none whose patch would cut through the surface.

    A border that runs round many tongues, as where light grazes the surface, or round a corner of
    the part, has no surface that continues it: its patch cuts through the part, through another
    patch or through itself. Faces of patches that do are removed with those round them and made
    anew; a patch with a face that even then cuts through another is left out, of two that cut
    through each other the one that does so more. No face and no vertex of the mesh changes. Without
    ``hold`` a patch stays that `repair_self_intersections` brings to fit by making measured faces
    anew; that is then to be done. ``how`` is that of all holes, or of each. No added vertex lies
    below ``floor`` mm, on which the part stands, nor, where something measured does, below that.
    Raises InputError for a hole that is not one of this mesh.
    """
    if not which:
        none = np.zeros(0, dtype=np.bool_)
        return Filled(mesh, np.full(len(mesh.faces), -1, dtype=np.int32), none, [], 0)
    sewn, owner, flat = _sewn(mesh, [h.loop for h in which], how, progress)
    if floor is not None:
        sewn = _above(sewn, len(mesh.vertices), min(floor, float(mesh.vertices[:, 2].min())))
    done = repair_self_intersections(sewn, owner, flat, hold=True)
    out = _cutting(done.owner[done.pairs], len(which))
    if out.any() and not hold:
        out = _beyond_repairing(done, flat)
    keep = ~np.isin(done.owner, np.flatnonzero(out))
    left = [h for h, o in zip(which, out, strict=True) if o]
    whole = _kept(done.mesh, keep, len(mesh.vertices))
    return Filled(whole, done.owner[keep], flat, left, done.replaced)


def _above(mesh: Mesh, first: int, floor: float) -> Mesh:
    """The mesh with its vertices from ``first`` on at ``floor`` mm or above."""
    vertices = mesh.vertices.copy()
    vertices[first:, 2] = np.maximum(vertices[first:, 2], floor)
    return replace(mesh, vertices=vertices)


def _beyond_repairing(done: Repaired, flat: Bools) -> Bools:
    """(n,) True for patches to leave out, so that the repair handles all others: worst first."""
    out = np.zeros(len(flat), dtype=np.bool_)
    while True:
        keep = ~np.isin(done.owner, np.flatnonzero(out))
        rest = replace(done.mesh, faces=done.mesh.faces[keep], measured=measured(done.mesh)[keep])
        judged = repair_self_intersections(rest, done.owner[keep], flat, hold=False)
        own = judged.owner[judged.pairs]
        if not (own >= 0).any():
            return out
        out[np.bincount(own[own >= 0], minlength=len(flat)).argmax()] = True


def _sewn(
    mesh: Mesh, loops: Sequence[Ints], how: FillHow | Sequence[FillHow], progress: Progress
) -> tuple[Mesh, Ints, Bools]:
    """The mesh filled, (f,) whose patch each face is, and (n,) which patches are flat.

    Only the rings of faces about the borders are looked at.
    """
    near = np.zeros(len(mesh.vertices), dtype=np.bool_)
    near[np.concatenate(loops)] = True
    for _ in range(_RINGS):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    about = np.asarray(near[mesh.faces].all(axis=1))
    part, ids = submesh(mesh, about), np.flatnonzero(_used(mesh, about)).astype(np.int32)
    there = [np.searchsorted(ids, k).astype(np.int32) for k in loops]
    made = patches(part, there, how, progress)
    done = with_patches(part, made)
    v, f = len(part.vertices), len(part.faces)
    number = np.concatenate([ids, len(mesh.vertices) + np.arange(len(done.vertices) - v)])
    sewn = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, done.vertices[v:]]),
        faces=np.concatenate([mesh.faces, number[done.faces[f:]].astype(np.int32)]),
        provenance=unmeasured(mesh.provenance, len(done.vertices) - v),
        colour=None if done.colour is None else np.concatenate([mesh.colour, done.colour[v:]]),
        measured=np.concatenate([measured(mesh), np.zeros(len(done.faces) - f, dtype=np.bool_)]),
    )
    sizes = [len(p.faces) for p in made]
    owner = np.repeat(np.arange(-1, len(made), dtype=np.int32), [len(mesh.faces), *sizes])
    return sewn, owner, np.array([p.order in (None, 1) for p in made], dtype=np.bool_)


def _used(mesh: Mesh, faces: Bools) -> Bools:
    used = np.zeros(len(mesh.vertices), dtype=np.bool_)
    used[mesh.faces[faces]] = True
    return used


def _cutting(own: Ints, count: int) -> Bools:
    """(n,) True for patches to leave out, so that no pair of faces that cut each other stays.

    ``own`` (k, 2) are the patches of the pairs, −1 for a face of none. Where a pair has no patch it
    is not the fault of any.
    """
    out = np.zeros(count, dtype=np.bool_)
    own = own[(own >= 0).any(axis=1)]
    while len(own):
        # A face that was there cannot be left out, so it is the patch that is.
        sure = own[(own < 0).any(axis=1) | (own[:, 0] == own[:, 1])].max(axis=1)
        worst = np.bincount(own[own >= 0], minlength=count).argmax()
        out[sure if len(sure) else worst] = True
        own = own[~(out[own] & (own >= 0)).any(axis=1)]
    return out


def _kept(mesh: Mesh, keep: Bools, count: int) -> Mesh:
    """Some faces of a mesh, its first ``count`` vertices, and of the others those they use."""
    faces = mesh.faces[keep]
    used = np.arange(len(mesh.vertices)) < count
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32) - 1
    p = mesh.provenance
    if p is not None:
        p = Provenance(p.sigma[used], p.laser[used], p.step[used], p.line[used], p.lasers)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=number[faces],
        provenance=p,
        colour=None if mesh.colour is None else mesh.colour[used],
        measured=measured(mesh)[keep],
    )


def unfilled(left: Sequence[Hole], hint: str) -> Finding:
    """What to say of holes of a mesh that cannot be filled soundly."""
    x, y, z = left[0].centre
    text = (
        f"{len(left)} gap(s) up to {max(h.size for h in left):.1f} mm wide stay open: filled, the "
        "surface would intersect itself there"
    )
    where = f"({x:.2f}, {y:.2f}, {z:.2f}) mm"
    more = "" if len(left) == 1 else f", the first of {len(left)}"
    return Finding("surface.unfilled", "warning", text, where + more, hint)

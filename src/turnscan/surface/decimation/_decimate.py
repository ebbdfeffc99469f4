"""Decimate: as few faces as a tolerance allows, or a number of them, out of measured vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import measured, submesh
from turnscan.mesh._topology import opposite_half_edges, vertex_fans
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy

_HELD = 2 / 3
"""Part of the tolerance to which the places compared are held; what lies between may be more."""
_LAST = 1e12
"""mm², a cost above all that quadrics give."""
_AT_A_TIME = 10_000
"""Vertices looked at from one word about the progress to the next."""
_FEWEST = 4
"""Faces of the smallest closed surface."""


def decimate(
    mesh: Mesh,
    *,
    tolerance: float | None = None,
    faces: int | None = None,
    progress: Progress = no_progress,
) -> Mesh:
    """The mesh with fewer faces: at most ``faces``, and never further than ``tolerance`` mm off.

    Vertices move into a neighbour one after the other, those first that lie nearest to the planes
    of the faces they stand for (quadric error metrics, Garland & Heckbert 1997). So those that are
    left stand where they were measured and keep their provenance and colour. Borders move along
    themselves only; sharp edges are kept by their quadrics; what separates measured from added
    faces stays. No face turns over, and the surface hangs together as it did: manifold stays
    manifold.

    With a tolerance no place of either surface lies further than that from the other one, and no
    border vertex from the new border: both are compared at vertices, sides and insides of faces,
    which are held to two thirds of it. Where ``faces`` cannot be reached more are left.
    ``progress`` hears now and then how much of it is done.

    Raises InputError where neither is given, or one is not positive.
    """
    if tolerance is None and faces is None:
        raise InputError(
            "neither a tolerance nor a face count is given",
            hint="give a tolerance in mm or a number of faces",
        )
    if tolerance is not None and not (tolerance > 0 and np.isfinite(tolerance)):
        raise InputError(f"a tolerance of {tolerance} mm", hint="give a positive length")
    if faces is not None and faces < _FEWEST:
        raise InputError(f"decimate to {faces} faces", hint=f"give {_FEWEST} or more")
    if len(mesh.faces) <= (faces or 0):
        return mesh
    net = _net(mesh, np.inf if tolerance is None else tolerance)
    _collapse(net, faces or 0, progress)
    kept = net.faces[:, 0] >= 0
    return submesh(replace(mesh, faces=np.where(kept[:, None], net.faces, 0)), kept)


def dissolve(mesh: Mesh, which: Bools) -> tuple[Mesh, Bools]:
    """The mesh without the vertices ``which`` (v,) that can move into a neighbour, and (w,) which
    of those that are left could not.

    All others stay where they are, with longer faces between them. The rules are `decimate`'s: no
    face turns over, borders move along themselves only, and the surface hangs together as it did.
    """
    net = _net(mesh, np.inf)
    # Into one that stays, wherever that goes: one that many have moved into goes nowhere.
    net = net._replace(locked=net.locked | ~which, own=np.where(which, _LAST, 0.0))
    _collapse(net, 0, no_progress)
    kept = net.faces[:, 0] >= 0
    left = np.zeros(len(which), dtype=np.bool_)
    left[net.faces[kept]] = True
    faces = np.where(kept[:, None], net.faces, 0)
    return submesh(replace(mesh, faces=faces), kept), which[left]


def _net(mesh: Mesh, tolerance: float) -> Any:
    """The mesh as the kernels take it, with samples only where there is a tolerance."""
    from turnscan.surface.decimation import _net_kernels as kernels

    twin = opposite_half_edges(mesh.faces)
    border = twin < 0
    chain = _chain(mesh, border)
    own = mesh.faces.copy()
    samples, owners = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
    if np.isfinite(tolerance):
        samples, owners = _samples(mesh, twin)
    head, after = kernels.lists(own.ravel(), len(mesh.vertices))
    first, follow = kernels.lists(owners, len(own))
    middle = mesh.vertices.mean(axis=0)
    return kernels.Net(
        points=mesh.vertices - middle,
        faces=own,
        head=head,
        after=after,
        q=kernels.quadrics(mesh.vertices - middle, mesh.faces, border),
        own=np.zeros(len(mesh.vertices)),
        locked=_locked(mesh, twin),
        chain=chain,
        rim=chain.copy(),
        samples=samples - middle,
        first=first,
        follow=follow,
        old=mesh.faces,
        old_head=head.copy(),
        old_after=after.copy(),
        limit=(_HELD * tolerance) ** 2,
    )


def _collapse(net: Any, wanted: int, progress: Progress) -> None:
    """Move vertices until ``wanted`` faces are left or no move is allowed."""
    from turnscan.surface.decimation import _collapse_kernels as kernels

    line, waiting = kernels.queue(net)
    size, first = waiting, len(net.faces)
    left, share = first, 0.0
    while size > 0 and left > wanted:
        # A vertex whose neighbour moved waits once more: the share may not go back for that.
        share = max(share, 1 - size / waiting, (first - left) / (first - wanted))
        progress(share)
        size, left = kernels.collapse(net, line, size, left, wanted, _AT_A_TIME)


def decimation_findings(before: Mesh, after: Mesh, wanted: int | None) -> list[Finding]:
    """How many faces are left, and that ``wanted`` was not reached."""
    text = f"{len(after.faces)} of {len(before.faces)} faces are left"
    out = [Finding("surface.decimated", "note", text)]
    if wanted is not None and len(after.faces) > wanted:
        text = f"{wanted} faces cannot be reached: further decimation would break the surface"
        remedy = Remedy("close it first with ", Option("close"))
        out.append(Finding("surface.decimated", "warning", text, "", remedy))
    return out


def _chain(mesh: Mesh, border: Bools) -> Ints:
    """(2, v) the next vertex along the border, and the one before; −1 for vertices inside."""
    start, end = mesh.faces.ravel()[border], mesh.faces[:, [1, 2, 0]].ravel()[border]
    chain = np.full((2, len(mesh.vertices)), -1, dtype=np.int32)
    chain[0, start], chain[1, end] = end, start
    return chain


def _samples(mesh: Mesh, twin: Ints) -> tuple[Floats, Ints]:
    """Vertices, middles of sides and of faces, (m, 3) mm, and a face (m,) of each, −1 for none."""
    once = np.flatnonzero((twin < 0) | (np.arange(len(twin)) < twin))
    begin, end = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    middles = (mesh.vertices[begin[once]] + mesh.vertices[end[once]]) / 2
    owner = np.full(len(mesh.vertices), -1, dtype=np.int32)
    owner[begin] = np.arange(len(begin)) // 3
    places = np.concatenate([mesh.vertices, middles, mesh.triangles.mean(axis=1)])
    owners = np.concatenate([owner, once // 3, np.arange(len(mesh.faces))])
    return places, owners.astype(np.int32)


def _locked(mesh: Mesh, twin: Ints) -> Bools:
    """(v,) True where the surface is not a manifold, and where measured and added faces meet."""
    v = len(mesh.vertices)
    _, about = vertex_fans(mesh.faces)
    locked = np.asarray(np.bincount(about, minlength=v) > 1)
    a, b = mesh.faces.ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    real = measured(mesh)
    odd = (twin >= 0) & (np.repeat(real, 3) != real[twin // 3])
    lone = np.flatnonzero(twin < 0)
    low, high = np.minimum(a[lone], b[lone]).astype(np.int64), np.maximum(a[lone], b[lone])
    _, which, count = np.unique(low * v + high, return_inverse=True, return_counts=True)
    # A border has one face. Several without a twin: more than two meet there, or wound unlike.
    odd[lone[count[which] > 1]] = True
    locked[a[odd]] = locked[b[odd]] = True
    return locked

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
from turnscan.mesh._soundness import crossings
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
_SHARES = (0.25, 0.25, 0.25, 0.5, 1.0, 1.0)
"""Rounds in which more vertices are held, where faces would cut through each other: parts of the
space that two such faces share."""
_NEAREST = 4
"""Vertices that are held there at least."""
_COARSE = 0.1
"""Share of what a part is across, above which a tolerance is worth a word."""


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
    which are held to two thirds of it. Vertices stay where faces would cut through each other that
    did not before, as far as that helps: of walls much thinner than the tolerance little is taken.
    So more than ``faces`` may be left.
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
    held = np.zeros(len(mesh.vertices), dtype=np.bool_)
    best, fewest, own = mesh, np.inf, None
    for share in _SHARES:
        done = _coarser(mesh, tolerance or np.inf, faces or 0, held, progress)
        # The share that was heard of is not taken back.
        progress = progress.subrange(1, 1)
        cuts = _cuts(done)
        if len(cuts[0]) and own is None:
            own = _cuts(mesh)
        # Without a tolerance nobody knows how far those from before may have gone.
        cuts = cuts if own is None else _new(cuts, own, tolerance or 0.0)
        if len(cuts[0]) < fewest:
            best, fewest = done, len(cuts[0])
        about = _around(mesh.vertices, cuts, share)
        if held[about].all():
            break
        held[about] = True
    return best


def _coarser(mesh: Mesh, tolerance: float, faces: int, held: Bools, progress: Progress) -> Mesh:
    """The mesh with ``faces`` or as few as the tolerance allows; vertices ``held`` (v,) stay."""
    from turnscan.surface.decimation import _net_kernels as kernels

    net = _net(mesh, tolerance)
    net.ids[held, kernels.LOCKED] = 1
    _collapse(net, faces, progress)
    left, kept = _faces(net)
    return submesh(replace(mesh, faces=left), kept)


def _cuts(mesh: Mesh) -> tuple[Floats, Floats]:
    """Where faces cut through each other: the middles (k, 3) of the boxes that two of them share,
    and half the boxes' diagonals (k,) mm."""
    pairs = mesh.triangles[crossings(mesh)]
    low, high = pairs.min(axis=2).max(axis=1), pairs.max(axis=2).min(axis=1)
    return (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2


def _new(
    cuts: tuple[Floats, Floats], own: tuple[Floats, Floats], tolerance: float
) -> tuple[Floats, Floats]:
    """Those of ``cuts`` that are none of the surface's ``own`` before anything became coarser."""
    from scipy.spatial import cKDTree

    if not len(own[0]) or not len(cuts[0]):
        return cuts
    far = cKDTree(own[0]).query(cuts[0])[0] > cuts[1] + tolerance
    return cuts[0][far], cuts[1][far]


def _around(X: Floats, cuts: tuple[Floats, Floats], share: float) -> Ints:
    """Vertices X (v, 3) where faces cut each other (`_cuts`): the nearest ones, and those within a
    ``share`` of half the shared box's diagonal."""
    from scipy.spatial import cKDTree

    middle, reach = cuts
    if not len(middle):
        return np.zeros(0, dtype=np.int32)
    tree = cKDTree(X)
    near = tree.query(middle, k=_NEAREST)[1]
    inside = tree.query_ball_point(middle, share * reach)
    return np.unique(np.concatenate([near.ravel(), *inside])).astype(np.int32)


def dissolve(mesh: Mesh, which: Bools) -> tuple[Mesh, Bools]:
    """The mesh without the vertices ``which`` (v,) that can move into a neighbour, and (v,) which
    of all are left.

    All others stay where they are, with longer faces between them. The rules are `decimate`'s: no
    face turns over, borders move along themselves only, and the surface hangs together as it did.
    Where one of the longer faces would cut through another, a vertex that it was to do without
    stays, unless it can move once the others have.
    """
    left = np.ones(len(which), dtype=np.bool_)
    while which.any():
        mesh, stayed = _uncrossed(mesh, which)
        left[left] = stayed
        if stayed.all():
            break
        which = which[stayed]
    return mesh, left


def _uncrossed(mesh: Mesh, which: Bools) -> tuple[Mesh, Bools]:
    """The mesh without those vertices ``which`` (v,) that can all move at once without new faces
    that cut through others, and (v,) which are left."""
    while True:
        faces, kept = _without(mesh, which)
        done, other = submesh(replace(mesh, faces=faces), kept), faces != mesh.faces
        pairs = np.flatnonzero(kept)[crossings(done, other[kept].any(axis=1))]
        if not len(pairs):
            left = np.zeros(len(which), dtype=np.bool_)
            left[faces[kept]] = True
            return done, left
        # One of two is enough, and one of them is other than it was.
        first = np.where(other[pairs[:, 0]].any(axis=1), pairs[:, 0], pairs[:, 1])
        which = which.copy()
        which[mesh.faces[first][other[first]]] = False


def _without(mesh: Mesh, which: Bools) -> tuple[Ints, Bools]:
    """(f, 3) the mesh's faces without the vertices ``which`` (v,), as far as these can move into a
    neighbour, and (f,) which faces are left."""
    from turnscan.surface.decimation import _net_kernels as kernels

    net = _net(mesh, np.inf)
    net.ids[~which, kernels.LOCKED] = 1
    # Into one that stays, wherever that goes: one that many have moved into goes nowhere.
    net.at[which, kernels.OWN] = _LAST
    _collapse(net, 0, no_progress)
    return _faces(net)


def _faces(net: Any) -> tuple[Ints, Bools]:
    """(f, 3) the faces as they are now, and (f,) which of them are left."""
    kept = net.tri[:, 0] >= 0
    return np.where(kept[:, None], net.tri[:, :3], 0), kept


def _net(mesh: Mesh, tolerance: float) -> Any:
    """The mesh as the kernels take it, with samples only where there is a tolerance."""
    from turnscan.surface.decimation import _net_kernels as kernels

    twin = opposite_half_edges(mesh.faces)
    border = twin < 0
    chain = _chain(mesh, border)
    v, f = len(mesh.vertices), len(mesh.faces)
    middle = mesh.vertices.mean(axis=0)
    at, ids, tri = _aligned(v, 16), np.zeros((v, 8), np.int32), np.empty((f, 8), np.int32)
    at[:, kernels.PLACE : kernels.PLACE + 3] = mesh.vertices - middle
    ids[:, kernels.HEAD] = -1
    ids[:, kernels.AHEAD], ids[:, kernels.BACK] = chain
    ids[:, kernels.LOCKED] = _locked(mesh, twin)
    kernels.fill(at, ids, tri, mesh.faces, border)
    samples, follow = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
    head, after = follow, follow
    if np.isfinite(tolerance):
        samples, owners = _samples(mesh, twin)
        tri[:, kernels.SAMPLE], follow = kernels.lists(owners, f)
        head, after = kernels.lists(mesh.faces.ravel(), v)
    return kernels.Net(
        at, ids, tri, chain, samples - middle, follow, mesh.faces, head, after,
        (_HELD * tolerance) ** 2,
    )  # fmt: skip


def _aligned(rows: int, columns: int) -> Floats:
    """Zeros (rows, columns) that begin where a line of the processor's cache does."""
    room = np.zeros(rows * columns + 7)
    skip = -room.ctypes.data // 8 % 8
    return room[skip : skip + rows * columns].reshape(rows, columns)


def _collapse(net: Any, wanted: int, progress: Progress) -> None:
    """Move vertices until ``wanted`` faces are left or no move is allowed."""
    from turnscan.surface.decimation import _collapse_kernels as kernels
    from turnscan.surface.decimation._bucket_kernels import SIZE

    ends, state = kernels.queue(net)
    waiting, first = state[SIZE], len(net.tri)
    left, share = first, 0.0
    while state[SIZE] > 0 and left > wanted:
        # A vertex whose neighbour moved waits once more: the share may not go back for that.
        share = max(share, 1 - state[SIZE] / waiting, (first - left) / (first - wanted))
        progress(share)
        left = kernels.collapse(net, ends, state, left, wanted, _AT_A_TIME)


def decimation_findings(
    before: Mesh, after: Mesh, *, tolerance: float | None = None, faces: int | None = None
) -> list[Finding]:
    """How many faces are left, that ``faces`` were not reached, and that the ``tolerance`` (mm) is
    no small part of the whole; both as they were asked of `decimate`."""
    left = len(after.faces)
    text = f"{left} of {len(before.faces)} faces are left"
    out = [Finding("surface.decimated", "note", text)]
    if faces is not None and left > faces:
        text = f"{faces} faces cannot be reached: further decimation would break the surface"
        # Made for as many as can be, the surface keeps more of its form.
        remedy = Remedy("ask for as many as are left: ", Option("decimate", str(left)))
        out.append(Finding("surface.decimated", "warning", text, "", remedy))
    across = _across(before)
    if tolerance is not None and tolerance > _COARSE * across:
        text = (
            f"a tolerance of {tolerance:g} mm is more than a tenth of the part, which is "
            f"{across:.1f} mm across: much of its form is lost"
        )
        remedy = Remedy("give a smaller one, like ", Option("decimate", "0.05mm"))
        out.append(Finding("surface.decimated", "warning", text, "", remedy))
    return out


def _across(mesh: Mesh) -> float:
    """mm: the middle one of a part's three sides: of a plate its width, of a rod its thickness."""
    used = mesh.vertices[np.unique(mesh.faces)]
    return float(np.sort(np.ptp(used, axis=0))[1]) if len(used) else np.inf


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

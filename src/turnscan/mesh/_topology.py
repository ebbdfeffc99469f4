"""How the faces of a mesh hang together: sides and their other side, borders, fans."""

from __future__ import annotations

import weakref

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Ints, is_frozen
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import submesh

_last: tuple[weakref.ref[Ints], Ints] | None = None
"""The faces of a mesh that were asked about last, as long as there are any, and the answer."""


def opposite_half_edges(faces: Ints) -> Ints:
    """(3f,) for side 3f + i, from corner i of face f to the next: the side on its other side.

    −1 where there is none, or where that is not clear: more than two faces, or faces that do not
    wind alike. Read-only: of the faces of one mesh, which never change, the last answer is kept.
    """
    from turnscan.mesh import _topology_kernels as kernels

    global _last
    last = _last
    if last is not None and last[0]() is faces:
        return last[1]
    twin: Ints = kernels.opposite_half_edges(np.ascontiguousarray(faces, dtype=np.int32))
    twin.flags.writeable = False
    if is_frozen(faces):
        _last = weakref.ref(faces, _forget), twin
    return twin


def _forget(faces: weakref.ref[Ints]) -> None:
    global _last
    if _last is not None and _last[0] is faces:
        _last = None


def boundary_loops(mesh: Mesh) -> list[Ints]:
    """The borders of the mesh: closed loops of vertex numbers, each along its faces' own winding.

    Longest first. Where parts of the surface touch in a vertex, a border turns off along the part
    that it came by.
    """
    from turnscan.mesh import _topology_kernels as kernels

    flat, starts = kernels.borders(mesh.faces, opposite_half_edges(mesh.faces))
    loops = np.split(flat, starts[1:]) if len(starts) else []
    return sorted(loops, key=lambda k: (-len(k), int(k.min())))


def is_closed(mesh: Mesh) -> bool:
    """True where every side of every face has exactly one face on its other side."""
    return bool(len(mesh.faces) > 0 and (opposite_half_edges(mesh.faces) >= 0).all())


def cut_touching(mesh: Mesh) -> tuple[Mesh, list[Finding]]:
    """The mesh without faces that touch others in a vertex only, and a finding if there were any.

    Of the fans about a vertex the largest stays (the first of equal ones), again and again, until
    the faces about every vertex hang together by their sides. (Doubling such a vertex would not
    do: programs that join equal vertices of a file make one of it again.)
    """
    kept = hanging_together(mesh.faces)
    if kept.all():
        return mesh, []
    text = f"{int((~kept).sum())} faces that touched others only in a vertex were removed"
    return submesh(mesh, kept), [Finding("surface.touching", "note", text)]


def hanging_together(faces: Ints) -> Bools:
    """(f,) False for the faces that `cut_touching` takes away."""
    kept = np.ones(len(faces), dtype=np.bool_)
    near: npt.NDArray[np.intp] = np.arange(len(faces))
    asked = np.ones(int(faces.max()) + 1 if len(faces) else 0, dtype=np.bool_)
    while len(near):
        gone = near[_smaller_fans(faces[near], asked)]
        if not len(gone):
            break
        kept[gone] = False
        # Only about the vertices of what went can anything have changed.
        asked = np.zeros(len(asked), dtype=np.bool_)
        asked[faces[gone]] = True
        near = np.flatnonzero(kept & asked[faces].any(axis=1))
    return kept


def _smaller_fans(faces: Ints, asked: Bools) -> Bools:
    """(f,) True for faces of all fans but the largest (the first of equal ones) about a vertex.

    Of the vertices ``asked`` for.
    """
    fan, about = vertex_fans(faces)
    several = np.flatnonzero((np.bincount(about)[about] > 1) & asked[about])
    order = several[np.lexsort((several, -np.bincount(fan)[several], about[several]))]
    rest = order[1:][about[order[1:]] == about[order[:-1]]]
    smaller = np.zeros(len(about), dtype=np.bool_)
    smaller[rest] = True
    return np.asarray(smaller[fan].reshape(-1, 3).any(axis=1))


def vertex_fans(faces: Ints) -> tuple[Ints, Ints]:
    """(3f,) for every corner the number of its fan, and (fans,) the vertex each lies about.

    A fan is the faces round a vertex that hang together by their sides.
    """
    from turnscan.mesh import _topology_kernels as kernels

    fan, first = kernels.fans(opposite_half_edges(faces))
    return fan, faces.ravel()[first]


def faces_about(faces: Ints, count: int) -> tuple[npt.NDArray[np.int64], Ints]:
    """The faces (f, 3) about each of ``count`` vertices, as a compressed list.

    Returns (count + 1,) where those of each vertex begin, and (3 f,) their numbers.
    """
    from turnscan.mesh import _topology_kernels as kernels

    return kernels.faces_about(faces, count)


def half_edges(faces: Ints) -> tuple[Ints, Ints]:
    """Start and end of the sides that have one face only."""
    a, b = unpaired(faces)
    if not len(a):
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    size = int(max(a.max(), b.max())) + 1
    back = np.sort(b * size + a)
    lonely = back[np.minimum(np.searchsorted(back, a * size + b), len(back) - 1)] != a * size + b
    return a[lonely].astype(np.int32), b[lonely].astype(np.int32)


def unpaired(faces: Ints) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Start and end of the sides that are not one of exactly two that run opposite ways.

    Those that agree with one of them about their ends are among them too: the pairs are complete.
    """
    if not len(faces):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    side = np.flatnonzero(opposite_half_edges(faces) < 0)
    face, corner = np.divmod(side, 3)
    a, b = faces[face, corner], faces[face, (corner + 1) % 3]
    return a.astype(np.int64), b.astype(np.int64)

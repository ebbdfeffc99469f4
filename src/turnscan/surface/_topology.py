"""How the faces of a mesh hang together: sides and their other side, borders, fans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Ints
from turnscan.surface._mesh import Mesh, Provenance


def twins(faces: Ints) -> npt.NDArray[np.int64]:
    """(3f,) for side 3f + i, from corner i of face f to the next: the side on its other side.

    −1 where there is none, or where that is not clear: more than two faces, or faces that do not
    wind alike.
    """
    f = len(faces)
    if not f:
        return np.zeros(0, dtype=np.int64)
    a = faces.ravel().astype(np.int64)
    b = faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(a.max()) + 1
    there = a * size + b
    order = np.argsort(there, kind="stable")
    keys = there[order]
    once = np.ones(3 * f, dtype=np.bool_)
    same = keys[1:] == keys[:-1]
    once[1:] &= ~same
    once[:-1] &= ~same
    at = np.minimum(np.searchsorted(keys, b * size + a), 3 * f - 1)
    clear = np.empty(3 * f, dtype=np.bool_)
    clear[order] = once
    found = (keys[at] == b * size + a) & once[at] & clear
    return np.where(found, order[at], -1)


def boundary_loops(mesh: Mesh) -> list[Ints]:
    """The borders of the mesh: closed loops of vertex numbers, each along its faces' own winding.

    Longest first. Where parts of the surface touch in a vertex, a border turns off along the part
    that it came by.
    """
    from turnscan.surface import _topology_kernels as kernels

    flat, starts = kernels.borders(mesh.faces, twins(mesh.faces))
    loops = np.split(flat, starts[1:]) if len(starts) else []
    return sorted(loops, key=lambda k: (-len(k), int(k.min())))


def is_closed(mesh: Mesh) -> bool:
    """True where every side of every face has exactly one face on its other side."""
    return bool(len(mesh.faces) > 0 and (twins(mesh.faces) >= 0).all())


def split_touching(mesh: Mesh) -> Mesh:
    """The mesh with every vertex doubled in which two parts of the surface merely touch."""
    if not len(mesh.faces):
        return mesh
    fan, old = _fans(mesh.faces)
    if len(old) == len(mesh.vertices):
        return mesh
    # The first fan of each vertex keeps its place; the others are added at the end.
    rank = np.argsort(old, kind="stable")
    leads = np.ones(len(rank), dtype=np.bool_)
    leads[1:] = old[rank][1:] != old[rank][:-1]
    sequence = np.concatenate([rank[leads], rank[~leads]])
    new = np.empty(len(old), dtype=np.int32)
    new[sequence] = np.arange(len(old), dtype=np.int32)
    return _taken(mesh, old[sequence], new[fan].reshape(-1, 3))


def _fans(faces: Ints) -> tuple[Ints, Ints]:
    """(3f,) for every corner the number of its fan, and (fans,) the vertex each lies about.

    A fan is the faces round a vertex that hang together by their sides.
    """
    from turnscan.surface import _topology_kernels as kernels

    fan, first = kernels.fans(twins(faces))
    return fan, faces.ravel()[first]


def _taken(mesh: Mesh, index: Ints, faces: Ints) -> Mesh:
    p = mesh.provenance
    return replace(
        mesh,
        vertices=mesh.vertices[index],
        faces=faces,
        provenance=None
        if p is None
        else Provenance(p.sigma[index], p.laser[index], p.step[index], p.line[index], p.lasers),
        colour=None if mesh.colour is None else mesh.colour[index],
    )

"""Meshes put together and taken apart; each vertex and face keeps what is known of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh, Provenance


def submesh(mesh: Mesh, keep: Bools) -> Mesh:
    """The mesh of the faces where ``keep`` (f,) is True, without unused vertices."""
    faces = mesh.faces[keep]
    used = np.zeros(len(mesh.vertices), dtype=np.bool_)
    used[faces] = True
    new = np.cumsum(used) - 1
    p = mesh.provenance
    return Mesh(
        mesh.vertices[used],
        new[faces].astype(np.int32).reshape(-1, 3),
        None
        if p is None
        else Provenance(p.sigma[used], p.laser[used], p.step[used], p.line[used], p.lasers),
        None if mesh.colour is None else mesh.colour[used],
        None if mesh.measured is None else mesh.measured[keep],
    )


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one, side by side; the provenance of each vertex stays with it."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    some = any(m.measured is not None for m in meshes)
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + k for m, k in zip(meshes, starts, strict=False)]),
        joined_provenance(meshes),
        np.concatenate([m.colour for m in meshes if m.colour is not None])
        if all(m.colour is not None for m in meshes)
        else None,
        np.concatenate([measured(m) for m in meshes]) if some else None,
    )


def joined_provenance(meshes: Sequence[Mesh]) -> Provenance | None:
    """Provenance of the vertices of several meshes in a row; None where one has none."""
    known = [m.provenance for m in meshes if m.provenance is not None]
    if len(known) < len(meshes):
        return None
    lasers = tuple(dict.fromkeys(n for p in known for n in p.lasers))
    index = []
    for p in known:
        table = np.array([*(lasers.index(n) for n in p.lasers), -1], dtype=np.int32)
        index.append(table[p.laser])
    return Provenance(
        np.concatenate([p.sigma for p in known]),
        np.concatenate(index),
        np.concatenate([p.step for p in known]),
        np.concatenate([p.line for p in known]),
        lasers,
    )


def components(mesh: Mesh) -> Ints:
    """(f,) the number of the connected piece that each face belongs to, from 0."""
    from turnscan.mesh import _topology_kernels as kernels

    number: Ints = kernels.pieces(mesh.faces)
    return number


def measured(mesh: Mesh) -> Bools:
    """(f,) True for the faces that were measured."""
    return np.ones(len(mesh.faces), bool) if mesh.measured is None else mesh.measured


def measured_vertices(mesh: Mesh) -> Bools:
    """(v,) True for the vertices that were measured: part of a measured face, and not added.

    Files without provenance mark faces alone. There the platter's plane under a part that was
    closed, whose faces count as measured, is recognised as what lies exactly level below all else.
    """
    own = np.zeros(len(mesh.vertices), dtype=np.bool_)
    if not len(mesh.faces):
        own[:] = True  # points alone
    real = measured(mesh)
    if mesh.provenance is None and not real.all():
        real = real & ~(mesh.triangles[..., 2] == mesh.vertices[:, 2].min()).all(axis=1)
    own[mesh.faces[real]] = True
    return own if mesh.provenance is None else own & (mesh.provenance.laser >= 0)


def longest_sides(mesh: Mesh) -> Floats:
    """(v,) mm: the longest side at each vertex."""
    from turnscan.mesh import _normal_kernels as kernels

    return kernels.longest_sides(mesh.vertices, mesh.faces)

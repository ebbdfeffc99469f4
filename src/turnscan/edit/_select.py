"""Selections: which faces of a mesh, from those that are chosen or from what is known of them.

A selection is a mask (f,) of faces. What grows or spreads needs `beside`, which is made once for a
mesh. Faces that do not count, such as dead ones, are beside nothing and are never reached.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from turnscan.arrays import Bools, Ints
from turnscan.mesh import Mesh, components, opposite_half_edges, submesh
from turnscan.points import RangeGrid
from turnscan.surface.holes import Cause, Hole


def beside(mesh: Mesh, alive: Bools | None = None) -> Ints:
    """(f, 3) the face across each side, −1 where there is none; only faces ``alive`` (f,) count."""
    if alive is None:
        alive = np.ones(len(mesh.faces), dtype=np.bool_)
    number = np.flatnonzero(alive)
    across = opposite_half_edges(mesh.faces[alive]).reshape(-1, 3)
    out = np.full((len(mesh.faces), 3), -1, dtype=np.int32)
    out[alive] = np.where(across >= 0, number[across // 3], -1)
    return out


def grow(chosen: Bools, near: Ints, rounds: int = 1) -> Bools:
    """The chosen faces and those across their sides, so many times; ``near`` is `beside`."""
    out = chosen.copy()
    for _ in range(rounds):
        around = near[out]
        out[around[around >= 0]] = True
    return out


def shrink(chosen: Bools, near: Ints, rounds: int = 1) -> Bools:
    """The chosen faces without those that have another one across a side, so many times.

    The border of the mesh takes nothing away.
    """
    out = chosen.copy()
    for _ in range(rounds):
        out &= ~((near >= 0) & ~out[near]).any(axis=1)
    return out


def connected(chosen: Bools, near: Ints) -> Bools:
    """Every piece of the mesh that has a chosen face; ``near`` is `beside`."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    f = len(chosen)
    face, side = np.nonzero(near >= 0)
    graph = coo_array((np.ones(len(face), np.int8), (face, near[face, side])), shape=(f, f))
    _, piece = connected_components(graph, directed=False)
    wanted = np.zeros(f, dtype=np.bool_)
    wanted[piece[chosen]] = True
    return np.asarray(wanted[piece])


def within_angle(chosen: Bools, near: Ints, mesh: Mesh, angle: float) -> Bools:
    """What is reached from the chosen faces without crossing an edge sharper than ``angle``, rad.

    ``near`` is `beside`. On a noisy surface the faces themselves turn; smooth it first, or give
    more than its roughness.
    """
    from turnscan.edit import _select_kernels as kernels

    t = mesh.triangles
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    with np.errstate(invalid="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    reached: Bools = kernels.flood(chosen, near, normal, float(np.cos(angle)))
    return reached


def by_laser(mesh: Mesh, laser: str) -> Bools:
    """Faces whose corners were all measured by one laser. False for a mesh without provenance."""
    p = mesh.provenance
    if p is None or laser not in p.lasers:
        return np.zeros(len(mesh.faces), dtype=np.bool_)
    return _all_corners(mesh, p.laser == p.lasers.index(laser))


def by_steps(mesh: Mesh, first: int, last: int) -> Bools:
    """Faces whose corners were all measured at steps ``first`` to ``last``, both included.

    A ``first`` behind ``last`` goes over the seam of the turn.
    """
    p = mesh.provenance
    if p is None:
        return np.zeros(len(mesh.faces), dtype=np.bool_)
    inside = (p.step >= first) & (p.step <= last)
    if first > last:
        inside = (p.step >= first) | (p.step <= last)
    return _all_corners(mesh, inside & (p.step >= 0))


def by_sigma(mesh: Mesh, above: float) -> Bools:
    """Faces with a corner whose standard uncertainty is more than ``above`` mm."""
    p = mesh.provenance
    if p is None:
        return np.zeros(len(mesh.faces), dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        return np.asarray((p.sigma > above)[mesh.faces].any(axis=1))


def by_quality(mesh: Mesh, grids: Iterable[RangeGrid], flags: int) -> Bools:
    """Faces with a corner whose point has any of these bits of `turnscan.stripes.StripeFlag`.

    ``grids`` are those that the mesh was made of; of several of one laser the last one counts.
    """
    p = mesh.provenance
    flagged = np.zeros(len(mesh.vertices), dtype=np.bool_)
    for grid in grids if p is not None else ():
        if p is None or grid.laser not in p.lasers:
            continue
        row = np.full(int(max(p.step.max(initial=0), grid.steps.max(initial=0))) + 1, -1)
        row[grid.steps] = np.arange(len(grid.steps))
        mine = (p.laser == p.lasers.index(grid.laser)) & (p.step >= 0)
        mine &= (row[p.step] >= 0) & (p.line < grid.flags.shape[1])
        flagged[mine] = (grid.flags[row[p.step[mine]], p.line[mine]] & flags) != 0
    return np.asarray(flagged[mesh.faces].any(axis=1))


def by_cause(mesh: Mesh, borders: Iterable[Hole], causes: Collection[Cause]) -> Bools:
    """Faces along the borders of holes that have one of these causes, first or second."""
    on = np.zeros(len(mesh.vertices), dtype=np.bool_)
    for hole in borders:
        if hole.cause in causes or hole.also in causes:
            on[hole.loop] = True
    return np.asarray(on[mesh.faces].any(axis=1))


def by_size(mesh: Mesh, fewer: int, alive: Bools | None = None) -> Bools:
    """Faces of loose pieces that have fewer faces than that."""
    living = np.ones(len(mesh.faces), dtype=np.bool_) if alive is None else alive
    out = np.zeros(len(mesh.faces), dtype=np.bool_)
    piece = components(submesh(mesh, living))
    out[living] = np.bincount(piece)[piece] < fewer if len(piece) else False
    return out


def _all_corners(mesh: Mesh, vertices: Bools) -> Bools:
    return np.asarray(vertices[mesh.faces].all(axis=1))

"""Smooth a mesh under a brush, and find its spikes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.mesh._topology import half_edges
from turnscan.progress import Progress, no_progress

_GIVE, _TAKE = 0.5, -0.53
"""Parts of the way to the neighbours' middle: there, and a little more back (Taubin 1995)."""


def smooth(
    mesh: Mesh, where: npt.ArrayLike, rounds: int = 5, progress: Progress = no_progress
) -> Mesh:
    """The mesh smoothed where ``where`` (v,), 0 to 1, says, and as much as it says.

    Vertices move along their normals towards the middle of their neighbours and a little less
    back (Taubin 1995), so that bumps go and the whole does not shrink. Where ``where`` is 0, and on
    borders, nothing moves. This is a person's doing: it does not ask for sigma, as denoising does.
    ``progress`` hears of each round.

    Raises InputError for weights that do not fit or lie outside 0 to 1, or rounds below 1.
    """
    from turnscan.surface.clean import _smooth_kernels as kernels

    weight = np.array(where, dtype=np.float64)
    if weight.shape != (len(mesh.vertices),) or not ((weight >= 0) & (weight <= 1)).all():
        raise InputError(
            f"smooth: {weight.size} weights for {len(mesh.vertices)} vertices",
            hint="give one from 0 to 1 for each",
        )
    if rounds < 1:
        raise InputError(f"smooth: {rounds} rounds", hint="give 1 or more")
    weight[_edge(mesh)] = 0.0
    points = mesh.vertices.copy()
    for done in range(rounds):
        progress(done / rounds)
        for part in (_GIVE, _TAKE):
            moved = Mesh(points, mesh.faces)
            off = np.nan_to_num(kernels.off_ring(points, mesh.faces))
            normal = np.nan_to_num(vertex_normals(moved))
            points = points - (part * weight * off)[:, None] * normal
    return replace(mesh, vertices=points)


def spikes(mesh: Mesh, beyond: float = 6.0) -> Bools:
    """(v,) True for single vertices that stick out of the surface, or into it.

    They lie more than ``beyond`` times the usual roughness off the middle of their neighbours, and
    more than twice as far as any of these does: so edges and corners are none. Border vertices
    are not judged. Raises InputError where ``beyond`` is not positive.
    """
    from turnscan.surface.clean import _smooth_kernels as kernels

    if not (beyond > 0 and np.isfinite(beyond)):
        raise InputError(f"spikes beyond {beyond} times the roughness", hint="give 6, for example")
    off = np.nan_to_num(kernels.off_ring(mesh.vertices, mesh.faces))
    inside = np.ones(len(off), dtype=np.bool_)
    inside[_edge(mesh)] = False
    if not inside.any():
        return np.zeros(len(off), dtype=np.bool_)
    usual = 1.4826 * float(np.median(np.abs(off[inside])))
    beside: Floats = kernels.largest_beside(off, mesh.faces)
    return np.asarray(inside & (np.abs(off) > beyond * usual) & (np.abs(off) > 2 * beside))


def _edge(mesh: Mesh) -> npt.NDArray[np.int32]:
    start, end = half_edges(mesh.faces)
    return np.concatenate([start, end])

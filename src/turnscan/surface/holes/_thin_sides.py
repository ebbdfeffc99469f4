"""Sides of a part that are thinner than samples are apart: between a border and another beyond it.

A plate of few millimetres ends between two profiles. Its front and its back were measured, and the
surface is torn between their last samples; what is missing there is no guess, as both its ends are
known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._normals import vertex_normals
from turnscan.surface.holes._holes import Hole

_SAMPLES = 2.0
"""Usual distances of samples that a side spans at most: one that it lies between, and one that the
clean-up takes."""
_LEAST, _MOST = np.deg2rad(30.0), np.deg2rad(150.0)
"""How far a side turns off from the surface at its border."""
_ASLANT = 0.7
"""Of its length: how far it may lead along the border."""
_OTHER = 0.5
"""Cosine between normals of one face and the next beyond which they are one."""
_NEAREST = 60
"""Border vertices that are looked at from each corner."""


def opposite(
    mesh: Mesh, found: Sequence[Hole], apart: Floats, X: Floats, n: Floats, outward: Floats
) -> Ints:
    """(m,) the nearest border vertex beyond the side at which the surface ends at border places
    X (m, 3), −1 for none.

    ``n`` (m, 3) are the normals there and ``outward`` (m, 3) the ways along the surface and off it;
    ``apart`` (m,) mm is what samples are from each other there. What lies beyond looks another way.
    """
    from scipy.spatial import cKDTree

    border = np.unique(np.concatenate([h.loop for h in found]))
    normal = np.nan_to_num(vertex_normals(mesh))[border]
    count = min(_NEAREST, len(border))
    away, near = cKDTree(mesh.vertices[border]).query(X, count)
    away, near = (np.reshape(k, (len(X), count)) for k in (away, near))
    there = (away > 1e-9) & (away < _SAMPLES * apart[:, None])
    way = mesh.vertices[border[near]] - X[:, None]
    out, down = (np.einsum("mki,mi->mk", way, v) for v in (outward, -n))
    turn, size = np.arctan2(down, out), np.hypot(out, down)
    along = np.sqrt(np.maximum(np.einsum("mki,mki->mk", way, way) - size**2, 0.0))
    alike = np.einsum("mki,mi->mk", normal[near], n)
    there &= (alike < _OTHER) & (turn > _LEAST) & (turn < _MOST) & (along < _ASLANT * size)
    # Some of a side may have been measured; what is known best is how far the part's other face is.
    back = there & (alike < -_OTHER)
    there = np.where(back.any(axis=1, keepdims=True), back, there)
    first = np.argmax(there, axis=1)  # they come by distance
    at = np.arange(len(X))
    return np.where(there[at, first], border[near[at, first]], -1).astype(np.int32)

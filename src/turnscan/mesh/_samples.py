"""Points spread evenly over a mesh."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.errors import InputError
from turnscan.mesh._mesh import Mesh

_PLASTIC = 1.3247179572447460
"""Root of x³ = x + 1: its powers give the plane's sequence of low discrepancy (Roberts, 2018)."""


def sample_surface(mesh: Mesh, count: int) -> tuple[Floats, Ints]:
    """``count`` points (count, 3) mm spread evenly over the area of a mesh, always the same ones,
    and the faces (count,) on which they lie.

    Faces are taken in equal steps of cumulated area and the place within a face from the plastic-
    number sequence, so that neighbouring samples do not clump as random ones would. Raises
    InputError for a mesh without area.
    """
    t = mesh.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    if not area.sum() > 0:
        raise InputError("the mesh has no area to sample", hint="give a mesh with faces")
    ends = np.cumsum(area)
    at = (np.arange(count) + 0.5) / count * ends[-1]
    face = np.minimum(np.searchsorted(ends, at), len(t) - 1)
    order = np.arange(1, count + 1)
    r1, r2 = (order / _PLASTIC) % 1.0, (order / _PLASTIC**2) % 1.0
    root = np.sqrt(r1)
    weights = np.stack([1.0 - root, root * (1.0 - r2), root * r2], axis=-1)
    points: Floats = np.einsum("ni,nij->nj", weights, t[face])
    return points, face.astype(np.int32)

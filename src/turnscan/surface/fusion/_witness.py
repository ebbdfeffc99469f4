"""Witness: what a merge made is checked against the surfaces that were measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools
from turnscan.mesh._mesh import Mesh
from turnscan.surface.fusion._range_surface import RangeSurface

_SIGMAS = 3.0
"""Combined sigma that a merged vertex may lie off a surface that confirms it."""
_ROUNDED = 0.1
"""Voxels by which a merge rounds its vertices, and carries them on over a border."""


def borne_out(mesh: Mesh, surfaces: Sequence[RangeSurface], voxel: float) -> Bools:
    """(v,) True for the vertices of a merged mesh that a measured surface passes by.

    It does no further off than three combined sigma, what the surface may do between its profiles
    there, and a tenth of ``voxel`` mm, what the merge itself rounds off.
    """
    import igl

    p = mesh.provenance
    own = np.zeros(len(mesh.vertices)) if p is None else np.nan_to_num(p.sigma)
    out = np.zeros(len(mesh.vertices), dtype=np.bool_)
    for s in surfaces:
        asked = np.flatnonzero(~out)
        if not len(asked) or not len(s.mesh.faces):
            continue
        squared, face, _ = igl.point_mesh_squared_distance(
            np.array(mesh.vertices[asked]), np.array(s.mesh.vertices), s.mesh.faces.astype(np.int64)
        )
        corners = s.mesh.faces[face]
        noise = np.hypot(own[asked], s.sigma[corners].mean(axis=1))
        most = _SIGMAS * noise + s.between()[corners].max(axis=1) + _ROUNDED * voxel
        out[asked[squared <= most**2]] = True
    return out

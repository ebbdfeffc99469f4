"""Witness: what a merge made is checked against the surfaces that were measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh._mesh import Mesh
from turnscan.surface.fusion._range_surface import RangeSurface

_SIGMAS = 3.0
"""Combined sigma that a merged vertex may lie off a surface that confirms it."""
_ROUNDED = 0.1
"""Voxels by which a merge rounds its vertices, and carries them on over a border."""


def borne_out(
    mesh: Mesh, surfaces: Sequence[RangeSurface], voxel: float, most: float
) -> tuple[Bools, Floats]:
    """(v,) True for the vertices of a merged mesh that a measured surface passes by, and (v,) mm
    the sigma that they have by that: no less than how far from the nearest such one they lie
    beyond what is explained, and with how far the merge itself put them beside all of them.

    It passes by no further off than three combined sigma, ``most`` mm of them at most, and what is
    explained: what the surface may do between its profiles there, and a tenth of ``voxel`` mm,
    which the merge itself rounds off.
    """
    import igl

    p = mesh.provenance
    own = np.zeros(len(mesh.vertices)) if p is None else np.nan_to_num(p.sigma)
    out = np.zeros(len(mesh.vertices), dtype=np.bool_)
    away, least = np.full((2, len(mesh.vertices)), np.inf)
    for s in surfaces:
        # What one surface confirms only from afar, another may confirm from nearby.
        asked = np.flatnonzero(~out | (away > own) | (least > own))
        if not len(asked) or not len(s.mesh.faces):
            continue
        squared, face, _ = igl.point_mesh_squared_distance(
            np.array(mesh.vertices[asked]), np.array(s.mesh.vertices), s.mesh.faces.astype(np.int64)
        )
        corners = s.mesh.faces[face]
        noise = np.hypot(own[asked], s.sigma[corners].mean(axis=1))
        explained = s.between()[corners].max(axis=1) + _ROUNDED * voxel
        off = np.sqrt(squared)
        near = off <= np.minimum(_SIGMAS * noise, most) + explained
        out[asked[near]] = True
        beyond = np.maximum(off - explained, 0.0)[near]
        away[asked[near]] = np.minimum(away[asked[near]], beyond)
        least[asked] = np.minimum(least[asked], off)
    # The mean of several lies its sigma beside each of them.
    beside = np.sqrt(np.maximum(least**2 - own**2, 0.0))
    return out, np.maximum(np.hypot(own, beside), away)

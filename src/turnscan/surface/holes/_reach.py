"""Which places a laser and its camera reached at one moment, past what was measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._rays import Caster
from turnscan.points import working_volume
from turnscan.rig import Pose
from turnscan.surface.holes._visibility import ScanCoverage, crossings

_SURE = float(np.cos(np.deg2rad(70.0)))
"""Cosine off face-on from which a surface surely shows: from 10° before `GRAZING` on, whether it
does hangs on the tilt of its faces and on how bright it is."""


def reached(
    mesh: Mesh, at: Floats, normals: Floats, scans: Sequence[tuple[ScanCoverage, Pose | None]]
) -> Bools:
    """(m,) True for places (m, 3) mm that would have been measured, were they a surface.

    At some moment the light fell on the place and the camera saw it, both less flatly than
    `_SURE` on a surface of normals (m, 3), in the picture and in the volume that the rig can
    measure, and nothing of ``mesh``, what was measured, stood between. Each scan comes with where
    it lies in the frame of the mesh; None where the two are one.
    """
    out = np.zeros(len(at), dtype=np.bool_)
    caster = Caster(mesh.vertices, mesh.faces)
    for scan, pose in scans:
        own = at if pose is None else pose.inverse().apply(at)
        c = crossings(scan, own)
        ends = [c.eye, c.source] if pose is None else [pose.apply(c.eye), pose.apply(c.source)]
        ok = c.inside & working_volume(scan.rig, scan.grid.laser).contains(own)[c.place]
        for end in ends:
            way = end - at[c.place]
            steep = np.einsum("ij,ij->i", way, normals[c.place])
            ok &= steep > _SURE * np.linalg.norm(way, axis=1)
        for end in ends:
            some = np.flatnonzero(ok)
            ok[some] = caster.visible(at[c.place[some]], normals[c.place[some]], end[some])
        out[c.place[ok]] = True
    return out

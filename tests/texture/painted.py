"""Texture pictures of a scan that exists, drawn by casting rays onto its surface."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Caster, Mesh
from turnscan.rig import Pose, rotation_z
from turnscan.scan import Scan, rig_for

GROUND = 6


def paint(
    path: Path, surface: Mesh, tone: Callable[[Floats], Floats], every: int = 6, gain: float = 1.0
) -> None:
    """Add a grey picture every so many steps: ``tone`` (n, 3) mm → (n,) grey levels, times gain."""
    cast = Caster(surface.vertices, surface.faces)
    with Scan.resume(path) as scan:
        rig = rig_for(scan)
        h, w = rig.camera.height, rig.camera.width
        pixels = np.stack(np.meshgrid(np.arange(w), np.arange(h)), axis=-1).reshape(-1, 2)
        rays = rig.camera.rays(pixels)
        for step, angle in list(zip(scan.steps(), scan.angles(), strict=True))[::every]:
            back = (rig.T_camera_table @ Pose(rotation_z(angle), np.zeros(3))).inverse()
            eye, way = back.translation, back.turn(rays)
            face = cast.first_hits(eye, way)
            hit = face >= 0
            t = surface.triangles[face[hit]]
            normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
            far = ((t[:, 0] - eye) * normal).sum(1) / (way[hit] * normal).sum(1)
            picture = np.full(w * h, float(GROUND))
            picture[hit] = gain * tone(eye + far[:, None] * way[hit])
            grey = np.clip(np.rint(picture), 0, 255).astype(np.uint8).reshape(h, w)
            scan.add_texture(step, grey, commanded=float(angle))

"""A bar that leans: one border about the face on which it stands and a flank in the shadow."""

from __future__ import annotations

import numpy as np

from tests.analytic import full_turn, make_rig, scan_shape
from turnscan import points
from turnscan.mesh import Mesh, cut_touching
from turnscan.points import Volume
from turnscan.surface import mesh_grid
from turnscan.surface.clean import drop_islands
from turnscan.surface.holes import ScanCoverage

STEPS = 60


def leaning_bar() -> tuple[Mesh, ScanCoverage]:
    """The surface of a bar that leans, under it the face that it stands on and its flank that
    looks down."""
    rig = make_rig(elevation=0.3, lift=20.0, lasers=(-0.4, 0.4))
    turn, low = full_turn(STEPS), Volume(z_min=3.0)
    stripes = scan_shape(rig, _leaning_bar, turn)
    grid = points.clip(points.build_grid(rig, "L0", stripes, np.arange(STEPS), turn), low)
    mesh = drop_islands(cut_touching(mesh_grid(grid))[0])[0]
    return mesh, ScanCoverage(rig, grid, low)


def _leaning_bar(p: np.ndarray) -> np.ndarray:
    x, y, z = (p[..., k] for k in range(3))
    across = (np.abs(x - 1.2 * (z - 15.0)) - 12.0) / np.hypot(1.0, 1.2)
    return np.maximum(np.maximum(across, np.abs(y) - 20.0), np.abs(z - 15.0) - 15.0)

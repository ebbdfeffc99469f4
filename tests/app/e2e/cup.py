"""A scan of a cup with a hole, a spike and a ghost, for the tests of the browser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.analytic import full_turn, make_rig, scan_shape
from turnscan.arrays import Floats
from turnscan.rig import Rig
from turnscan.scan import Frame, Scan, ScanPlan

STEPS = 72
HOLE_STEPS, HOLE_LINES = range(10, 17), slice(100, 126)
"""Where the cup is black, and gives no stripe."""
SPIKE_STEP, SPIKE_LINE = 40, 100
"""Where the stripe bulges outwards by up to 9 px, as no cup does."""
GHOST_STEPS, GHOST_LINES = range(54, 60), slice(116, 140)
GHOST_PX = 12.0
"""Where a mirrored stripe is brighter than the true one."""


def cup(P: Floats) -> Floats:
    """A cone, 36 mm wide at the foot, 56 at the top, 45 high."""
    r = np.hypot(P[..., 0], P[..., 1]) - (18.0 + 10.0 * P[..., 2] / 45.0)
    return np.maximum(r, np.maximum(-P[..., 2], P[..., 2] - 45.0))


def write_cup(path: Path, seed: int = 0) -> Path:
    """The scan file; the same seed gives the same noise."""
    v = np.arange(240)
    angles = full_turn(STEPS)

    def light_of(k: int, at: Floats) -> Floats:
        bulge = np.exp(-0.5 * (((k - SPIKE_STEP) / 1.6) ** 2 + ((v - SPIKE_LINE) / 4.0) ** 2))
        light = _line(at + 9.0 * bulge, 320, 150.0)
        if k in GHOST_STEPS:
            light[GHOST_LINES] = _line(at[GHOST_LINES], 320, 90.0)
            light[GHOST_LINES] += _line(at[GHOST_LINES] + GHOST_PX, 320, 160.0)
        if k in HOLE_STEPS:
            light[HOLE_LINES] = 0.0
        return light

    return _write(path, make_rig(elevation=0.35, lift=20.0), angles, light_of, seed)


def write_whole_cup(path: Path, steps: int, scale: int) -> Path:
    """The same cup without defects, in pictures of 320 × 240 times ``scale``."""
    size = (320 * scale, 240 * scale)
    rig = make_rig(elevation=0.35, lift=20.0, size=size, focal=800.0 * scale)
    return _write(path, rig, full_turn(steps), lambda _, at: _line(at, size[0], 150.0), 0)


def _write(
    path: Path, rig: Rig, angles: Floats, light_of: Callable[[int, Floats], Floats], seed: int
) -> Path:
    width, height = rig.camera.width, rig.camera.height
    plan = ScanPlan(width, height, "uint8", 1, ("L0",), len(angles), 12.0)
    rng = np.random.default_rng(seed)
    # The cup is round: every step shows the same stripe.
    (stripe,) = scan_shape(rig, cup, angles[:1])
    at = np.nan_to_num(stripe.position, nan=-1e3)
    with Scan.create(path, plan, rig) as scan:
        for k, angle in enumerate(angles):
            light = light_of(k, at)
            lit = light + rng.normal(12, 1.2, light.shape)
            as_u8 = np.clip(np.rint(lit), 0, 255).astype(np.uint8)
            scan.add(Frame(k, "L0", as_u8, commanded=float(angle)))
    return path


def _line(at: Floats, width: int, peak: float) -> Floats:
    return peak * np.exp(-0.5 * ((np.arange(width) - at[:, None]) / 1.5) ** 2)

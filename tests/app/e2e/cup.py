"""A scan of a cup with a hole, a spike and a ghost, for the tests of the browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.analytic import full_turn, make_rig, scan_shape
from turnscan.arrays import Floats
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
    rig = make_rig(elevation=0.35, lift=20.0)
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), STEPS, 12.0)
    rng = np.random.default_rng(seed)
    u, v = np.arange(320), np.arange(240)
    angles = full_turn(STEPS)
    with Scan.create(path, plan, rig) as scan:
        for k, stripe in enumerate(scan_shape(rig, cup, angles)):
            at = np.nan_to_num(stripe.position, nan=-1e3)
            bulge = np.exp(-0.5 * (((k - SPIKE_STEP) / 1.6) ** 2 + ((v - SPIKE_LINE) / 4.0) ** 2))
            at += 9.0 * bulge
            light = _line(u, at, 150.0)
            if k in GHOST_STEPS:
                light[GHOST_LINES] = _line(u, at[GHOST_LINES], 90.0)
                light[GHOST_LINES] += _line(u, at[GHOST_LINES] + GHOST_PX, 160.0)
            if k in HOLE_STEPS:
                light[HOLE_LINES] = 0.0
            lit = light + rng.normal(12, 1.2, light.shape)
            dark = rng.normal(12, 1.2, light.shape)
            as_u8 = [np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (lit, dark)]
            scan.add(Frame(k, "L0", *as_u8, commanded=float(angles[k])))
    return path


def _line(u: Floats, at: Floats, peak: float) -> Floats:
    return peak * np.exp(-0.5 * ((u - at[:, None]) / 1.5) ** 2)

"""Scans of a body by two lasers, with noise."""

from __future__ import annotations

import numpy as np

from tests.analytic import full_turn, make_rig, scan_shape, with_noise
from turnscan.points import Volume, build_grid, clip
from turnscan.surface.clean import clean

NOISE = 0.05
"""px."""
CENTRE = np.array([3.0, 2.0, 28.0])
"""mm: middle of the ball that is scanned."""


def bracket(P):
    """A foot of 50 × 30 × 12 and a wall of 50 × 10 × 48 on it."""

    def box(low, high):
        return np.max(np.maximum(np.asarray(low) - P, P - np.asarray(high)), axis=-1)

    return np.minimum(box((-25, -15, 0), (25, 15, 12)), box((-25, -15, 12), (25, -5, 60)))


def scanned(shape, steps, top=60.0):
    rig = make_rig(lasers=(0.4, -0.4), lift=28.0, elevation=0.3)
    angles = full_turn(steps)
    out = []
    for k in range(2):
        stripes = with_noise(scan_shape(rig, shape, angles, f"L{k}"), NOISE, k)
        grid = clip(build_grid(rig, f"L{k}", stripes, range(steps), angles), Volume(60, 2, top))
        out.append(clean(grid)[0])
    return out

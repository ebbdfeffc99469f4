"""A wall before the camera, made of numbers."""

from __future__ import annotations

import numpy as np

from turnscan.points._lit_points import LitPoints

S, N, STEP, THICK = 14, 12, 8.0, 0.4
DUE = THICK / (0.2 * np.cos(0.4))


def notched(width: float, light: float, *, deep: float = 6.0, step: float = STEP) -> LitPoints:
    """A wall before the camera in steps of so many mm; profile 7 lies deeper, at the bottom of a
    groove, in a stripe of this share of its width and light."""
    x = step * (np.arange(S) - S / 2)[:, None] + np.zeros((S, N))
    y = 40.0 + deep * (np.arange(S) == 7)[:, None] + np.zeros((S, N))
    points = np.stack([x, y, 0.3 * np.arange(N) + np.zeros((S, N))], -1)
    wide, bright = np.full((S, N), DUE), np.full((S, N), 100.0)
    wide[7] *= width
    bright[7] *= light / width
    return LitPoints(
        points,
        np.stack([x[:, 0], np.full(S, -500.0), np.full(S, 1.5)], -1),
        np.tile([0.2, 0.0, 0.0], (S, N, 1)),
        np.tile([np.cos(0.4), np.sin(0.4), 0.0], (S, N, 1)),
        wide,
        bright,
        step / 40.0 * np.arange(S),
        False,
        0.05,
        THICK,
    )

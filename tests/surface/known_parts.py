"""Parts whose every point is known, scanned exactly but for noise, in coarse steps."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from tests.analytic import box, cylinder, full_turn, make_rig, scan_shape, union, with_noise
from turnscan.points import RangeGrid, Volume, build_grid, clip
from turnscan.surface.clean import clean

NOISE = 0.05
"""px."""


def post(x, y, radius, low, high):
    """An upright cylinder beside the axis."""
    whole = cylinder(radius, low, high)
    return lambda P: whole(P - np.array([x, y, 0.0]))


PARTS = {
    # A wall, a gap of 6 mm, and a handle thinner than two steps.
    "handle": union(
        cylinder(18.0, 0.0, 58.0),
        post(28.0, 0.0, 4.0, 12.0, 46.0),
        box((7.0, 3.0, 2.5), (23.0, 0.0, 13.0), 0.0),
        box((7.0, 3.0, 2.5), (23.0, 0.0, 45.0), 0.0),
    ),
    # Seen from both sides.
    "thin wall": box((20.0, 1.0, 26.0), (0.0, 0.0, 27.0), 0.3),
    # Steps of 1.5 mm all round, between two lines each.
    "collars": union(
        cylinder(18.0, 0.0, 58.0), *(cylinder(19.5, z, z + 6.3) for z in (10.0, 22.4, 34.7, 47.1))
    ),
    # Its tip lies between two profiles.
    "ridge": union(cylinder(18.0, 0.0, 58.0), box((5.0, 5.0, 20.0), (17.0, 0.0, 28.0), 0.8)),
}


@cache
def scan(part: str, steps: int, k: int) -> RangeGrid:
    rig = make_rig(lasers=(0.4, -0.4), lift=28.0, elevation=0.2)
    angles = full_turn(steps)
    stripes = with_noise(scan_shape(rig, PARTS[part], angles, f"L{k}"), NOISE, k)
    # Made without light: their width says nothing.
    stripes = [replace(s, width=np.full(len(s.width), np.nan)) for s in stripes]
    grid = build_grid(rig, f"L{k}", stripes, range(steps), angles)
    return clean(clip(grid, Volume(60, 2, 60)))[0]


def scanned(part: str, steps: int, lasers: int) -> list[RangeGrid]:
    return [scan(part, steps, k) for k in range(lasers)]

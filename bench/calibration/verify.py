"""Verification: a laser that moves is found, and stated uncertainties hold what they say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from tests.calibrate.world import true_rig

from bench.calibration._figures import Figure
from bench.calibration._worlds import BALLS, NOISE, SMALL, outcome, survey
from turnscan.rig import Rig
from turnscan.shapes.verification import Artefact, Length, ball_at, ball_values, drift

MOVED = 0.05
"""mm by which the laser has moved when the third scan is made."""
EVEN = 8
"""Scans in a series in which nothing moves."""
_EXACT = 1e-4


def figures(quick: bool) -> Iterator[Figure]:
    """Coverage of the expanded uncertainties, and the drift alarm."""
    count = 20 if quick else 200
    done = [outcome(seed, SMALL) for seed in range(count)]
    spread = 2 * np.sqrt(0.95 * 0.05 / count)
    for name in done[0].error:
        share = float(np.mean([abs(o.z(name)) <= 2 for o in done]))
        asked = f"95 % ± {100 * spread:.0f} %"
        met = abs(share - 0.95) <= spread
        yield Figure(f"U (k = 2) holds the error of {name}, {count} rigs", asked,
                     f"{100 * share:.1f} %", met)  # fmt: skip
    yield from _alarms(range(3 if quick else 5))


def _alarms(seeds: range) -> Iterator[Figure]:
    rig = true_rig()
    found = [_rings(rig, [0.0, 0.0, MOVED], seed) for seed in seeds]
    told = f"{sum(map(bool, found))} of {len(found)} series"
    first = ", ".join(sorted({name for names in found for name in names}))
    asked = "all, at the third scan"
    yield Figure(f"laser moved by {MOVED:g} mm after two scans of the balls is found ({first})",
                 asked, told, all(found))  # fmt: skip
    false = [_rings(rig, [0.0] * EVEN, seed + 100) for seed in seeds]
    count = sum(map(bool, false))
    yield Figure(
        f"false alarms in series of {EVEN} scans", "none", f"{count} of {len(false)}", not count
    )


def _rings(rig: Rig, moved: list[float], seed: int) -> list[str]:
    """Test values whose control chart rings in a series."""
    dice = np.random.default_rng(seed)
    pair = BALLS[0], BALLS[2]
    apart = float(np.linalg.norm(pair[1][0] - pair[0][0]))
    bar = Artefact(
        "ball-bar", "bar", tuple(Length(2 * r, _EXACT) for _, r in pair), Length(apart, _EXACT)
    )  # fmt: skip
    values = []
    for move in moved:
        seen = survey(rig, dice, NOISE, move)
        balls = [ball_at(seen, c, r) for c, r in pair]
        values.append({v.name: v for v in ball_values(bar, seen, balls)})
    names = [n for n in values[0] if n.startswith(("size", "distance"))]
    charts = {n: drift([v[n].value for v in values], [v[n].noise for v in values]) for n in names}
    return [n for n, chart in charts.items() if chart.alarm.any()]


__all__ = ["figures"]

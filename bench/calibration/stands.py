"""Bodies that stand well and badly: which rigs they make, and which are refused.

A rig as a ruler knows it (5 mm, 2°) is refined by one body of known size, which stands nearer and
nearer to a place where it fits any of many rigs. How far the rig then bends shapes, in the volume
of the body, is held against the noise of one point, and against what the rig says of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tests.calibrate.bodies import Body, both, cylinder, ruled, sphere, two_lasers

from bench.calibration._figures import Figure
from turnscan.calibrate import Balls, Refined, RefineSettings, Round, Sweep, refine
from turnscan.calibrate._shape import moves_of, places_of
from turnscan.errors import CalibrationError
from turnscan.rig import Rig

STEPS = np.radians(np.arange(0.0, 360.0, 18.0))
BALL, ROUND = 18.0, 14.0
"""mm: radii."""
BESIDE, LEANS = (0.1, 0.3, 0.6, 1.5, 5.0, 14.0), (0.5, 3.0, 20.0)
"""mm by which the ball is beside the axis; degrees by which the cylinder leans."""
NOISES = (0.05, 0.5)
"""px"""
MOST = 3.0
"""Times the noise of a point: a rig that bends shapes by more should have been refused."""
WELL = 5.0
"""mm beside the axis, from where a ball says enough: none of these rigs should be refused."""


@dataclass(frozen=True)
class _Stand:
    words: str
    body: Body
    form: Balls | Round
    radius: float
    well: bool = False
    """Whether the rig should be found."""


def figures(quick: bool) -> Iterator[Figure]:
    """One line for each place of a body: by one laser and by two, little noise and much."""
    seeds = range(20, 21 if quick else 24)
    stands = [_Stand(f"ball {e:g} mm beside the axis", sphere((0.8 * e, -0.6 * e, 22.0), BALL),
                     Balls(), BALL, e >= WELL) for e in BESIDE]  # fmt: skip
    stands += [_Stand(f"cylinder leaning by {t:g}°", cylinder((9.0, 2.0), ROUND, t), Round(), ROUND)
               for t in LEANS]  # fmt: skip
    worst, turned_away, well = 0.0, 0, 0
    for lasers in (1, 2):
        for stand in stands:
            found = [_bent(stand, lasers, px, seed) for px in NOISES for seed in seeds]
            some = np.array([f for f in found if f is not None])
            if stand.well:
                well += len(found)
                turned_away += len(found) - len(some)
            told = f"{len(found) - len(some)} of {len(found)} refused"
            if len(some):
                worst = max(worst, float(some[:, 0].max()))
                told += f"; bent by up to {some[:, 0].max():.1f} × the noise"
                told += f", rms {np.sqrt(np.mean(some[:, 1] ** 2)):.1f} × what is stated"
            yield Figure(f"{'one laser' if lasers == 1 else 'two lasers'}, {stand.words}", "", told)
    yield Figure("rigs that were not refused bend shapes, rms", f"≤ {MOST:g} × the noise",
                 f"{worst:.1f}", worst <= MOST)  # fmt: skip
    yield Figure(f"rigs refused though the ball is {WELL:g} mm and more beside the axis", "none",
                 f"{turned_away} of {well}", not turned_away)  # fmt: skip


def _bent(stand: _Stand, lasers: int, px: float, seed: int) -> tuple[float, float] | None:
    """By how much the rig bends shapes, in noise and in what it says of that; None if refused."""
    true = two_lasers(lasers=lasers)
    sweeps = both(true, stand.body, STEPS, STEPS, seed, every=10, noise=px)
    settings = RefineSettings(
        queries=400, rounds=6, body=(stand.form, ((stand.radius, 0.001),))
    )  # fmt: skip
    try:
        done: Refined = refine(ruled(true, seed), sweeps, settings)
    except CalibrationError:
        return None
    bend = _bend(done.rig, true, sweeps)
    return bend / done.gap_noise, bend / done.shape_after


def _bend(rig: Rig, true: Rig, sweeps: list[Sweep]) -> float:
    """mm rms by which places in the volume of the body are off, place and size left aside."""
    at = places_of(true, sweeps)
    own, _ = np.linalg.qr(moves_of(at))
    off = (places_of(rig, sweeps) - at).ravel()
    left = off - own @ (own.T @ off)
    return float(np.sqrt(left @ left / len(at)))


__all__ = ["figures"]

"""A table that is eccentric and has play, told without markers by two lasers, or by one laser.

The hexagon's stripes are cut by the true sheets, in every row of the picture as a scan's are, and
have the noise of the paper rig's pictures; the table goes there and back, as play between the two
ways shows in no other scan. One laser sees the hexagon there and back, and once more after it was
shifted and turned on the table, or tipped too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from tests.calibrate.bodies import both, prism, two_lasers

from bench.calibration._figures import Figure, at_most
from turnscan.arrays import Floats
from turnscan.calibrate import Refined, RefineSettings, Sweep, refine
from turnscan.rig import Pose, Rig, TableMotion, rotation_from_vector, rotation_z

NOISE = 0.1
"""px."""
ECCENTRIC, PLAY = 1.0, 0.5
"""Degrees."""
STEPS = np.radians(np.arange(0.0, 360.0, 9.0))
TOLD = np.concatenate([STEPS, STEPS[::-1]])
CENTRE = np.array([5.0, 2.0])
TRUTH = {"motion.cos1": 0.0, "motion.sin1": ECCENTRIC, "motion.backlash": PLAY}


_ASIDE = np.array([-4.0, 6.0, 0.0])
MOVED = Pose(rotation_z(np.radians(40.0)), _ASIDE)
TIPPED = Pose(rotation_from_vector([np.radians(25.0), 0.0, 0.0]) @ MOVED.rotation, _ASIDE)
"""First pose → second, on the table."""
ABOUT = Pose(rotation_from_vector([0.0, 0.0, 0.006]), np.array([0.2, -0.2, 0.0]))
"""How far off its place the second pose is thought to be at first."""
Way = Callable[[Rig, TableMotion, int], tuple[list[Sweep], RefineSettings]]


def figures(quick: bool) -> Iterator[Figure]:
    """Two lasers, there and back; then one laser and two poses, upright and tipped."""
    seeds = range(2 if quick else 10)
    for name, lasers, way in (
        ("two lasers", 2, _one_pose),
        ("one laser, two poses", 1, partial(_two_poses, MOVED)),
        ("one laser, the second pose tipped", 1, partial(_two_poses, TIPPED)),
    ):
        yield from _figures(name, lasers, way, seeds)


def _one_pose(rig: Rig, motion: TableMotion, seed: int) -> tuple[list[Sweep], RefineSettings]:
    return _swept(rig, motion, seed), RefineSettings(geometry=False)


def _two_poses(
    moved: Pose, rig: Rig, motion: TableMotion, seed: int
) -> tuple[list[Sweep], RefineSettings]:
    upright = prism((CENTRE[0], CENTRE[1]), 40.0)

    def again(p: Floats) -> Floats:
        return upright(moved.inverse().apply(p.reshape(-1, 3)).reshape(p.shape))

    second = both(rig, again, TOLD, motion.angle(TOLD), seed + 50, noise=NOISE, every=1)
    sweeps = [*_swept(rig, motion, seed), *(replace(s, pose=1) for s in second)]
    return sweeps, RefineSettings(geometry=False, poses=(ABOUT @ moved.inverse(),))


def _figures(who: str, lasers: int, way: Way, seeds: range) -> list[Figure]:
    rig = two_lasers(lasers=lasers)
    motion = TableMotion(np.radians([[0.0, ECCENTRIC]]), 0.0, np.radians(PLAY))
    before, after, off = [], [], []
    for seed in seeds:
        sweeps, settings = way(rig, motion, seed)
        done = refine(rig, sweeps, settings)
        first = [s for s in sweeps if s.pose == 0]
        before.append(_off_parallel(rig, first))
        after.append(_off_parallel(done.rig, first))
        off.append(_pulls(done))
    out = [
        Figure(f"{who}: hexagon's sides off parallel before", "", f"{max(before):.2f}°"),
        at_most(f"{who}: hexagon's sides off parallel", max(after), 0.1, "°"),
    ]
    for name in TRUTH:
        z = np.array([pull.get(name, np.inf) for pull in off])
        worst, rms = float(np.abs(z).max()), float(np.sqrt(np.mean(z**2)))
        told = f"worst {worst:.2f}, rms {rms:.2f} of {len(z)}"
        out.append(Figure(f"{who}: {name} off, in its sigma", "≤ 3", told, worst <= 3))
    return out


def _swept(rig: Rig, motion: TableMotion, seed: int) -> list[Sweep]:
    hexagon = prism((CENTRE[0], CENTRE[1]), 40.0)
    return both(rig, hexagon, TOLD, motion.angle(TOLD), seed, noise=NOISE, every=1)


def _pulls(done: Refined) -> dict[str, float]:
    return {
        name: (done.estimated[name].value - np.radians(truth)) / done.estimated[name].sigma
        for name, truth in TRUTH.items()
        if name in done.estimated
    }


def _off_parallel(rig: Rig, sweeps: list[Sweep]) -> float:
    """Degrees by which opposite sides are off parallel, at most."""
    at: Floats = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps])[:, :2]
    turn = np.degrees(np.arctan2(*(at - CENTRE).T[::-1]))
    leans = []
    for k in range(6):
        middle = np.degrees(0.2) + 60 * k
        side = at[np.abs((turn - middle + 180) % 360 - 180) < 24]
        across = np.linalg.svd(side - side.mean(axis=0), full_matrices=False)[2][1]
        leans.append((np.degrees(np.arctan2(across[1], across[0])) - middle + 90) % 180 - 90)
    return float(np.abs(np.array(leans[:3]) - leans[3:]).max())


__all__ = ["figures"]

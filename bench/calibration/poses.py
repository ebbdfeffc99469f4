"""One laser and a part in two poses: from how far off a rig is found by them.

The paper's rig with one laser scans a part twice (simulated pictures). Then every number of the rig
is made wrong by the same length and angle, its whole standard uncertainty; the signs change from
seed to seed. What `turnscan refine` makes of it is held against a ball whose stripes are cut by the
true sheet, without noise: how far 95 % of it is off roundness.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.calibrate.bodies import both, doubted, sphere

from bench.calibration._figures import Figure
from bench.surface_truth import scanned
from turnscan.arrays import Floats
from turnscan.errors import CalibrationError, InputError
from turnscan.rig import Rig
from turnscan.shapes import fit_sphere
from turnscan.simulate import SimulationSpec
from turnscan.workflows import refine

PART = "head"
STANDS = (((0.0, 0.0), (0.0, 0.0)), ((25.0, -30.0), (5.0, 0.0)))
"""Lean, degrees, and shift, mm, of the part in each pose."""
STEPS = 72
TURN = np.radians(np.arange(0.0, 360.0, 9.0))
OFF = ((0.25, 0.1), (0.5, 0.2), (1.0, 0.5), (2.0, 1.0))
"""mm and degrees by which every number of the rig is wrong."""
BALL = sphere((10.0, -8.0, 23.0), 18.0)
NEAR = 1.2
"""Times the noise: surfaces that are no further apart fit."""


def figures(quick: bool) -> Iterator[Figure]:
    """By how wrong the rig was."""
    seeds = range(2 if quick else 5)
    with tempfile.TemporaryDirectory() as folder:
        true, scans = _scans(Path(folder))
        for length, angle in OFF:
            found = [_refined(true, scans, (length, angle), seed, Path(folder)) for seed in seeds]
            yield _line((length, angle), found)


def _scans(folder: Path) -> tuple[Rig, list[Path]]:
    paths = []
    for (a, b), shift in STANDS:
        spec = SimulationSpec(PART, "paper", lasers=1, steps=STEPS,
                              lean=(math.radians(a), math.radians(b)), shift=shift)  # fmt: skip
        made, path = scanned(spec, folder)
        paths.append(path)
    return made.rig, paths


def _refined(
    true: Rig, scans: Sequence[Path], off: tuple[float, float], seed: int, folder: Path
) -> tuple[float, float, float] | None:
    """Form of the ball before and after, mm, and the gaps between poses in units of their noise;
    None where the rig was refused."""
    known = doubted(replace(true, covariance=None), *off)
    assert known.covariance is not None
    sign = np.random.default_rng(seed).choice([-1.0, 1.0], len(known.covariance))
    wrong = known.perturbed(sign * np.sqrt(np.diag(known.covariance)))
    wrong = replace(wrong, covariance=known.covariance)
    try:
        done = refine(scans, folder / f"{seed}-{off[0]:g}.json", rig=wrong).refined
    except (CalibrationError, InputError) as e:
        print(f"  {off[0]:g} mm, {off[1]:g}°, seed {seed}: {e}", flush=True)
        return None
    return _form(true, wrong), _form(true, done.rig), done.gap_after / done.gap_noise


def _form(true: Rig, rig: Rig) -> float:
    """mm, of 95 % of a ball as a rig sees it."""
    sweeps = both(true, BALL, TURN, TURN, 5, noise=0.0, every=6)
    at: Floats = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps])
    ball = fit_sphere(at)
    off = np.abs(np.linalg.norm(at - ball.centre, axis=1) - ball.radius)
    return float(2 * np.quantile(off, 0.95))


def _line(off: tuple[float, float], found: Sequence[tuple[float, float, float] | None]) -> Figure:
    done = [f for f in found if f is not None]
    better = [f for f in done if f[2] <= NEAR and f[1] < f[0]]
    told = f"{len(better)} of {len(found)}, {len(found) - len(done)} refused"
    if done:
        before, after = (max(f[k] for f in done) for k in (0, 1))
        told += f"; worst form of a ball {before:.2f} → {after:.3f} mm"
        told += f", gaps up to {max(f[2] for f in done):.2f} × their noise"
    name = f"every number wrong by {off[0]:g} mm and {off[1]:g}°: rigs that became better"
    return Figure(name, "", told)


__all__ = ["figures"]

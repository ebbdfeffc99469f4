"""A table whose axis tilts, shifts and rises once in a turn, found by the markers on its platter.

Rigs are calibrated from corners and stripes that stand for pictures (`bench.calibration._worlds`),
with motions of the axis that are drawn: of one size, in any direction. A box beside the axis that
such a table carries is then scanned, 72 steps, without noise: so the rig decides.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from tests.analytic import box, full_turn, scan_shape
from tests.calibrate.world import World, true_rig

from bench.calibration._figures import Figure, at_most
from bench.calibration._worlds import NOISE, USUAL, calibrated
from bench.calibration.real import MOUSE
from turnscan.arrays import Floats
from turnscan.points import build_grid
from turnscan.rig import Rig, Wobble, rotation_from_vector
from turnscan.stripes import Stripe
from turnscan.workflows import CalibrationPictures, calibrate

TILT, SHIFT, RISE = np.radians(0.1), 0.2, 0.1
"""rad, mm, mm: how much of each is drawn."""
STEPS = 72
BOX = box((22.0, 14.0, 30.0), (6.0, -4.0, 32.0), 0.3)
_FAR = 0.5
"""mm: a point that is farther off is no part of a face."""
_RIM = 75.0
"""mm from the axis: where the real table's markers are."""
_GROUPS = (("tilt", 0), ("shift", 2), ("rise", 4))


def figures(quick: bool) -> Iterator[Figure]:
    """What is found of drawn motions, and what becomes of a box."""
    seeds = range(3 if quick else 20)
    still = [calibrated(_world(seed, None), USUAL) for seed in seeds]
    true = [drawn(seed) for seed in seeds]
    made = [calibrated(_world(seed, w), USUAL) for seed, w in zip(seeds, true, strict=True)]
    found = [rig for rig in made if rig.wobble is not None]
    yield _count("axis that stands still: motion adopted", still, 0)
    yield _count("axis that moves: motion adopted", made, len(made))
    off = [_pulls(r, w) for r, w in zip(made, true, strict=True) if r.wobble is not None]
    for name, first in _GROUPS:
        z = np.concatenate([pull[first : first + 2] for pull, _ in off])
        sigma = float(np.mean([s[first : first + 2].mean() for _, s in off]))
        stated = f"{np.degrees(sigma):.4f}°" if name == "tilt" else f"{sigma:.4f} mm"
        rms, worst = float(np.sqrt(np.mean(z**2))), float(np.abs(z).max())
        told = f"rms {rms:.2f}, worst {worst:.2f} of {len(z)}, stated {stated}"
        yield Figure(f"{name} off, in its sigma, rms", "0.7 to 1.3", told, 0.7 <= rms <= 1.3)
    yield from _boxes(found[:5], [w for r, w in zip(made, true, strict=True) if r.wobble][:5])
    if MOUSE.is_dir() and not quick:
        yield _of_a_real_table()


def _of_a_real_table() -> Figure:
    """Whether the pictures of a real table, with four markers, ask for such a motion."""
    with tempfile.TemporaryDirectory() as folder:
        boards, lit, table = (MOUSE / n for n in ("camera-boards", "laser-boards", "empty-table"))
        done = calibrate(
            CalibrationPictures(str(boards), {"laser": str(lit)}, str(table)),
            "chessboard:8x6:40",
            Path(folder) / "rig.json",
            markers="DICT_4X4_50:30",
            table_step_deg=2.25,
        )
    w = done.rig.wobble
    told = "not adopted" if w is None else f"adopted: {w.reach(_RIM):.3f} mm, {_RIM:g} mm from it"
    return Figure("turntable-mouse, 160 pictures of the table: motion", "", told)


def drawn(seed: int) -> Wobble:
    """A motion of the usual size, in directions of its own."""
    ways = np.random.default_rng(1000 + seed).uniform(0.0, 2.0 * np.pi, 3)
    tilt, shift, rise = (
        size * np.array([np.cos(way), np.sin(way)])
        for size, way in zip((TILT, SHIFT, RISE), ways, strict=True)
    )
    return Wobble(tilt, shift, rise)


def _world(seed: int, wobble: Wobble | None) -> World:
    return World(replace(true_rig(), wobble=wobble), np.random.default_rng(seed), NOISE)


def _count(name: str, rigs: Sequence[Rig], wanted: int) -> Figure:
    count = sum(rig.wobble is not None for rig in rigs)
    asked = f"{wanted} of {len(rigs)}" if wanted else "none"
    return Figure(name, asked, f"{count} of {len(rigs)}", count == wanted)


def _pulls(rig: Rig, truth: Wobble) -> tuple[Floats, Floats]:
    """(6,) errors in their standard uncertainties, and these."""
    assert rig.wobble is not None
    assert rig.covariance is not None
    k = rig.parameter_names.index(Wobble.NAMES[0])
    sigma = np.sqrt(np.diag(rig.covariance)[k : k + 6])
    return (rig.wobble.values - truth.values) / sigma, sigma


def _boxes(rigs: Sequence[Rig], true: Sequence[Wobble]) -> Iterator[Figure]:
    """Form of the box: without the motion, with what was found of it, and by the same camera,
    sheet and axis with the motion as it was drawn."""
    bent, left, rest = [], [], []
    for rig, w in zip(rigs, true, strict=True):
        seen = scan_shape(replace(true_rig(), wobble=w), BOX, full_turn(STEPS), "laser")
        rig = replace(rig, covariance=None)
        bent.append(form(replace(rig, wobble=None), seen))
        left.append(form(rig, seen))
        rest.append(form(replace(rig, wobble=w), seen))
    of = f"box of 44 × 28 × 60 mm, {len(rigs)} rigs: off its form, rms"
    yield Figure(f"{of}, the motion left out", "", f"{max(bent):.3f} mm")
    yield at_most(f"{of}, as calibrated", max(left), 0.03, "mm")
    told = f"{max(rest):.3f} mm"
    yield Figure(f"{of}, the motion as drawn, the rest as calibrated", "", told)


def form(rig: Rig, seen: Sequence[Stripe]) -> float:
    """mm rms by which the points are off the box, laid where it fits them best."""
    grid = build_grid(rig, "laser", seen, np.arange(STEPS), full_turn(STEPS))
    return float(np.sqrt(np.mean(off_box(grid.points[grid.found]) ** 2)))


def off_box(points: Floats) -> Floats:
    """(n,) mm by which points (n, 3) are off the box, laid where it fits them best."""

    def rest(x: Floats) -> Floats:
        return np.asarray(np.clip(BOX(points @ rotation_from_vector(x[:3]).T + x[3:]), -_FAR, _FAR))

    laid = least_squares(rest, np.zeros(6), loss="soft_l1", f_scale=0.1)
    return rest(laid.x)


__all__ = ["BOX", "drawn", "figures", "form", "off_box"]

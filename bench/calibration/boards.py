"""Rigs calibrated from rendered pictures of a board, against the truth, and a ball bar they scan.

56 pictures of a ChArUco board: twenty held freely, twelve under the laser, 24 on the table,
with speckle, noise, blur and (ciclop) JPEG. The board is the simulator's small one; before the
modern rig a larger one is held, which fills the picture (`bench._held`). The axis is compared in
the camera's frame, where focal length and distance go together, and against the sheet, on which
what is measured depends. What was asked of the modern rig is a length. Of the others it is what
their pixels tell: over `SEEDS` rigs, each with boards, pictures and a scan of its own, the errors
must scatter as the stated uncertainties say, within what so few of them can show (99 %).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from bench._held import from_large_boards
from bench._rigs import from_pictures
from bench.accuracy import scan
from bench.calibration._figures import Figure, at_most, within
from turnscan.arrays import Floats
from turnscan.rig import Rig
from turnscan.shapes.verification import (
    Artefact,
    Length,
    ball_values,
    find_balls,
    survey_of_grids,
)
from turnscan.simulate import SimulationSpec, bench, seconds_of

STEPS = 40
VIEWS = (20, 12, 24)
"""Pictures of the board: held freely, under the laser, on the table."""
SEEDS = (1, 2, 3, 4, 5)
ASKED = (0.02, 0.005, 0.02, 0.005, 0.02, 0.02, 0.03)
"""What was asked of the modern rig: mm and degrees of the axis in either frame, mm of the balls'
diameters and of their distance."""
_MIDDLE = np.array([0.0, 0.0, 60.0])
"""Half as high as the bar."""
_EXACT = 1e-6
_STEP = 1e-3
"""Of a standard deviation: for slopes."""


@dataclass(frozen=True)
class Found:
    """What one rig gave for one figure."""

    what: str
    unit: str
    error: float
    expanded: float
    """k = 2, from the rig's and the scan's own covariance."""


def figures(quick: bool) -> Iterator[Figure]:
    """The paper's rig, and but for ``quick`` the webcam's and the modern one."""
    for name in ("paper",) if quick else ("paper", "ciclop"):
        yield from _told(name, [found(name, seed) for seed in SEEDS[: 2 if quick else None]])
    if quick:
        return
    for f, limit in zip(found("modern", 1), ASKED, strict=True):
        line = at_most(f"modern: {f.what}", f.error, limit, f.unit, 4)
        told = f"{line.reached} (U = {f.expanded:.3g} {f.unit})"
        yield Figure(line.name, line.asked, told, line.met)


def _told(name: str, rigs: list[list[Found]]) -> Iterator[Figure]:
    """How the errors of several rigs scatter, beside their uncertainties."""
    low, high = np.sqrt(chi2.ppf((0.005, 0.995), len(rigs)) / len(rigs))
    for same in zip(*rigs, strict=True):
        what, unit = same[0].what, same[0].unit
        z = np.array([2.0 * f.error / f.expanded for f in same])
        line = within(f"{name}: {what}", float(np.sqrt(np.mean(z**2))), low, high)
        errors = " ".join(f"{f.error:+.3g}" for f in same)
        U = float(np.sqrt(np.mean([f.expanded**2 for f in same])))
        asked = f"rms of error / u {low:.2f} to {high:.2f}"
        told = f"{line.reached} ({errors} {unit}; U = {U:.2g} {unit})"
        yield Figure(line.name, asked, told, line.met)


def found(name: str, seed: int) -> list[Found]:
    """One rig calibrated from pictures, its axis and the ball bar that it scans."""
    spec = SimulationSpec("ball-bar", name, lasers=1, seed=seed)
    made = bench(spec)
    rig = from_large_boards(spec, VIEWS) if name == "modern" else from_pictures(spec, VIEWS)
    grid = scan(made, seconds_of(spec), STEPS, rig).grid
    seen = survey_of_grids([grid], rig)
    bar = Artefact(
        "ball-bar", "bar", (Length(30.0, _EXACT), Length(30.0, _EXACT)), Length(100.0, _EXACT)
    )
    balls = find_balls(seen, [d.value for d in bar.diameters])
    values = ball_values(bar, seen, balls)
    return _axis(made.rig, rig) + [
        Found(f"{v.name}, error", "mm", v.value, v.expanded)
        for v in values
        if v.test in ("size", "distance")
    ]


def _axis(true: Rig, rig: Rig) -> list[Found]:
    laser = rig.sheets[0].name
    basis = np.linalg.svd(rig.T_camera_table.rotation[:, 2:].T)[2][1:]
    off = seen_of(rig, laser, basis) - seen_of(true, laser, basis)
    spread = spread_of(rig, laser, basis)
    rows = []
    for what, unit, parts in (
        ("axis in the camera's frame, off", "mm", slice(0, 2)),
        ("axis in the camera's frame, turned", "°", slice(2, 4)),
        ("axis from the sheet, off", "mm", slice(4, 5)),
        ("axis to the sheet, turned", "°", slice(5, 6)),
    ):
        value = float(off[parts].sum() if len(off[parts]) == 1 else np.linalg.norm(off[parts]))
        told = 2.0 * float(np.sqrt(np.trace(spread[parts, parts])))
        rows.append(Found(what, unit, value, told))
    return rows


def seen_of(rig: Rig, laser: str, basis: Floats) -> Floats:
    """(6,) mm from the camera to the axis half as high as the bar, and degrees by which it leans,
    along both directions of ``basis`` (2, 3), across it; mm and degrees from the sheet to it."""
    T, sheet = rig.T_camera_table, rig.sheet(laser)
    axis, at = T.rotation[:, 2], T.apply(_MIDDLE)
    lean = math.degrees(math.asin(float(sheet.normal @ axis)))
    return np.array([*basis @ at, *np.degrees(basis @ axis), float(sheet.distance(at)), lean])


def spread_of(rig: Rig, laser: str, basis: Floats) -> Floats:
    """(6, 6) of what `seen_of` gives, as the rig's own covariance leaves it open."""
    if rig.covariance is None:
        return np.full((6, 6), np.nan)
    values, directions = np.linalg.eigh(rig.covariance)
    steps = (_STEP * np.sqrt(np.maximum(values, 0.0)) * directions).T
    slopes = [
        seen_of(rig.perturbed(d), laser, basis) - seen_of(rig.perturbed(-d), laser, basis)
        for d in steps
    ]
    J = np.array(slopes) / (2 * _STEP)
    return np.asarray(J.T @ J)


__all__ = ["ASKED", "Found", "figures", "found"]

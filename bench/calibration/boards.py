"""Rigs calibrated from rendered pictures of a board, against the truth, and a ball bar they scan.

56 pictures of a ChArUco board: twenty held freely, twelve under the laser, 24 on the table,
with speckle, noise, blur and (ciclop) JPEG. The board is the simulator's small one; before the
modern rig a larger one is held, which fills the picture (`bench._held`). The axis is compared in
the camera's frame, where focal length and distance go together, and against the sheet, on which
what is measured depends. What was asked of the modern rig is a length; of the others it is what
their pixels tell: the expanded uncertainty (k = 2) of each figure, from the scatter of what was
found in these pictures.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bench._held import from_large_boards
from bench._rigs import from_pictures
from bench.accuracy import scan
from bench.calibration._figures import Figure, at_most
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
MODERN = (0.02, 0.005, 0.03, 0.02)
"""mm of the axis, degrees of the axis, mm of the bar's distance, mm of a ball's diameter."""
_MIDDLE = np.array([0.0, 0.0, 60.0])
"""Half as high as the bar."""
_EXACT = 1e-6
_STEP = 1e-3
"""Of a standard deviation: for slopes."""


def figures(quick: bool) -> Iterator[Figure]:
    """The paper's rig, and but for ``quick`` the webcam's and the modern one."""
    for name in ("paper",) if quick else ("paper", "ciclop", "modern"):
        yield from _rig(name)


def _rig(name: str) -> Iterator[Figure]:
    spec = SimulationSpec("ball-bar", name, lasers=1, seed=1)
    made = bench(spec)
    true = made.rig
    rig = from_large_boards(spec, VIEWS) if name == "modern" else from_pictures(spec, VIEWS)
    limits = MODERN if name == "modern" else None
    yield from _axis(name, true, rig, limits)
    grid = scan(made, seconds_of(spec), STEPS, rig).grid
    seen = survey_of_grids([grid], rig)
    bar = Artefact(
        "ball-bar", "bar", (Length(30.0, _EXACT), Length(30.0, _EXACT)), Length(100.0, _EXACT)
    )
    balls = find_balls(seen, [d.value for d in bar.diameters])
    for v in ball_values(bar, seen, balls):
        if v.test not in ("size", "distance"):
            continue
        known = None if limits is None else limits[2] if v.test == "distance" else limits[3]
        limit = v.expanded if known is None else known
        line = at_most(f"{name}: {v.name}, error", v.value, limit, "mm")
        told = f"{line.reached} (U = {v.expanded:.3f} mm)"
        yield Figure(line.name, line.asked, told, line.met)


def _axis(name: str, true: Rig, rig: Rig, limits: tuple[float, ...] | None) -> Iterator[Figure]:
    laser = rig.sheets[0].name
    basis = np.linalg.svd(rig.T_camera_table.rotation[:, 2:].T)[2][1:]
    off = seen_of(rig, laser, basis) - seen_of(true, laser, basis)
    spread = spread_of(rig, laser, basis)
    for what, unit, parts, k in (
        ("axis in the camera's frame, off", "mm", slice(0, 2), 0),
        ("axis in the camera's frame, turned", "°", slice(2, 4), 1),
        ("axis from the sheet, off", "mm", slice(4, 5), 0),
        ("axis to the sheet, turned", "°", slice(5, 6), 1),
    ):
        value = float(off[parts].sum() if len(off[parts]) == 1 else np.linalg.norm(off[parts]))
        told = 2.0 * float(np.sqrt(np.trace(spread[parts, parts])))
        line = at_most(f"{name}: {what}", value, told if limits is None else limits[k], unit, 4)
        reached = line.reached if limits is None else f"{line.reached} (U = {told:.3g} {unit})"
        yield Figure(line.name, line.asked, reached, line.met)


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


__all__ = ["figures"]

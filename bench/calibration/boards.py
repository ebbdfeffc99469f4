"""Rigs calibrated from rendered pictures of a board, against the truth, and a ball bar they scan.

56 pictures of a small ChArUco board: twenty held freely, twelve under the laser, 24 on the table,
with speckle, noise, blur and (ciclop) JPEG. The axis is compared in the camera's frame, where focal
length and distance go together, and against the sheet, on which what is measured depends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bench._rigs import from_pictures
from bench.accuracy import scan
from bench.calibration._figures import Figure, at_most
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
PIXEL_SHARE = 0.1
"""Of a pixel at the axis: the limit for rigs that were given none in mm."""
MODERN = (0.02, 0.005, 0.03, 0.02)
"""mm of the axis, degrees of the axis, mm of the bar's distance, mm of a ball's diameter."""
_MIDDLE = np.array([0.0, 0.0, 60.0])
"""Half as high as the bar."""
_EXACT = 1e-6


def figures(quick: bool) -> Iterator[Figure]:
    """The paper's rig, and but for ``quick`` the webcam's and the modern one."""
    for name in ("paper",) if quick else ("paper", "ciclop", "modern"):
        yield from _rig(name)


def _rig(name: str) -> Iterator[Figure]:
    spec = SimulationSpec("ball-bar", name, lasers=1, seed=1)
    made = bench(spec)
    true, rig = made.rig, from_pictures(spec, VIEWS)
    pixel = float(np.linalg.norm(true.T_camera_table.translation)) / true.camera.fx
    share = PIXEL_SHARE * pixel
    limits = MODERN if name == "modern" else (share, math.degrees(share / 50.0), share, share)
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
        limit = limits[2] if v.test == "distance" else limits[3]
        line = at_most(f"{name}: {v.name}, error", v.value, limit, "mm")
        told = f"{line.reached} (U = {v.expanded:.3f} mm)"
        yield Figure(line.name, line.asked, told, line.met)


def _axis(name: str, true: Rig, rig: Rig, limits: tuple[float, ...]) -> Iterator[Figure]:
    T, G = true.T_camera_table, rig.T_camera_table
    a, b = T.rotation[:, 2], G.rotation[:, 2]
    turned = math.degrees(math.asin(float(np.linalg.norm(np.cross(a, b)))))
    off = T.apply(_MIDDLE) - G.translation
    beside = float(np.linalg.norm(off - (off @ b) * b))
    yield at_most(f"{name}: axis in the camera's frame, off", beside, limits[0], "mm")
    yield at_most(f"{name}: axis in the camera's frame, turned", turned, limits[1], "°", 4)
    laser = rig.sheets[0].name
    both = [(r.sheet(laser), r.T_camera_table) for r in (rig, true)]
    apart = [float(s.distance(P.apply(_MIDDLE))) for s, P in both]
    lean = [math.degrees(math.asin(float(s.normal @ P.rotation[:, 2]))) for s, P in both]
    yield at_most(f"{name}: axis from the sheet, off", apart[0] - apart[1], limits[0], "mm")
    yield at_most(f"{name}: axis to the sheet, turned", lean[0] - lean[1], limits[1], "°", 4)


__all__ = ["figures"]

"""The noise of corners and of stripes on boards in rendered pictures.

Boards held freely, as `bench._rigs.from_pictures` holds them: what is found in the pictures against
where the true rig sees it. What is drawn in place of pictures (`bench._drawn`) has the figures of
the modern rig. Of each rig, how far the mean of a stripe is off as it is seen on the print, and
where its light fell (`stripes_on_print`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bench._drawn import ALONG, CORNERS, STRIPES, bench_board, stripe_of
from bench._rigs import BOARD, MARGIN, PRINT, ROOM, held_boards
from bench.calibration._figures import Figure
from turnscan.arrays import Floats
from turnscan.calibrate import LaserPicture, detect_board, stripe_light
from turnscan.calibrate._select import on_board, straighter
from turnscan.rig import Pose
from turnscan.simulate import Bench, Renderer, SimulationSpec, bench, seconds_of

_BOARDS = 8


def figures(quick: bool) -> Iterator[Figure]:
    """Scatter of corners, of stripes, and how alike neighbouring rows of a stripe err."""
    count = 3 if quick else _BOARDS
    seen = _boards("modern", count)
    corners = np.vstack([one.corners for one in seen])
    means = np.array([one.corners.mean(axis=0) for one in seen])
    stripes = [one.fell for one in seen if len(one.fell)]
    scatter = float(np.median([s.std() for s in stripes]))
    alike = float(np.median([np.corrcoef(s[:-1], s[1:])[0, 1] for s in stripes]))
    off = float(np.median([abs(s.mean()) for s in stripes]))
    for name, found, drawn in (
        (f"corners of {len(seen)} boards, rms px", float(np.sqrt((corners**2).mean())), CORNERS),
        ("mean of a board's corners, rms px", float(np.sqrt((means**2).mean())),
         CORNERS / np.sqrt(len(corners) / len(seen))),
        (f"stripes on {len(stripes)} of them, a row's scatter, median px", scatter, STRIPES),
        ("correlation of neighbouring rows, median", alike, ALONG),
        ("mean of a stripe, median px", off, 0.0),
    ):  # fmt: skip
        yield Figure(f"modern, rendered: {name}", f"{drawn:.3f} drawn", f"{found:.3f}")
    for rig in ("modern",) if quick else ("paper", "ciclop", "modern"):
        lit = [one for one in (seen if rig == "modern" else _boards(rig, count)) if len(one.fell)]
        as_seen, fell = (
            np.sqrt(np.mean([np.mean(s) ** 2 for s in some]))
            for some in ([one.seen for one in lit], [one.fell for one in lit])
        )
        yield Figure(
            f"{rig}, rendered: mean of a stripe on the print of {len(lit)} boards, rms px",
            "less off than seen",
            f"{fell:.3f} ({as_seen:.3f} as it is seen)",
            bool(fell < as_seen),
        )


class _Errors(NamedTuple):
    """Of what is found of a board and of the stripe on it."""

    corners: Floats
    """(n, 2) px."""
    seen: Floats
    """(k,) px across, of the stripe as it is seen."""
    fell: Floats
    """(m,) px across, of the stripe as its light fell on the print."""


def _boards(rig: str, count: int) -> list[_Errors]:
    spec = SimulationSpec("ball-bar", rig, lasers=1, seed=1)
    scene = bench(replace(spec, scene="charuco", room=ROOM)).scene
    made = replace(bench(spec), scene=scene)
    held = held_boards(np.random.default_rng(1), bench_board(spec), count)
    return [_errors(made, at, seconds_of(spec), k) for k, at in enumerate(held)]


def _errors(made: Bench, at: Pose, seconds: float, shot: int) -> _Errors:
    body = replace(made.scene.bodies[0], T_table_part=at)
    scene = replace(made.scene, bodies=(body, *made.scene.bodies[1:]))
    camera, rig = Renderer(replace(made, scene=scene)), made.rig
    dark, T = camera.picture(0.0, (), seconds, shot=shot), rig.T_camera_table @ at @ PRINT
    view = detect_board(dark, BOARD)
    off = view.corners - rig.camera.project(T.apply(BOARD.points[view.ids]))
    laser = rig.sheets[0].name
    on = camera.picture(0.0, (laser,), seconds, shot=shot)
    lit = LaserPicture.of(view, stripe_light(on, dark))
    true = stripe_of(rig, T, laser)

    def across(found: Floats) -> Floats:
        if not len(found) or not len(true):
            return np.zeros(0)
        found = found[(found[:, 1] >= true[0, 1]) & (found[:, 1] <= true[-1, 1])]
        return np.asarray(found[:, 0] - np.interp(found[:, 1], true[:, 1], true[:, 0]))

    seen = on_board(rig.camera, lit.candidates, BOARD, T, MARGIN)
    _, fell = straighter(rig.camera, lit, T, MARGIN)
    return _Errors(off, across(seen), across(fell))


__all__ = ["figures"]

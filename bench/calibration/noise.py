"""The noise of corners and of stripes on boards in rendered pictures of the modern rig.

Boards held freely, as `bench._rigs.from_pictures` holds them: what is found in the pictures against
where the true rig sees it. What is drawn in place of pictures (`bench._drawn`) has these figures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench._drawn import ALONG, CORNERS, STRIPES, bench_board, stripe_of
from bench._rigs import BOARD, MARGIN, PRINT, ROOM, held_boards
from bench.calibration._figures import Figure
from turnscan.arrays import Floats
from turnscan.calibrate import LaserPicture, detect_board, stripe_light
from turnscan.calibrate._select import board_stripe_of
from turnscan.rig import Pose
from turnscan.simulate import Bench, Renderer, SimulationSpec, bench, seconds_of

_BOARDS = 8


def figures(quick: bool) -> Iterator[Figure]:
    """Scatter of corners, of stripes, and how alike neighbouring rows of a stripe err."""
    spec = SimulationSpec("ball-bar", "modern", lasers=1, seed=1)
    scene = bench(replace(spec, scene="charuco", room=ROOM)).scene
    made = replace(bench(spec), scene=scene)
    held = held_boards(np.random.default_rng(1), bench_board(spec), 3 if quick else _BOARDS)
    seen = [_errors(made, at, seconds_of(spec)) for at in held]
    corners = np.vstack([c for c, _ in seen])
    means = np.array([c.mean(axis=0) for c, _ in seen])
    stripes = [s for _, s in seen if len(s)]
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


def _errors(made: Bench, at: Pose, seconds: float) -> tuple[Floats, Floats]:
    """Errors (n, 2) px of the corners of a board, and (k,) px across of the stripe on it."""
    body = replace(made.scene.bodies[0], T_table_part=at)
    scene = replace(made.scene, bodies=(body, *made.scene.bodies[1:]))
    camera, rig = Renderer(replace(made, scene=scene)), made.rig
    dark, T = camera.picture(0.0, (), seconds), rig.T_camera_table @ at @ PRINT
    view = detect_board(dark, BOARD)
    off = view.corners - rig.camera.project(T.apply(BOARD.points[view.ids]))
    laser = rig.sheets[0].name
    lit = LaserPicture.of(view, stripe_light(camera.picture(0.0, (laser,), seconds), dark))
    found, true = board_stripe_of(rig.camera, lit, T, MARGIN), stripe_of(rig, T, laser)
    if not len(found) or not len(true):
        return off, np.zeros(0)
    inside = (found[:, 1] >= true[0, 1]) & (found[:, 1] <= true[-1, 1])
    found = found[inside]
    return off, found[:, 0] - np.interp(found[:, 1], true[:, 1], true[:, 0])


__all__ = ["figures"]

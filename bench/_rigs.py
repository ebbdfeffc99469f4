"""What the software believes about a rig: the truth, a calibration from pictures, or the plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from turnscan.arrays import Image
from turnscan.calibrate import (
    CalibrationSettings,
    Charuco,
    LaserPicture,
    TablePicture,
    calibrate_rig,
    detect_board,
    stripe_light,
)
from turnscan.rig import Pose, Rig, rotation_from_vector
from turnscan.simulate import Bench, Body, Renderer, SimulationSpec, bench, seconds_of
from turnscan.simulate._boards import printed_plate

Knowledge = Literal["exact", "calibrated", "uncalibrated"]
KNOWLEDGE: tuple[Knowledge, ...] = get_args(Knowledge)
BOARD = Charuco(9, 6, 12.0, 9.0, "DICT_5X5_100")
"""The simulator's board."""
VIEWS = (8, 8, 12)
"""Pictures of the board: held freely, under the laser, on the table."""
TURN = 0.9
"""rad to both sides, in which the table carries the board."""
MARGIN = 10.0
"""mm of white paper round the print."""
_PIXELS = 120
"""Of a square in a print."""
ROOM = 0.5
"""Room light while the board is photographed, as a share of the grey scale."""


def known_rig(made: Bench, spec: SimulationSpec, knowledge: Knowledge) -> Rig | None:
    """The rig to measure with; None for the truth itself."""
    if knowledge == "exact":
        return None
    return as_planned(made.rig) if knowledge == "uncalibrated" else from_pictures(spec)


def as_planned(rig: Rig) -> Rig:
    """The plan of a rig that was put together by hand and eye.

    Against the truth the lens is 1 % off, the laser turned by 0.5° and beside the axis by 0.5 mm,
    the camera's line of sight passes the axis at 1 mm and is rolled by 0.3°.
    """
    off = {
        "camera.fx": 0.01 * rig.camera.fx,
        "camera.fy": 0.01 * rig.camera.fy,
        f"{rig.sheets[0].name}.turn_along": math.radians(0.5),
        f"{rig.sheets[0].name}.offset": 0.5,
        "table.shift_x": 1.0,
        "table.turn_z": math.radians(0.3),
    }
    names = rig.parameter_names
    missing = set(off) - set(names)
    assert not missing, f"{missing} not in {names}"
    return rig.perturbed([off.get(name, 0.0) for name in names])


def from_pictures(spec: SimulationSpec, views: tuple[int, int, int] = VIEWS) -> Rig:
    """Calibrate with simulated pictures of the board, held freely and under the laser (`VIEWS`)."""
    free, under, stops = views
    stand = bench(replace(spec, scene="charuco", room=ROOM)).scene.bodies[0].T_table_part
    held = held_boards(np.random.default_rng(spec.seed), stand, free + under)
    return photographed(spec, held[:free], held[free:], stops)


def photographed(
    spec: SimulationSpec,
    free: Sequence[Pose],
    under: Sequence[Pose],
    stops: int,
    board: Charuco = BOARD,
) -> Rig:
    """Calibrate with simulated pictures of a board whose plate is in these poses on the table,
    ``free``ly held and ``under`` the lasers, and of the simulator's board in so many ``stops``.

    Each laser is lit by itself on the boards under it; no picture of the table has one on, as the
    boards say where the sheets are.
    """
    scene = bench(replace(spec, scene="charuco", room=ROOM)).scene
    made = replace(bench(spec), scene=scene)
    seconds = seconds_of(spec)
    lasers = tuple(beam.name for beam in made.beams)
    plate = scene.bodies[0] if board == BOARD else plate_of(board)

    def camera_of(body: Body, body_at: Pose) -> Renderer:
        bodies = (replace(body, T_table_part=body_at), *scene.bodies[1:])
        return Renderer(replace(made, scene=replace(scene, bodies=bodies)))

    def pictures(k: int, body_at: Pose, lit: tuple[str, ...]) -> list[Image]:
        """Of board ``k``, with noise of its own: without a laser, then with each of these."""
        there = camera_of(plate, body_at)
        sets = ((), *((laser,) for laser in lit))
        return [there.picture(0.0, on, seconds, shot=k) for on in sets]

    stand = scene.bodies[0].T_table_part
    # The board shows its print to the camera between these angles only.
    start, step = -TURN, 2 * TURN / (stops - 1)
    with ThreadPoolExecutor(2) as pool:
        shown = [pool.submit(pictures, k, at, lasers if k >= len(free) else ())
                 for k, at in enumerate((*free, *under))]  # fmt: skip
        turning = camera_of(scene.bodies[0], stand)
        turned = pool.map(lambda k: turning.picture(start + k * step, (), seconds), range(stops))
        taken = [one.result() for one in shown]
        seen = [detect_board(dark, board, f"free {i}") for i, (dark, *_) in enumerate(taken)]
        striped: dict[str, Sequence[LaserPicture]] = {
            laser: [
                LaserPicture.of(view, stripe_light(lit[k], dark))
                for view, (dark, *lit) in zip(seen[len(free) :], taken[len(free) :], strict=True)
            ]
            for k, laser in enumerate(lasers)
        }
        table = [
            TablePicture(detect_board(picture, BOARD, f"table {k}"), {}, f"table {k}", k)
            for k, picture in enumerate(turned)
        ]
    return calibrate_rig(seen[: len(free)], striped, table, said_of_boards(stand, step)).rig


def plate_of(board: Charuco) -> Body:
    """A plate with a board's print, as the simulator's own."""
    import cv2

    kind = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    size = (board.columns, board.rows)
    made = cv2.aruco.CharucoBoard(size, board.square, board.marker, kind)
    print_ = np.asarray(made.generateImage((size[0] * _PIXELS, size[1] * _PIXELS)))
    width, height = (n * board.square for n in size)
    return printed_plate("board", print_, width, height, MARGIN)


def said_of_boards(stand: Pose, step: float) -> CalibrationSettings:
    """What the user says of the boards: on the table it ``stand``s and turns by ``step`` rad."""
    lowest = float(stand.apply(np.array([0.0, 0.0, MARGIN + BOARD.square]))[2])
    return CalibrationSettings(step=step, table_board=BOARD, lowest=lowest, margin=MARGIN)


def held_boards(draw: np.random.Generator, stand: Pose, count: int) -> list[Pose]:
    """Where boards are held that are like the one which stands on the table."""
    middle = stand.apply(np.array([0.0, 0.0, 46.0]))
    return [_held(draw, stand, middle) for _ in range(count)]


def _held(draw: np.random.Generator, stand: Pose, middle: np.ndarray) -> Pose:
    """The board, tilted by up to 35° about each axis and moved by up to 50 mm."""
    turn = rotation_from_vector(draw.uniform(-0.6, 0.6, 3))
    shift = draw.uniform(-1.0, 1.0, 3) * (50.0, 30.0, 25.0)
    R = turn @ stand.rotation
    return Pose(R, turn @ (stand.translation - middle) + middle + shift)


def print_on_plate(board: Charuco) -> Pose:
    """The frame of a board's print in that of the plate which carries it."""
    x0, _, x1, y1 = board.extent
    R = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return Pose(R, np.array([0.0, -(x0 + x1) / 2, MARGIN + y1]))


PRINT = print_on_plate(BOARD)

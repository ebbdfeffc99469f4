"""Boards and markers: the grammar, drawn pictures, and why a board was not found."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import median_filter

from tests.calibrate.boards import drawn_charuco, drawn_chessboard, marker_picture
from tests.calibrate.world import World, true_layout, true_rig
from turnscan.calibrate import (
    Charuco,
    Chessboard,
    detect_board,
    detect_markers,
    moved_platter,
    parse_board,
    platter_seen,
    stripe_light,
    white_margin,
)
from turnscan.calibrate._angle import markers_off, table_angle
from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._light import _along_lines
from turnscan.calibrate._select import NEAR_PX, _most_near, on_board, on_platter
from turnscan.errors import FormatError, InputError
from turnscan.rig import Pose, rotation_from_vector, rotation_z
from turnscan.stripes import Orientation

CHARUCO = Charuco(7, 5, 25.0, 19.0, "DICT_4X4_50")


@pytest.mark.parametrize(
    ("text", "board"),
    [
        ("chessboard:8x6:40", Chessboard(8, 6, 40.0)),
        ("charuco:7x5:25:19:DICT_4X4_50", CHARUCO),
    ],
)
def test_grammar(text: str, board: object) -> None:
    assert parse_board(text) == board


@pytest.mark.parametrize(
    "text",
    ["", "chessboard", "chessboard:8x6", "chessboard:8:40", "chessboard:2x6:40", "dots:8x6:4",
     "chessboard:8x6:-1", "chessboard:8x6:nan", "charuco:7x5:19:25:DICT_4X4_50"],
)  # fmt: skip
def test_bad_grammar_is_one_clear_line(text: str) -> None:
    with pytest.raises(FormatError, match="board"):
        parse_board(text)


def test_unknown_dictionary_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match="DICT_4X4_50"):
        parse_board("charuco:7x5:25:19:DICT_9X9_1")


def test_chessboard_corners_to_a_twentieth_of_a_pixel() -> None:
    view = detect_board(drawn_chessboard(), Chessboard(8, 6, 50.0))
    assert not view.failure
    want = view.points[:, :2] + (109.5, 99.5)
    flipped = want[::-1]
    error = min(np.abs(view.corners - want).max(), np.abs(view.corners - flipped).max())
    assert error < 0.05


def test_reasons() -> None:
    assert (
        "contrast" in detect_board(np.full((480, 640), 90, np.uint8), Chessboard(8, 6, 40)).failure
    )
    assert "no chessboard" in detect_board(drawn_chessboard(), Chessboard(7, 4, 40.0)).failure
    assert "readable" in detect_board(drawn_chessboard(), CHARUCO).failure
    mirrored = np.ascontiguousarray(drawn_charuco()[:, ::-1])
    assert "mirrored" in detect_board(mirrored, CHARUCO).failure


@pytest.mark.parametrize("legacy", [False, True])
def test_charuco_whole_and_in_part(legacy: bool) -> None:
    picture = drawn_charuco(legacy)
    assert len(detect_board(picture, CHARUCO).ids) == 24
    part = detect_board(np.ascontiguousarray(picture[:, :400]), CHARUCO)
    assert 6 <= len(part.ids) < 24


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.4])
def test_table_angle_of_a_picture(angle: float) -> None:
    layout = replace(true_layout(), shape=np.zeros(5))
    rig = true_rig()
    rig = replace(
        rig,
        camera=replace(rig.camera, distortion=np.zeros(5)),
        markers=layout.markers("DICT_4X4_50"),
    )
    found = platter_seen(marker_picture(angle), rig).angle
    assert found is not None
    assert abs(np.angle(np.exp(1j * (found.angle - angle)))) < np.radians(0.1)
    assert set(found.markers) <= {5, 18, 27, 42}
    assert platter_seen(np.full((480, 640), 128, np.uint8), rig).angle is None
    with pytest.raises(ValueError, match="camera"):
        platter_seen(np.zeros((100, 100), np.uint8), rig)


def test_table_angle_sigma_is_the_spread() -> None:
    world = World(true_rig(), np.random.default_rng(8), 0.2)
    layout = true_layout()
    rig = replace(world.rig, markers=layout.markers("DICT_4X4_50"))
    pulls = []
    for k in range(60):
        view = world.rider_view(layout, 0.1 * k)
        corners = view.corners.reshape(-1, 4, 2)
        seen = [
            (int(n), m.corners, c)
            for n, m, c in zip(view.numbers, rig.markers, corners, strict=True)
        ]
        found = table_angle(rig, seen)
        assert found is not None
        pulls.append(np.angle(np.exp(1j * (found.angle - 0.1 * k))) / found.sigma)
    assert 0.7 < float(np.std(pulls)) < 1.4


def test_a_marker_that_moved_is_left_out() -> None:
    world = World(true_rig(), np.random.default_rng(9), 0.1)
    layout = true_layout()
    rig = replace(world.rig, markers=layout.markers("DICT_4X4_50"))
    corners = world.rider_view(layout, 0.4).corners.reshape(-1, 4, 2).copy()
    corners[2] += 40
    seen = [(m.number, m.corners, c) for m, c in zip(rig.markers, corners, strict=True)]
    found = table_angle(rig, seen)
    assert found is not None
    assert found.markers == (5, 18, 42)
    assert abs(found.angle - 0.4) < 0.003


def test_small_markers_are_not_trusted() -> None:
    tiny = cv2.resize(marker_picture(0.0), (120, 90), interpolation=cv2.INTER_AREA)
    assert len(detect_markers(tiny, "DICT_4X4_50").numbers) == 0


def test_the_stripe_on_a_board_and_not_the_clutter() -> None:
    world = World(true_rig(), np.random.default_rng(3), 0.1)
    T = Pose(rotation_from_vector([0.2, -0.3, 0.1]), [-140.0, -100.0, 700.0])
    line = world.board_stripe(T).pixels
    picture = np.full((480, 640), 90.0)
    v, u = np.mgrid[0:480, 0:640]
    at = np.interp(np.arange(480), line[:, 1], line[:, 0], left=np.nan, right=np.nan)
    light = 90 * np.exp(-((u - at[:, None]) ** 2) / (2 * 1.3**2))
    picture += np.nan_to_num(light)
    picture += 80 * np.exp(-((u - 0.7 * v - 60) ** 2) / 4) * (v < 90)  # something else, thin
    picture += 2 * world.dice.standard_normal(picture.shape)
    seen = stripe_light(np.clip(picture, 0, 255).astype(np.uint8)).places
    board = parse_board("chessboard:8x6:40")
    kept = on_board(world.rig.camera, seen, board, T, 0.0)
    truth = np.interp(kept[:, 1], line[:, 1], line[:, 0])
    assert len(kept) > 100
    assert 0.01 < float(np.sqrt(np.mean((kept[:, 0] - truth) ** 2))) < 0.35


def test_the_line_with_most_points_near_is_the_first_of_those_with_as_many() -> None:
    dice = np.random.default_rng(4)
    points = np.arange(900.0)[:, None] * (0.1, 1.0) + dice.normal(0.0, 0.4, (900, 2))
    points[::5, 0] += dice.uniform(-80.0, 80.0, 180)
    on = dice.permutation(points)[:400]
    lean = 0.1 + dice.normal(0.0, 0.003, 400)
    across = np.stack([np.ones(400), -lean], axis=1) / np.hypot(1.0, lean)[:, None]
    near = np.array([np.abs((points - p) @ n) < NEAR_PX for p, n in zip(on, across, strict=True)])
    count = near.sum(axis=1)
    best = int(np.argmax(count))
    assert best > 100  # not among the lines that are tried at once with the first
    assert 600 < count[best] < 760
    assert np.array_equal(_most_near(points, on, across), near[best])
    # Two stripes of as many points, far apart, each with a line of its own: the first line counts.
    twice = np.vstack([points, points + (1000.0, 0.0)])
    lines = np.vstack([on, on[best] + (1000.0, 0.0)])
    level = np.vstack([across, across[best]])
    first = _most_near(twice, lines, level)
    last = _most_near(twice, lines[::-1], level[::-1])
    assert np.array_equal(first, np.concatenate([near[best], np.zeros(900, dtype=bool)]))
    assert np.array_equal(last, np.concatenate([np.zeros(900, dtype=bool), near[best]]))


def test_a_stripe_on_the_platter_is_not_taken_where_it_lies_on_a_marker() -> None:
    """Black ink moves a stripe: from a third of a side beyond the print on it counts again."""
    world = World(true_rig(), np.random.default_rng(4), 0.0)
    layout = true_layout()
    T = world.rig.T_camera_table
    x, y, turn, side = layout.squares[1]
    c, s = np.cos(turn), np.sin(turn)
    local = np.arange(-60.0, 60.0, 0.5)
    place = np.stack([x + c * local, y + s * local, 0 * local], axis=1)
    inside = np.linalg.norm(place, axis=1) < 80.0
    flat = MarkerLayout(layout.numbers, layout.squares)
    for angle in (0.0, 0.4):
        pixels = world.rig.camera.project(T.apply(place[inside] @ rotation_z(angle).T))
        kept = on_platter(world.rig.camera, pixels, flat, T, angle)
        taken = (np.abs(pixels[:, None] - kept[None]).max(axis=2) < 1e-9).any(axis=1)
        at = np.abs(local[inside])
        assert not taken[at < 1.3 * side / 2].any()
        # One side of the marker is the longer piece; the other is another stripe.
        assert taken[at > 1.4 * side / 2].sum() >= max(taken.sum() - 4, 12)


@pytest.mark.parametrize("dark", [False, True])
def test_a_stripe_in_colour_is_found_where_it_is_in_grey(dark: bool) -> None:
    centre = 60.0 + 20.0 * np.sin(np.arange(80) / 20)
    light = 120 * np.exp(-((np.arange(160) - centre[:, None]) ** 2) / (2 * 1.5**2))
    room = np.full((80, 160), 30.0)
    grey = (room + light).round().astype(np.uint8)
    for weights, colour in ((None, (1.0, 1.0, 1.0)), ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0))):
        lit = np.stack([room + c * light for c in colour], axis=-1).round().astype(np.uint8)
        off = np.stack([room] * 3, axis=-1).astype(np.uint8) if dark else None
        found = stripe_light(lit, off, weights=weights).places
        alone = stripe_light(grey, room.astype(np.uint8) if dark else None).places
        assert len(found) == len(alone) == 80
        assert np.abs(found - alone).max() < 0.02
        assert np.abs(found[:, 0] - centre).max() < 0.1


@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
def test_the_ground_beside_a_stripe_is_the_median_of_the_line(orientation: Orientation) -> None:
    """To the bit what SciPy's median filter gives, also where a line is shorter than the window."""
    for shape in ((40, 60), (7, 5), (1, 90), (30, 1)):
        signal = np.random.default_rng(sum(shape)).integers(0, 9, shape).astype(np.uint16) * 7000
        size = (1, 17) if orientation == "vertical" else (17, 1)
        want = median_filter(signal, size=size, mode="nearest")
        assert np.array_equal(_along_lines(signal, orientation), want)


def pinned_board(around: tuple[int, int, int, int]) -> np.ndarray:
    """A board of 450 × 350 px with white to its left, top, right and bottom, before a dark wall."""
    small = drawn_chessboard()[50:400, 60:510]
    left, top, right, bottom = around
    paper = np.pad(small, ((top, bottom), (left, right)), constant_values=220)
    picture = np.full((1000, 1300), 90, np.uint8)
    picture[60 : 60 + paper.shape[0], 80 : 80 + paper.shape[1]] = paper
    return picture


@pytest.mark.parametrize("stripe", [False, True])
def test_the_margin_is_found_in_the_picture(stripe: bool) -> None:
    picture = pinned_board((150, 60, 110, 30))
    if stripe:  # along the left side: it ends nothing
        picture[:, 160:163] = 255
    view = detect_board(picture, Chessboard(8, 6, 40.0))
    found = white_margin(picture, view) * 50 / 40
    # The corners may be counted from either end of the board.
    ends = (found, np.roll(found, 2))
    assert min(np.abs(f - (150, 60, 110, 30)).max() for f in ends) < 8


def test_a_margin_without_an_end_is_taken_as_usual() -> None:
    board = Chessboard(8, 6, 40.0)
    white = pinned_board((300, 250, 300, 250))
    assert white_margin(white, detect_board(white, board)) == pytest.approx(np.full(4, 60.0))
    # None at all: what is beside the pattern is dark.
    bare = pinned_board((0, 0, 0, 0))
    view = detect_board(pinned_board((60, 60, 60, 60)), board)
    moved = replace(view, corners=view.corners - 60)
    assert white_margin(bare, moved).max() == 0.0


def test_a_stripe_is_looked_for_as_far_as_each_side_of_the_margin() -> None:
    camera = replace(true_rig().camera, distortion=np.zeros(5))
    board, pose = Chessboard(8, 6, 40.0), Pose(np.eye(3), np.array([-140.0, -100.0, 900.0]))
    y = np.linspace(-30.0, 230.0, 200)
    line = np.stack([np.full(200, -90.0), y, np.zeros(200)], axis=1)
    light = camera.project(pose.apply(line))
    assert not len(on_board(camera, light, board, pose, 45.0))
    assert len(on_board(camera, light, board, pose, np.array([60.0, 45.0, 0.0, 45.0]))) > 190
    assert not len(on_board(camera, light, board, pose, np.array([0.0, 45.0, 60.0, 45.0])))


def test_a_platter_that_has_moved_against_the_rig_is_said() -> None:
    """By 2 mm aside it is; by noise, and by a turn of the table, it is not."""
    world = World(true_rig(), np.random.default_rng(9), 0.1)
    layout = true_layout()
    rig = replace(world.rig, markers=layout.markers("DICT_4X4_50"))
    T = rig.T_camera_table
    moved = replace(rig, T_camera_table=replace(T, translation=T.translation + [2.0, 0.0, 0.0]))
    off: dict[str, list[float]] = {"as it was": [], "moved": []}
    for angle in (0.4, 1.9, 3.3):
        corners = world.rider_view(layout, angle).corners.reshape(-1, 4, 2)
        seen = [(m.number, m.corners, c) for m, c in zip(rig.markers, corners, strict=True)]
        off["as it was"].append(markers_off(rig, seen))
        off["moved"].append(markers_off(moved, seen))
    assert max(off["as it was"]) < 0.5
    assert not moved_platter(rig, [*off["as it was"], float("nan")])
    assert not moved_platter(rig, [markers_off(rig, [])])
    (found,) = moved_platter(rig, off["moved"])
    assert (found.code, found.severity, found.where) == ("scan.rig-moved", "warning", "3 pictures")
    assert "beside where the rig puts them" in found.message

"""Wrong pictures, and wrong words about them: each is refused, or said, for the right reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow
from scipy.ndimage import gaussian_filter

from tests.calibrate.boards import drawn_chessboard, marker_picture
from tests.calibrate.bodies import prism, swept, two_lasers
from tests.calibrate.world import true_layout, true_rig
from turnscan.calibrate import angle_model, parse_board
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import Rig, rig_from_json, rig_to_json
from turnscan.scan import Scan, list_pictures
from turnscan.scanner import Shot
from turnscan.workflows import (
    CalibrationPictures,
    CaptureOptions,
    DeviceOptions,
    EvenSteps,
    calibrate,
    capture,
    import_pictures,
    preview_import,
    reconstruct,
    refine,
)
from turnscan.workflows._calibration._calibrate_look import look_for_part
from turnscan.workflows._scanning._capture import Album
from turnscan.workflows._surface._reconstruct import below_stored

STEP = 12.0
SIZE = (80, 120)
BOARD = "chessboard:8x6:40"

Dice = np.random.Generator
Drawn = Callable[[int, Dice], Any]
"""Picture number k, with its noise, grey levels."""


def folder_of(folder: Path, drawn: Drawn, count: int = 6) -> str:
    folder.mkdir(parents=True)
    for k in range(count):
        picture = drawn(k, np.random.default_rng(k))
        Pillow.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).save(
            folder / f"p{k:02d}.png", compress_level=1
        )
    return str(folder)


def line(height: float, width: float = 2.0, size: tuple[int, int] = SIZE) -> Drawn:
    """A line that moves, on noise."""
    at = np.arange(size[1])
    return lambda k, dice: (
        30 + dice.standard_normal(size) + height * np.exp(-(((at - 20 - 12 * k) / width) ** 2) / 2)
    )


def specks(k: int, dice: Dice) -> Any:
    picture = 30 + dice.standard_normal(SIZE)
    picture[np.arange(SIZE[0]), dice.integers(5, SIZE[1] - 5, SIZE[0])] += 120
    return picture


def lit_room(k: int, dice: Dice) -> Any:
    """A flat grey part that turns before a wall, brighter than the red line on it."""
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
    a = k * np.pi / 6
    part = (np.abs(x - 60 - 4 * np.cos(a)) < 26 + 10 * np.cos(2 * a)) & (y > 8)
    grey = np.where(part, 170 + 15 * np.sin(x / 6 + 4 * a), 110 + 8 * np.sin(y / 5))
    picture = grey[..., None] * [1.0, 0.95, 0.9]
    at = 60 + 6 * np.cos(a) + 3 * np.sin(y / 20 + a)
    picture[..., 0] += 70 * np.exp(-((x - at) ** 2) / 4) * part
    return gaussian_filter(picture, (0.6, 0.6, 0)) + 2 * dice.standard_normal(picture.shape)


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Ten pictures of the platter, 12° apart, with a line that moves."""

    def drawn(k: int, _: Dice) -> Any:
        moving = 60 * np.exp(-((np.arange(640) - 40 - 3 * k) ** 2) / 4)
        return marker_picture(np.radians(STEP * k)) + moving

    return folder_of(tmp_path_factory.mktemp("turning") / "on", drawn, 10)


def rig_with_markers() -> Rig:
    camera = replace(true_rig().camera, distortion=np.zeros(5))
    markers = replace(true_layout(), shape=np.zeros(5)).markers("DICT_4X4_50")
    return replace(true_rig(), camera=camera, markers=markers)


@pytest.fixture(scope="module")
def hexagon(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A whole turn of a hexagon beside the axis, in steps of 12°, two lasers, no markers."""
    rig, turned = two_lasers(), np.radians(np.arange(0.0, 360.0, STEP))
    noise = 20 + np.random.default_rng(1).standard_normal((480, 640))
    out = {}
    for sheet in rig.sheets:
        sweep = swept(rig, sheet.name, prism((5.0, 2.0), 40.0), turned, turned, 1)

        def drawn(k: int, _: Dice, sweep: Any = sweep) -> Any:
            picture = noise.copy()
            for u, v in sweep.pixels[sweep.step == k]:
                at = np.arange(int(u) - 6, int(u) + 7)
                picture[int(v) : int(v) + 4, at] += 120 * np.exp(-((at - u) ** 2) / 4)
            return picture

        folder = tmp_path_factory.mktemp("hexagon") / sheet.name
        out[sheet.name] = folder_of(folder, drawn, len(turned))
    return out


@pytest.mark.parametrize(
    ("step", "says"),
    [(-STEP, "turns the other way: the markers say \\+12"), (6.0, "other steps: the markers say")],
)
def test_markers_contradict_steps_of_another_sign_or_size(
    tmp_path: Path, turning: str, step: float, says: str
) -> None:
    out = tmp_path / "a.turnscan"
    with pytest.raises(InputError, match=says) as caught:
        import_pictures(turning, out, EvenSteps(step), rig=rig_with_markers())
    assert caught.value.option is not None
    assert not isinstance(caught.value.hint, str)
    right = caught.value.hint.options[0].value_text
    assert float(right.removeprefix("step:")) == pytest.approx(STEP, abs=0.1)
    assert not out.exists()


def test_right_steps_pass_the_markers(tmp_path: Path, turning: str) -> None:
    out = tmp_path / "a.turnscan"
    assert import_pictures(turning, out, EvenSteps(STEP), rig=rig_with_markers()).frames == 10


def test_a_scan_counts_once_for_a_rig(tmp_path: Path, turning: str) -> None:
    scan, out = tmp_path / "a.turnscan", tmp_path / "better.json"
    import_pictures(turning, scan, EvenSteps(STEP), rig=rig_with_markers())
    with Scan.open(scan) as opened:
        seen = opened.digest
    again = rig_from_json(rig_to_json(replace(rig_with_markers(), evidence=("0123", seen))))
    assert again.evidence == ("0123", seen)
    with pytest.raises(InputError, match="it would count twice"):
        refine(scan, out, rig=again)
    assert not out.exists()


def test_two_lasers_contradict_steps_of_another_sign(
    tmp_path: Path, hexagon: dict[str, str]
) -> None:
    with pytest.raises(InputError, match="turns the other way: with these steps the two lasers"):
        import_pictures(hexagon, tmp_path / "a.turnscan", EvenSteps(-STEP), rig=two_lasers())


@pytest.mark.parametrize("between", [None, "3deg"])
def test_an_even_table_is_asked_for_by_measured_profiles_alone(
    tmp_path: Path, hexagon: dict[str, str], monkeypatch: pytest.MonkeyPatch, between: str | None
) -> None:
    """Of those between them both lasers' chords contradict each other, whatever the table did."""
    asked = []

    def told(seen: object, grids: object) -> list[Finding]:
        asked.append(seen)
        return []

    monkeypatch.setattr("turnscan.workflows._calibration._refine.table_findings", told)
    scan = tmp_path / "a.turnscan"
    import_pictures(hexagon, scan, EvenSteps(STEP), rig=two_lasers())
    reconstruct(scan, spacing_between=between)
    assert len(asked) == (between is None)


@pytest.mark.parametrize(
    ("step", "code", "says"),
    [
        # A wrong sense makes a mirror image, in which nothing is wrong: it is said to be unknown.
        (-STEP, "scan.sense-unchecked", "size of the step is borne out by the seam, its sense"),
        (20.0, "scan.seam-open", "30 steps make 600°, but the part does not close"),
    ],
)
def test_one_laser_tells_whether_a_turn_closes(
    tmp_path: Path, hexagon: dict[str, str], step: float, code: str, says: str
) -> None:
    out, rig = tmp_path / "a.turnscan", two_lasers(lasers=1)
    pictures = {"right": hexagon["right"]}
    found = import_pictures(pictures, out, EvenSteps(step), rig=rig).findings
    assert [says in f.message for f in found if f.code == code] == [True]


@pytest.mark.parametrize(
    ("name", "drawn", "code"),
    [
        ("a good line", line(150.0), None),
        ("a clipped line", line(900.0), "scan.overexposed"),
        ("a line out of focus", line(150.0, 14.0, (80, 400)), "scan.blurred"),
        ("specks", specks, "scan.no-line"),
        ("no light", line(0.0), "scan.no-stripe"),
    ],
)
def test_what_is_wrong_with_the_line_is_said(
    tmp_path: Path, name: str, drawn: Drawn, code: str | None
) -> None:
    pictures = folder_of(tmp_path / "p", drawn)
    done = import_pictures(pictures, tmp_path / "a.turnscan", EvenSteps(5))
    assert [f.code for f in done.findings] == ([code] if code else []), name
    assert (done.line_share > 0.9) == (code not in ("scan.no-line", "scan.no-stripe"))


@pytest.mark.parametrize("wall", [(1.0, 0.95, 0.9), (0.75, 0.9, 1.0)], ids=["warm", "blue"])
def test_a_weak_line_in_a_lit_room_is_distinguished_from_the_part_by_its_colour(
    tmp_path: Path, wall: tuple[float, float, float]
) -> None:
    """Of a blue part the light that moves is blue, whatever colour the line has."""

    def drawn(k: int, dice: Dice) -> Any:
        picture = lit_room(k, dice)
        grey = picture[..., 2:] / 0.9
        return picture + grey * (np.array(wall) - [1.0, 0.95, 0.9])

    pictures = folder_of(tmp_path / "p", drawn, 12)
    done = import_pictures(pictures, tmp_path / "a.turnscan", EvenSteps(30))
    assert done.plan.weights is not None
    assert min(done.plan.weights) < 0 < done.plan.weights[0]
    grey = import_pictures(pictures, tmp_path / "b.turnscan", EvenSteps(30), colour="red")
    assert done.line_share > 0.8
    assert grey.kept > 1.4 * done.kept


@pytest.mark.parametrize(("size", "top"), [((480, 320), 400), ((300, 200), 240)])
def test_nothing_is_wrong_with_a_small_part(
    tmp_path: Path, size: tuple[int, int], top: int
) -> None:
    y, x = np.indices(size)

    def small(k: int, dice: Dice) -> Any:
        turned = 2 * np.pi * k / 12
        at = size[1] / 2 + 30 * np.sin(y / 40 + turned) + 20 * np.cos(turned)
        stripe = 150 * np.exp(-(((x - at) / 2.0) ** 2) / 2) * (y > top)
        return 12 + dice.standard_normal((*size, 3)) + stripe[..., None] * [1.0, 0.1, 0.1]

    looked = preview_import(folder_of(tmp_path / "p", small, 12))
    assert looked.findings == ()


def test_a_part_in_a_lit_room_without_a_line_is_no_line(tmp_path: Path) -> None:
    def dull(k: int, dice: Dice) -> Any:
        picture = lit_room(k, dice)
        picture[..., 0] = picture[..., 1] / 0.95 + dice.standard_normal(SIZE)
        return picture

    pictures = folder_of(tmp_path / "p", dull, 12)
    done = import_pictures(pictures, tmp_path / "a.turnscan", EvenSteps(30))
    assert "scan.no-line" in [f.code for f in done.findings]


def test_the_edges_of_a_coloured_part_are_no_line(tmp_path: Path) -> None:
    """A blue line on a red part in a lit room: red stands out most, at the part's edges."""
    y, x = np.mgrid[0:120, 0:200]

    def drawn(k: int, dice: Dice) -> Any:
        a = k * np.pi / 6
        part = np.abs(x - 100 - 25 * np.cos(a + y / 30)) < 45
        body = 110 * (0.6 + 0.4 * np.sin((x - 100) / 20 + 3 * a + y / 15))
        picture = np.where(part[..., None], body[..., None] * [1.0, 0.5, 0.4], 60.0)
        at = 100 + 10 * np.sin(y / 20 + a) + 8 * np.cos(a)
        picture[..., 2] += 40 * np.exp(-(((x - at) / 1.8) ** 2) / 2)
        return picture + 1.5 * dice.standard_normal(picture.shape)

    looked = preview_import(folder_of(tmp_path / "p", drawn, 12))
    assert "scan.no-line" in [f.code for f in looked.findings]
    assert looked.weights is not None
    assert min(looked.weights) >= 0


@pytest.mark.parametrize("quality", [60, 90])
def test_blocks_of_jpeg_are_no_line(tmp_path: Path, quality: int) -> None:
    folder = tmp_path / "p"
    folder.mkdir()
    for k in range(12):
        wall = 60 + 3 * np.random.default_rng(k).standard_normal((120, 100, 3))
        Pillow.fromarray(wall.astype(np.uint8)).save(folder / f"p{k:02d}.jpg", quality=quality)
    looked = preview_import(str(folder))
    assert "scan.no-line" in [f.code for f in looked.findings]
    assert looked.weights is not None
    assert min(looked.weights) >= 0, "a difference of channels shows no line here"


@pytest.mark.parametrize(
    ("height", "tint", "quality"),
    [
        (0.0, (1.0, 0.95, 0.9), 30),
        (0.0, (1.0, 0.95, 0.9), 60),
        (0.0, (0.9, 1.0, 0.95), 75),
        (0.0, (1.0, 0.85, 0.7), 90),
        (35.0, (1.0, 0.95, 0.9), 90),
        (35.0, (1.0, 0.95, 0.9), 60),
    ],
)
def test_steps_of_colour_in_jpeg_are_no_line(
    tmp_path: Path, height: float, tint: tuple[float, float, float], quality: int
) -> None:
    """A part that is nearly grey turns in a lit room; a weak red line is on it, or none."""
    y, x = np.mgrid[0:160, 0:240]
    folder = tmp_path / "p"
    folder.mkdir()
    for k in range(12):
        a, dice = k * np.pi / 6, np.random.default_rng(k)
        part = (np.abs(x - 120 - 8 * np.cos(a)) < 52 + 20 * np.cos(2 * a)) & (y > 16)
        grey = np.where(part, 170 + 15 * np.sin(x / 12 + 4 * a), 110 + 8 * np.sin(y / 10))
        picture = grey[..., None] * tint
        at = 120 + 12 * np.cos(a) + 6 * np.sin(y / 40 + a)
        picture[..., 0] += height * np.exp(-((x - at) ** 2) / 4) * part
        picture = gaussian_filter(picture, (0.6, 0.6, 0)) + 0.5 * dice.standard_normal(
            (160, 240, 3)
        )
        shown = np.clip(picture, 0, 255).astype(np.uint8)
        Pillow.fromarray(shown).save(folder / f"p{k:02d}.jpg", quality=quality)
    looked = preview_import(str(folder))
    assert ("scan.no-line" in [f.code for f in looked.findings]) == (height == 0.0)
    assert looked.weights is not None
    assert (min(looked.weights) < 0) == (height > 0.0), "by a difference of channels"


def test_why_a_green_line_is_not_measured_in_green_is_said(tmp_path: Path) -> None:
    def drawn(k: int, dice: Dice) -> Any:
        bright = line(900.0)(k, dice)[..., None] * [0.25, 1.0, 0.2]
        return bright + 2 * dice.standard_normal((*SIZE, 3))

    done = import_pictures(folder_of(tmp_path / "p", drawn), tmp_path / "a.turnscan", EvenSteps(5))
    assert done.plan.weights is not None
    assert done.plan.weights[1] < max(done.plan.weights)
    assert "; green counts little, as " in "".join(done.summary)


def _mixed(k: int, dice: Dice) -> Any:
    return line(150.0, size=SIZE if k < 4 else (60, 90))(k, dice)


def _grey(k: int, dice: Dice) -> Any:
    return 110 + 8 * dice.standard_normal((480, 640))


@pytest.mark.parametrize(
    ("name", "camera", "laser", "table", "board", "says"),
    [
        ("another board", "board", "board", "table", "chessboard:9x6:40", "8x6 inner corners, not"),
        ("the board as the table", "board", "board", "board", BOARD, "the board and no marker"),
        ("the table as the board", "table", "board", "table", BOARD, "but markers of DICT_4X4_50"),
        ("mixed sizes", "board", "small", "table", BOARD, "pictures of different size"),
        ("blurred", "blurred", "board", "table", BOARD, "blurred"),
        ("overexposed", "white", "board", "table", BOARD, "overexposed|clipped|bright"),
        ("dark", "black", "board", "table", BOARD, "dark"),
    ],
)
def test_pictures_of_another_stage_or_kind_are_refused(
    tmp_path: Path, stages: dict[str, str], name: str, camera: str, laser: str, table: str,
    board: str, says: str,
) -> None:  # fmt: skip
    out = tmp_path / "rig.json"
    pictures = CalibrationPictures(stages[camera], {"laser": stages[laser]}, stages[table])
    with pytest.raises(InputError, match=says):
        calibrate(pictures, board, out, markers="DICT_4X4_50:27.5")
    assert not out.exists()


@pytest.mark.parametrize("stands", [True, False])
def test_a_part_on_the_table_is_distinguished_from_an_empty_platter(
    tmp_path: Path, turning: str, stands: bool
) -> None:
    """The line on an empty platter stays where it is, whichever way the table is turned."""
    pictures, out = turning, tmp_path / "rig.json"

    def empty(k: int, dice: Dice) -> Any:
        still = 60 * np.exp(-((np.arange(640) - 300) ** 2) / 4)
        return marker_picture(np.radians(STEP * k)) + still + dice.standard_normal((480, 640))

    if not stands:
        pictures = folder_of(tmp_path / "empty", empty, 8)
    pairs = [(path, None) for path in list_pictures(pictures)]
    if not stands:
        look_for_part(pairs, "DICT_4X4_50", None, "vertical")
        return
    with pytest.raises(InputError, match="a part stands on the table"):
        look_for_part(pairs, "DICT_4X4_50", None, "vertical")
    rig = replace(rig_with_markers(), markers=())
    with pytest.raises(InputError, match="a part stands on the table"):
        calibrate(CalibrationPictures(table=pictures), None, out, rig=rig,
                  markers="DICT_4X4_50:27.5")  # fmt: skip
    assert not out.exists()


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    board = drawn_chessboard().astype(np.float64)
    kinds: dict[str, Drawn] = {
        "board": lambda k, dice: board + dice.standard_normal(board.shape),
        "table": lambda k, dice: marker_picture(0.2 * k),
        "small": lambda k, dice: board[:240, :320],
        "blurred": lambda k, dice: gaussian_filter(board, 30) + dice.standard_normal(board.shape),
        "white": lambda k, dice: board * 0 + 255,
        "black": lambda k, dice: 2 + dice.standard_normal(board.shape),
    }
    root = tmp_path_factory.mktemp("stages")
    return {name: folder_of(root / name, drawn, 4) for name, drawn in kinds.items()}


def test_a_jump_of_the_table_is_stated_with_the_names_of_its_pictures() -> None:
    angles = np.radians(STEP) * np.arange(30.0)
    angles[17:] += np.radians(5.0)
    names = [f"step_{k:02d}.jpg" for k in range(30)]
    found = angle_model(angles, np.full(30, np.radians(0.02)), names=names).findings
    jumps = [f for f in found if f.code == "calibrate.step-jump"]
    assert len(jumps) == 1
    assert "+17.00° instead of +12.00°" in jumps[0].message
    assert "step_16.jpg to step_17.jpg" in jumps[0].where
    assert "calibrate.step-harmonic" not in [f.code for f in found]


def test_pictures_of_mixed_sizes_are_no_scan(tmp_path: Path) -> None:
    pictures = folder_of(tmp_path / "p", _mixed)
    with pytest.raises(InputError, match=r"p04.png is 90×60 .* first picture is 120×80"):
        import_pictures(pictures, tmp_path / "a.turnscan", EvenSteps(5))
    assert not (tmp_path / "a.turnscan").exists()


def test_a_threshold_below_what_the_file_holds_is_said(tmp_path: Path) -> None:
    pictures, out = folder_of(tmp_path / "p", line(150.0)), tmp_path / "a.turnscan"
    kept = import_pictures(pictures, out, EvenSteps(5), threshold=20.0).plan.threshold
    with Scan.open(out) as scan:
        codes = [[f.code for f in below_stored(scan, t)] for t in (None, kept, kept / 2)]
    assert codes == [[], [], ["scan.threshold-below-stored"]]
    whole = import_pictures(pictures, out, EvenSteps(5), threshold=20.0, keep="full").path
    with Scan.open(whole) as scan:
        assert below_stored(scan, 1.0) == []


def test_a_laser_that_is_not_lit_is_seen_while_pictures_are_taken(tmp_path: Path) -> None:
    board = drawn_chessboard()
    lit = board.copy()
    lit[:, 300:303] = 255
    album = Album(tmp_path, "laser", parse_board(BOARD))
    seen = [album.keep(Shot(k, None, board, "left", on)) for k, on in enumerate((lit, board))]
    assert seen[0].failure == ""
    assert "no line of laser left on the board" in seen[1].failure
    assert "2 pictures, the board in 1;" in str(album.all)


def test_a_camera_alone_takes_pictures_of_a_board(tmp_path: Path) -> None:
    pictures = folder_of(tmp_path / "p", lambda k, dice: drawn_chessboard(), 1)
    camera = DeviceOptions(camera=f"folder:{pictures}")
    done = capture(tmp_path / "out", devices=camera, board=BOARD)
    assert [p.failure for p in done.pictures] == [""]
    with pytest.raises(InputError, match="not given"):
        capture(tmp_path / "out", CaptureOptions(stage="laser"), devices=camera)

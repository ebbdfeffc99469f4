"""`calibrate` called from Python: clear errors, nothing written; a rig and its figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from turnscan.errors import ExportError, InputError, NotEnoughViews
from turnscan.progress import Cancelled, Progress
from turnscan.workflows import CalibrateOptions, CalibrationPictures, calibrate

BOARD = "chessboard:8x6:40"
MARKERS = CalibrateOptions(markers="DICT_4X4_50:30")


@pytest.fixture
def pictures(tmp_path: Path) -> CalibrationPictures:
    """Folders of grey pictures in which there is nothing."""
    for name in ("camera", "laser", "table"):
        (tmp_path / name).mkdir()
        for k in range(6):
            noise = np.random.default_rng(k).integers(90, 130, (120, 160)).astype(np.uint8)
            Image.fromarray(noise).save(tmp_path / name / f"p{k}.png")
    camera, laser, table = (str(tmp_path / n) for n in ("camera", "laser", "table"))
    return CalibrationPictures(camera, {"left": laser}, table)


def _refused(pictures: CalibrationPictures, out: Path, *args: Any, **more: Any) -> InputError:
    out.write_text("the old one")
    with pytest.raises(InputError) as caught:
        calibrate(pictures, *(args or (BOARD, out, MARKERS)), **more)
    assert out.read_text() == "the old one"
    assert "--" not in str(caught.value)
    return caught.value


def test_boards_never_found(tmp_path: Path, pictures: CalibrationPictures) -> None:
    reports: list[tuple[float, str]] = []
    progress = Progress(lambda fraction, text: reports.append((fraction, text)))
    out, report = tmp_path / "rig.json", tmp_path / "report.html"
    with pytest.raises(NotEnoughViews, match="found in 0 of 6 pictures") as caught:
        calibrate(pictures, BOARD, out, MARKERS, report=report, progress=progress)
    assert not isinstance(caught.value.hint, str)
    assert [option.name for option in caught.value.hint.options] == ["board"]
    assert not out.exists()
    assert not report.exists()
    assert list(dict.fromkeys(text for _, text in reports)) == [
        "first look", "camera boards", "laser boards", "adjusting",
    ], "the table's pictures, which may be hundreds, are not read"  # fmt: skip
    fractions = [fraction for fraction, _ in reports]
    assert fractions == sorted(fractions)


def test_pictures_that_do_not_fit(tmp_path: Path, pictures: CalibrationPictures) -> None:
    out = tmp_path / "rig.json"
    assert "no such file" in str(_refused(replace(pictures, camera="nowhere"), out))
    dark = tmp_path / "dark"
    dark.mkdir()
    for k in range(2):
        Image.fromarray(np.zeros((120, 160), np.uint8)).save(dark / f"d{k}.png")
    error = _refused(replace(pictures, laser_dark={"left": str(dark)}), out)
    assert (error.problem, str(error.option)) == (
        "6 pictures with the laser on, 2 with it off", "laser=left",
    )  # fmt: skip
    error = _refused(replace(pictures, table_dark=str(dark)), out)
    assert str(error.option) == "table"
    Image.fromarray(np.zeros((100, 100), np.uint8)).save(Path(pictures.table) / "p3.png")
    assert "different size" in str(_refused(pictures, out))


@pytest.mark.parametrize(
    ("options", "option"),
    [
        ({"markers": "DICT_4X4_50"}, "markers=DICT_4X4_50"),
        ({"table_laser": "right"}, "table_laser=right"),
        ({"colour": "pink"}, "colour=pink"),
    ],
)
def test_options_that_cannot_be(
    tmp_path: Path, pictures: CalibrationPictures, options: dict[str, str], option: str
) -> None:
    out = tmp_path / "rig.json"
    error = _refused(pictures, out, BOARD, out, replace(MARKERS, **options))
    assert str(error.option) == option


def test_several_lasers_need_the_name_of_the_one_that_is_lit(
    tmp_path: Path, pictures: CalibrationPictures
) -> None:
    two = replace(pictures, laser={**pictures.laser, "right": pictures.camera})
    error = _refused(two, tmp_path / "rig.json")
    assert error.problem == "one of left, right must be named as lit in the table pictures"


@pytest.mark.parametrize(
    "options",
    [{"markers": "DICT_4X4_50:30", "table_board": BOARD}, {"markers": "x", "margin_mm": -1}],
)
def test_options_are_checked_when_they_are_made(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        CalibrateOptions(**options)


def test_outputs_that_cannot_be_written(tmp_path: Path, pictures: CalibrationPictures) -> None:
    with pytest.raises(ExportError, match="no folder"):
        calibrate(pictures, BOARD, tmp_path / "none" / "rig.json", MARKERS)
    for wrong in ({"output": tmp_path / "rig.stl"}, {"report": tmp_path / "report.txt"}):
        with pytest.raises(InputError, match="ends"):
            calibrate(
                pictures, BOARD, options=MARKERS, **{"output": tmp_path / "rig.json", **wrong}
            )


def test_cancelled_it_writes_nothing(tmp_path: Path, pictures: CalibrationPictures) -> None:
    reports: list[str] = []
    progress = Progress(lambda _, text: reports.append(text), lambda: "laser boards" in reports)
    with pytest.raises(Cancelled):
        calibrate(pictures, BOARD, tmp_path / "rig.json", MARKERS, progress=progress)
    assert not (tmp_path / "rig.json").exists()

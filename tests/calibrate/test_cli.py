"""``turnscan calibrate``: bad input is one clear line, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from tests.calibrate.boards import drawn_chessboard, marker_picture
from turnscan.cli._calibrate import verb
from turnscan.errors import TurnscanError

SIZE = (48, 64)
"""Of pictures in which there is nothing: the search for a board is longest in them."""


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    """Folders of grey pictures in which there is nothing, and an older rig."""
    out = {}
    for name in ("camera", "laser", "table"):
        folder = tmp_path / name
        folder.mkdir()
        for k in range(6):
            noise = np.random.default_rng(k).integers(90, 130, SIZE).astype(np.uint8)
            Image.fromarray(noise).save(folder / f"p{k}.png")
        out[name] = folder
    out["rig"] = tmp_path / "rig.json"
    out["rig"].write_text("the old one")
    return out


def run(folders: dict[str, Path], *more: str, drop: str = "") -> TurnscanError:
    options = {
        "--camera": str(folders["camera"]),
        "--board": "chessboard:8x6:40",
        "--laser": str(folders["laser"]),
        "--table": str(folders["table"]),
        "--markers": "DICT_4X4_50:30",
        "-o": str(folders["rig"]),
    }
    options |= dict(zip(more[::2], more[1::2], strict=True))
    options.pop(drop, None)
    done = CliRunner().invoke(verb, [x for pair in options.items() for x in pair])
    assert isinstance(done.exception, TurnscanError), done.output
    assert folders["rig"].read_text() == "the old one"
    assert done.exception.exit_code != 0
    assert "\n" not in str(done.exception)
    return done.exception


def test_board_never_found(folders: dict[str, Path]) -> None:
    error = run(folders)
    assert "found in 0 of 6 pictures" in str(error)
    assert error.hint


def test_too_few_boards(folders: dict[str, Path]) -> None:
    for k in range(6):
        picture = drawn_chessboard() if k < 2 else np.full((480, 640), 80, np.uint8)
        for name in ("camera", "laser"):
            Image.fromarray(picture).save(folders[name] / f"p{k}.png")
        Image.fromarray(marker_picture(0.2 * k)).save(folders["table"] / f"p{k}.png")
    assert "found in 1 of 6" in str(run(folders))  # the second one is a copy of the first


def test_pictures_of_different_size(folders: dict[str, Path]) -> None:
    Image.fromarray(np.zeros((100, 100), np.uint8)).save(folders["laser"] / "p3.png")
    assert "different size" in str(run(folders))


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (("--camera", "nowhere"), "nowhere"),
        (("--board", "chessboard:8x6"), "board"),
        (("--markers", "DICT_4X4_50"), "side"),
        (("--markers", "DICT_NONE:30"), "dictionary"),
        (("--table-board", "chessboard:8x6:40"), "either"),
        (("--table-laser", "left"), "left"),
        (("--colour", "pink"), "pink"),
        (("-o", "/nowhere/rig.json"), "nowhere"),
    ],
)
def test_bad_options(folders: dict[str, Path], more: tuple[str, ...], says: str) -> None:
    assert says in str(run(folders, *more))


def test_a_text_file_called_png(folders: dict[str, Path]) -> None:
    (folders["camera"] / "p1.png").write_text("not a picture")
    assert "p1.png" in str(run(folders))


def test_a_dark_picture_for_some_only(folders: dict[str, Path], tmp_path: Path) -> None:
    dark = tmp_path / "dark"
    dark.mkdir()
    for k in range(2):
        Image.fromarray(np.zeros(SIZE, np.uint8)).save(dark / f"d{k}.png")
    assert "2 with it off" in str(run(folders, "--laser-dark", str(dark)))

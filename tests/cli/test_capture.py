"""``turnscan capture``: pictures that ``turnscan calibrate`` reads."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from turnscan.cli import turnscan
from turnscan.scan import read_picture

pytestmark = pytest.mark.slow

BENCH = "sim:cylinder?hand=charuco"
BOARD = "charuco:9x6:12:9:DICT_5X5_100"


def cli(*words: str | Path) -> Result:
    return CliRunner().invoke(turnscan, ["capture", *map(str, words)])


def names(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*.png"))


def test_pictures_are_numbered_on_and_say_what_was_found(tmp_path: Path) -> None:
    folder = tmp_path / "boards"
    common = ("--device", BENCH, "--board", BOARD)
    done = cli(folder, "--stage", "camera", *common, "--count", 2)
    assert done.exit_code == 0, done.output
    assert "camera 0001.png: 40 corners" in done.output
    assert "2 pictures, the board in 2;" in done.output
    done = cli(folder, "--stage", "camera", "--device", BENCH, "--board", "chessboard:13x11:9")
    assert "camera 0003.png: no chessboard of 13x11 inner corners" in done.output
    done = cli(folder, "--stage", "laser", *common)
    assert done.exit_code == 0, done.output
    done = cli(folder, "--stage", "table", *common, "--range-deg", "-10:10", "--count", 2)
    assert done.exit_code == 0, done.output
    assert names(folder) == [
        "camera/0001.png", "camera/0002.png", "camera/0003.png",
        "laser-right-dark/0001.png", "laser-right/0001.png",
        "table/0001.png", "table/0002.png",
    ]  # fmt: skip
    lit, dark = (read_picture(folder / f"laser-right{x}/0001.png") for x in ("", "-dark"))
    assert int((lit.astype(int) - dark).max()) > 30


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for words, said in (
        (("file", "--stage", "camera"), "is not a folder"),
        (
            ("x", "--stage", "camera", "--laser-name", "right"),
            "laser_name=right: only for stage table",
        ),
        (("x", "--stage", "camera", "--count", "0"), "0 pictures"),
        (("x", "--stage", "table", "--laser-name", "up"), "no laser 'up'"),
    ):
        done = cli(tmp_path / words[0], *words[1:], "--device", BENCH)
        assert said in str(done.exception), done.output
    assert not list(tmp_path.rglob("*.png"))

"""No verb writes over what it reads, or over a file of another kind."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from tests.formats.parts import torus
from turnscan.cli import turnscan
from turnscan.errors import ExportError, FormatError, InputError, TurnscanError
from turnscan.formats import export
from turnscan.rig import Camera, LaserSheet, Pose, Rig, rig_to_json, rotation_about
from turnscan.workflows import check_apart, check_output


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A folder with what a person has before a scan: pictures, a rig, meshes."""
    (tmp_path / "pics").mkdir()
    for k in range(4):
        frame = np.full((48, 64), 8, np.uint8)
        frame[8:40, 20 + 5 * k : 23 + 5 * k] = 200
        cv2.imwrite(str(tmp_path / "pics" / f"p{k}.tif"), frame)
    table = Pose(rotation_about([1, 0, 0], np.pi / 2), [0, 40, 400])
    sheet = LaserSheet("laser", [1, 0, 0.5], [0, 0, 400])
    rig = Rig(Camera(64, 48, 120, 120, 32, 24), (sheet,), table)
    (tmp_path / "rig.json").write_text(rig_to_json(rig))
    for name in ("e.ply", "x.stl"):
        (tmp_path / name).write_bytes(export(torus(12, 9), Path(name).suffix))
    (tmp_path / "letter.turnscan").write_text("Dear reader")
    with sqlite3.connect(tmp_path / "books.turnscan") as db:
        db.execute("CREATE TABLE books (title)")
    db.close()
    (tmp_path / "empty.turnscan").touch()
    return tmp_path


IMPORT = "import pics --angles step:90 --rig rig.json -o "
CALIBRATE = (
    "calibrate --camera pics --board chessboard:8x6:10 --laser pics --table pics "
    "--markers DICT_4X4_50:30 -o "
)


@pytest.mark.parametrize(
    ("words", "kind", "says"),
    [
        (IMPORT + "pics/p0.tif", InputError, "ends .turnscan"),
        (IMPORT + "rig.json", InputError, "ends .turnscan"),
        (IMPORT + "letter.turnscan", FormatError, "not a scan file"),
        (IMPORT + "books.turnscan", FormatError, "not a scan file"),
        (IMPORT + "empty.turnscan", FormatError, "not a scan file"),
        ("simulate cup --steps 2 -o letter.turnscan", FormatError, "not a scan file"),
        ("scan rig.json --camera sim:cup", InputError, "ends .turnscan"),
        ("compare e.ply x.stl --picture e.ply", InputError, "ends .png"),
        ("export e.ply --float32 -o e.ply", InputError, "is an input"),
        ("export e.ply -o a.stl -o pics/../e.ply", InputError, "is an input"),
        ("reconstruct letter.turnscan -o a.ply --rig rig.json --report rig.json",
         InputError, "is an input"),
        ("design --picture x.jpg", InputError, "ends .png"),
        (CALIBRATE + "pics/p1.tif", InputError, "ends .json"),
        (CALIBRATE + "a.json --report rig.json", InputError, "ends .html"),
    ],
)  # fmt: skip
def test_what_was_there_stays(
    desk: Path, monkeypatch: pytest.MonkeyPatch, words: str, kind: type[TurnscanError], says: str
) -> None:
    monkeypatch.chdir(desk)
    before = {p: p.read_bytes() for p in desk.rglob("*") if p.is_file()}
    result = CliRunner().invoke(turnscan, words.split())
    assert isinstance(result.exception, kind), (result.output, result.exception)
    assert says in str(result.exception)
    assert {p: p.read_bytes() for p in desk.rglob("*") if p.is_file()} == before


def test_an_own_scan_is_replaced(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    for angles in ("step:90", "step:-90"):
        words = f"import pics --angles {angles} -o a.turnscan"
        assert CliRunner().invoke(turnscan, words.split()).exit_code == 0


def test_a_link_to_an_input_is_that_input(tmp_path: Path) -> None:
    (tmp_path / "a.ply").touch()
    (tmp_path / "b.ply").symlink_to("a.ply")
    with pytest.raises(InputError, match="is an input"):
        check_output(tmp_path / "b.ply", (".ply",), [tmp_path / "a.ply"])
    check_output(tmp_path / "c.PLY", (".ply",), [tmp_path / "a.ply"])
    with pytest.raises(ExportError, match="no folder"):
        check_output(tmp_path / "no" / "c.ply", (".ply",))


def test_two_files_with_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="given twice as an output"):
        check_apart([tmp_path / "a.stl", tmp_path / "b.stl", tmp_path / "o" / ".." / "a.stl"])
    check_apart([tmp_path / "a.stl", tmp_path / "a.ply"])

"""Repairs recorded on one scan of the cup, listed, switched, and replayed on another scan of it."""

from __future__ import annotations

import json
import shutil
import sqlite3
import sys
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from turnscan import workflows
from turnscan.cli import main, turnscan
from turnscan.detection import Detection, detect_scan
from turnscan.edit import (
    Add,
    Close,
    Compact,
    Delete,
    DeletePoints,
    Document,
    Edit,
    Fill,
    HoleName,
    ProfileOff,
    Redetect,
    Region,
    action_to_json,
)
from turnscan.errors import InputError
from turnscan.formats import read_mesh
from turnscan.mesh import Mesh, is_closed
from turnscan.pipeline import build
from turnscan.progress import Progress
from turnscan.scan import Scan, rig_for
from turnscan.settings import Settings
from turnscan.surface.holes import holes

pytestmark = pytest.mark.slow

STEPS = "16"


def run(*arguments: Any) -> str:
    done = CliRunner().invoke(turnscan, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def refused(monkeypatch: pytest.MonkeyPatch, capsys: Any, *arguments: Any) -> str:
    """What the door says, in one line."""
    monkeypatch.setattr(sys, "argv", ["turnscan", *map(str, arguments)])
    with pytest.raises(SystemExit):
        main()
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    return str(said)


class Worker:
    """Repairs a scan as the browser does: a document, and each action into the file."""

    def __init__(self, path: Path) -> None:
        self.scan = Scan.resume(path)
        self.seen: list[Detection] = detect_scan(self.scan, rig_for(self.scan), Settings().stripes)
        self.document = Document.open(self.build)

    def build(self, edits: Any, progress: Progress) -> Any:
        done = build(self.seen, Settings(), edits, progress)
        return done.mesh, done.findings

    def make(self, edit: Edit) -> None:
        self.document, change = self.document.add(edit)
        assert [f for f in change.findings if f.code.startswith("edit.")] == []
        self.scan.append_edit(action_to_json(change.action), 1e9)

    def near(self, centre: tuple[float, float, float], radius: float) -> np.ndarray:
        away = self.document.body.mesh.triangles.mean(axis=1) - centre
        return np.flatnonzero((np.linalg.norm(away, axis=1) < radius) & self.document.body.alive)

    def mesh(self) -> Mesh:
        return Compact.of(self.document.body).mesh


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The cup with its repairs, and the cup scanned again, with another seed."""
    folder = tmp_path_factory.mktemp("cups")
    for seed in (1, 2):
        run("simulate", "cup", "--steps", STEPS, "--seed", seed, "-o", folder / f"{seed}.turnscan")
    worker = Worker(folder / "1.turnscan")
    worker.make(DeletePoints("right", 5, tuple(range(200, 203))))
    worker.make(Redetect("right", (10, 11), (0, 2000), strategy="centroid"))
    worker.make(Delete(Region.of(worker.document.body, worker.near((30.0, 10.0, 40.0), 14.0))))
    wound = min(holes(worker.mesh()), key=lambda h: np.linalg.norm(h.centre - (30, 10, 40)))
    worker.make(Fill((HoleName.of(wound),)))
    worker.make(Close())
    assert is_closed(worker.mesh())
    worker.scan.close()
    return folder / "1.turnscan", folder / "2.turnscan"


@pytest.fixture
def repaired(scans: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copy(scans[0], tmp_path / "repaired.turnscan"))


def mesh_of(*arguments: Any) -> tuple[Mesh, str]:
    path = Path(arguments[0]).with_suffix(".ply")
    said = run("reconstruct", *arguments, "-o", path)
    return read_mesh(path.read_bytes(), ".ply"), said


def test_a_scan_is_reconstructed_with_its_own_edits(repaired: Path) -> None:
    mesh, said = mesh_of(repaired)
    assert is_closed(mesh)
    assert "edit." not in said
    bare, _ = mesh_of(repaired, "--edits", "none")
    assert not is_closed(bare)
    run("edits", repaired, "--off", 5)
    opened, _ = mesh_of(repaired)
    assert not is_closed(opened)
    assert mesh.volume == pytest.approx(267e3, rel=0.02)


def test_replayed_on_another_scan_the_edits_give_a_watertight_cup(
    scans: tuple[Path, Path], tmp_path: Path
) -> None:
    first, second = scans
    other = Path(shutil.copy(second, tmp_path / "again.turnscan"))
    assert not is_closed(mesh_of(other)[0]), "without edits it is open"
    mesh, said = mesh_of(other, "--edits", first)
    assert is_closed(mesh)
    assert "edit." not in said, "every edit found its place"
    own, _ = mesh_of(Path(shutil.copy(first, tmp_path / "own.turnscan")))
    assert len(mesh.faces) == pytest.approx(len(own.faces), rel=0.03)
    assert mesh.volume == pytest.approx(own.volume, rel=0.005)
    # The wound was filled, not left to be closed at the end: the file of edits says the same.
    run("edits", first, "-o", tmp_path / "cup.json")
    same, _ = mesh_of(other, "--edits", tmp_path / "cup.json")
    assert same.vertices.tobytes() == mesh.vertices.tobytes()
    assert same.faces.tobytes() == mesh.faces.tobytes()
    # And once they are added to the scan, it needs no word about them.
    part = Path(shutil.copy(other, tmp_path / "part.turnscan"))
    assert "make watertight" in run("edits", part, "--add", first, "--only", 5)
    assert len(run("edits", part, "--add", first, "--only", 1, "--only", 2).splitlines()) == 3
    run("edits", other, "--add", tmp_path / "cup.json")
    assert mesh_of(other)[0].vertices.tobytes() == mesh.vertices.tobytes()


def test_the_list_tells_what_was_done_and_the_file_embeds_it(repaired: Path) -> None:
    lines = run("edits", repaired).splitlines()
    assert [line.split("  ")[-1].strip() for line in lines] == [
        "delete 3 points of step 5, laser right",
        "detect steps 10–11, lines 0–2000 of right again (centroid)",
        lines[2].split("  ")[-1].strip(),
        lines[3].split("  ")[-1].strip(),
        "make watertight",
    ]
    assert "delete" in lines[2]
    assert "fill a hole of" in lines[3]
    report = repaired.with_suffix(".json")
    mesh_of(repaired, "--report", report)
    progress = json.loads(report.read_text())
    assert progress["edits"][4] == "5: make watertight"
    assert len(progress["edits_sha256"]) == 64
    assert "5 edits" in run("check", repaired)
    run("edits", repaired, "--undo")
    run("edits", repaired, "--off", 1)
    shown = run("edits", repaired).splitlines()
    assert "undone" in shown[4]
    assert "done, off" in shown[0]
    assert json.loads(run("check", repaired, "--json"))["edits"] == 3
    run("edits", repaired, "--on", 1, "--redo")
    assert json.loads(run("check", repaired, "--json"))["edits"] == 5


def test_edits_have_names_any_is_gone_to_and_those_that_do_not_fit_are_named(
    repaired: Path, scans: tuple[Path, Path], tmp_path: Path
) -> None:
    run("edits", repaired, "--name", 5, "tight", "--to", 2)
    lines = run("edits", repaired, "--make", '{"kind": "measure_volume"}').splitlines()
    assert [line.split()[0] for line in lines] == ["1", "2", "6", "branch", "3", "4", "5"]
    assert lines[3] == "branch after edit 2"
    assert "tight: make watertight" in lines[6]
    shown = run("edits", repaired, "--to", 5).splitlines()
    assert [line.split()[0] for line in shown] == ["1", "2", "3", "4", "5", "branch", "6"]
    # A hole that the other scan has nowhere is named; the edit is added all the same.
    hole = '{"kind": "fill", "holes": [{"centre": [500, 0, 0], "size": 3}], "how": "flat"}'
    run("edits", repaired, "--make", hole)
    other = Path(shutil.copy(scans[1], tmp_path / "unlike.turnscan"))
    said = run("edits", other, "--add", repaired, "--only", 7, "--check")
    assert "edit 1 (fill)" in said
    assert said.splitlines()[-1].split()[0] == "1"
    with pytest.raises(InputError, match="no edits are added that could fit"):
        workflows.edits(other, workflows.EditChanges(check=True))


def test_an_edit_that_finds_nothing_is_named_and_the_rest_is_done(repaired: Path) -> None:
    worker_edits = [
        Fill((HoleName((0.0, 0.0, 300.0), 5.0),)),
        ProfileOff("right", (900, 901)),
        ProfileOff("green", (0, 0)),
        DeletePoints("right", 3, (99_999,)),
    ]
    with Scan.resume(repaired) as scan:
        for number, edit in enumerate(worker_edits, start=6):
            scan.append_edit(action_to_json(Add(number, edit)))
    mesh, said = mesh_of(repaired)
    assert is_closed(mesh)
    for words in (
        "edit.nothing [edit 6 (fill)]: no hole of 5.00 mm near (0.00, 0.00, 300.00)",
        "edit.nothing [edit 7 (profile_off)]: laser right has no data there",
        "edit.nothing [edit 8 (profile_off)]: the scan has no laser 'green', only right",
        "edit.nothing [edit 9 (delete_points)]: laser right has no data there",
    ):
        assert words in said


def test_faces_are_chosen_and_edits_made_without_a_browser(
    repaired: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    def deleted(*asked: str) -> int:
        lines = run("edits", repaired, *asked).splitlines()
        words = list(takewhile(lambda line: not line.startswith("branch"), lines))[-1]
        run("edits", repaired, "--undo")
        return int(words.split("delete ")[1].split(" triangles")[0])

    run("edits", repaired, "--undo")
    whole = deleted("--delete", "laser=right")
    some = deleted("--delete", "steps=3-5")
    assert 0 < some < whole / 4
    assert some < deleted("--delete", "steps=3-5", "--grow", "2") < 2 * some
    assert some > deleted("--delete", "steps=3-5", "--grow", "-1")
    over_the_seam = deleted("--delete", "steps=14-1")
    assert some < over_the_seam < 2 * some
    wall = deleted("--delete", "crease=30,0,40,70", "--delete", "sigma=50")
    assert whole / 2 < wall <= deleted("--delete", "piece=30,0,40")
    for rule, words in {
        "sigma=99": "no face matches sigma=99",
        "sigma=wide": "expected a number after the =",
        "sigma=-1": "expected mm above 0 after the =",
        "sigma=0": "expected mm above 0 after the =",
        "steps=3": "expected 2 numbers after the =",
        "cause=magic": "one of laser, camera",
        "flag=ok": "one of dark",
        "pieces=2": "no face matches",
        "colour=red": "is not a rule",
    }.items():
        assert words in refused(monkeypatch, capsys, "edits", repaired, "--delete", rule)
    section = {"kind": "measure_section", "normal": [0, 0, 1], "distance": 40}
    run("edits", repaired, "--make", '{"kind":"close"}', "--make", json.dumps(section))
    _, said = mesh_of(repaired)
    progress = next(line for line in said.splitlines() if "edit.measured" in line)
    assert "mm, circle" in progress
    assert 60 < float(progress.split("]: ")[1].split(" ")[0]) < 80
    assert "kind" in refused(monkeypatch, capsys, "edits", repaired, "--make", '{"kind":"warp"}')
    said = refused(monkeypatch, capsys, "edits", repaired, "--make", "xx")
    assert "make: 'xx' is not JSON" in said
    assert 'give an edit like {"kind": "decimate", "faces": 20000}' in said


def test_bad_histories_are_refused_in_one_line(
    repaired: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    out = tmp_path / "x.stl"

    def why(edits: Any) -> str:
        said = refused(monkeypatch, capsys, "reconstruct", repaired, "--edits", edits, "-o", out)
        assert not out.exists()
        return said

    file = tmp_path / "e.json"
    assert "no such file" in why(file)
    assert "no such scan file" in why(tmp_path / "no.turnscan")
    for text, words in {
        '{"format":"turnscan-edits","version":4,"edits":[]}': "version 4; this turnscan knows",
        '{"format":"turnscan-edits","version":1,"edits":[],"x":1}': "edits",
        '{"format":"rig","version":1}': "format: not an edits file",
        '{"format":"turnscan-edits","version":1,"edits":[{"id":1,"on":true,"edit":'
        '{"kind":"warp"}}]}': "edits.0: edit: ",
        '{"format":"turnscan-edits","version":1,"edits":[{"id":1,"on":true,"edit":'
        '{"kind":"fill","largest":NaN}}]}': "NaN is not a number",
        '{"format":"turnscan-edits","version":1,"edits":[{"id":1,"on":true,"edit":'
        '{"kind":"fill","largest":-1}}]}': "edits.0: fill.largest",
        '{"format":"turnscan-edits","version":1,"edits":[{"id":1,"on":true,"edit":'
        '{"kind":"close","colour":"red"}}]}': "edits.0: close.colour",
    }.items():
        file.write_text(text)
        assert words in why(file)
    run("edits", repaired, "--off", 5)
    assert "there is no edit 77" in refused(monkeypatch, capsys, "edits", repaired, "--off", 77)
    with Scan.resume(repaired) as scan:
        scan.append_edit('{"version":9,"do":"bend"}')
    assert "version 9" in why("own")
    assert CliRunner().invoke(turnscan, ["check", str(repaired)]).exit_code == 1
    db = sqlite3.connect(repaired)
    db.execute("UPDATE edits SET edit = '{}' WHERE id = 2")
    db.commit()
    db.close()
    assert "entry 2 of its log of edits" in why("own")
    said = CliRunner().invoke(turnscan, ["check", str(repaired)])
    assert said.exit_code == 1
    assert "entry 2 of its log" in said.output
    run("reconstruct", repaired, "--edits", "none", "-o", out)

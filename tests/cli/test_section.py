"""``turnscan section``: drawings of real and simulated parts, and one clear line for bad input."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from click.testing import CliRunner

from tests.needs import needs_shared
from tests.shapes.outlines import along, regular, wall
from turnscan.cli import main, turnscan
from turnscan.formats import write_ply, write_stl


def _run(*args: object) -> str:
    done = CliRunner().invoke(turnscan, [str(a) for a in args], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hexagonal wall with sigma."""
    path = tmp_path_factory.mktemp("section") / "hexagon.ply"
    path.write_bytes(write_ply(wall(along(regular(6, 20.0), 0.5), np.linspace(0, 20, 21), 0.01)))
    return path


def test_ten_sections_go_into_one_file_of_each_kind(part: Path, tmp_path: Path) -> None:
    out = [tmp_path / f"s{suffix}" for suffix in (".dxf", ".svg", ".pdf", ".json")]
    said = _run(
        "section", part, "--plane", "z=2.25:17:2.1", "--plane", "1,1,0,2", "--half-plane-deg", 30,
        *(x for p in out for x in ("-o", p)),
    )  # fmt: skip
    assert said.count("section z = ") == 8
    assert "section half-plane at 30°" in said
    report = json.loads(out[3].read_text())
    assert len(report["sections"]) == 10
    for s in report["sections"][:8]:
        [outline] = s["outlines"]
        across = [x for x in outline["sizes"] if x["kind"] == "distance"]
        assert len(across) == 3
        for x in across:
            assert abs(x["distance_mm"] - 20 * np.sqrt(3)) < 4 * x["sigma_mm"]
            # Some 40 points a side, each known to 7 µm: 2 µm, and no better than they share noise.
            assert 0.0005 < x["sigma_mm"] < 0.004
    document = ezdxf.readfile(out[0])
    assert not document.audit().errors
    names = {e.dxf.layer for e in document.modelspace()}
    assert "TURNSCAN_SECTION_DIMENSIONS_MM" in names
    assert out[2].read_bytes().startswith(b"%PDF")
    assert out[1].read_text().count("<g id=") == 10


def test_r12_is_written_on_demand(part: Path, tmp_path: Path) -> None:
    _run("section", part, "--plane", "z=3", "--dxf-version", "R12", "-o", tmp_path / "s.dxf")
    assert ezdxf.readfile(tmp_path / "s.dxf").dxfversion == "AC1009"


@pytest.mark.parametrize(
    ("args", "text"),
    [
        (["--plane", "z=99"], "hexagon.ply: section z = 99 mm misses the part: the part reaches"),
        (["--plane", "z=3", "--tolerance", "0"], "--tolerance"),
        (["--plane", "z=3", "--tolerance", "-1"], "--tolerance"),
        (["--plane", "z=3", "--tolerance", "nan"], "finite"),
        (["--plane", "q=3"], "--plane q=3: not a plane"),
        (["--plane", "1,2,3"], "--plane 1,2,3: not a plane"),
        (["--plane", "0,0,0,1"], "a plane with the normal"),
        (["--silhouette", "q"], "--silhouette q: not a direction"),
        (["--silhouette", "0,0,0"], "--silhouette 0,0,0: not a direction"),
        (["--plane", "z=0:10:0"], "--plane z=0:10:0: not a plane"),
        (["--plane", "z=0:20:0.001"], "at most 100"),
        (["--plane", "z=inf"], "not finite"),
        (["--plane", "z=99", "--plane", "z=-5"], "none of 2 sections meets it: section z = 99 mm"),
        ([], "no section was asked for"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    args: list[str], text: str, part: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    _fails(["section", str(part), *args, "-o", str(tmp_path / "s.dxf")], text, monkeypatch, capsys)
    assert not list(tmp_path.iterdir())


def test_a_section_that_misses_is_named_and_the_others_are_drawn(
    part: Path, tmp_path: Path
) -> None:
    out = tmp_path / "s.json"
    done = CliRunner().invoke(
        turnscan, ["section", str(part), "--plane", "z=3:21:9", "-o", str(out)]
    )
    assert done.exit_code == 1
    assert [line.split(":")[0] for line in done.stderr.splitlines()] == [
        "error section.misses [hexagon.ply]"
    ]
    assert "section z = 21 mm misses the part: the part reaches from z = 0.000" in done.stderr
    names = [s["name"] for s in json.loads(out.read_text())["sections"]]
    assert names == ["z = 3 mm", "z = 12 mm"]
    assert f"{out}: 2 sections" in done.stdout


def _fails(
    args: list[str], text: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr("sys.argv", ["turnscan", *args])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert text in err


def test_bad_files_are_one_line(
    part: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud, broken = tmp_path / "cloud.xyz", tmp_path / "broken.stl"
    cloud.write_text("1 2 3\n4 5 6\n7 8 9\n")
    broken.write_bytes(b"solid nothing\n")
    out = str(tmp_path / "s.dxf")
    for source, target, text in (
        (cloud, out, "no faces"),
        (broken, out, "broken.stl"),
        (tmp_path / "absent.stl", out, "no such file"),
        (part, str(tmp_path / "s.step"), "ends .dxf or .svg or .pdf or .json"),
    ):
        _fails(["section", str(source), "--plane", "z=3", "-o", target], text, monkeypatch, capsys)
        assert not list(tmp_path.glob("s.*"))


@pytest.mark.slow
def test_the_plate_of_a_cad_file_has_its_holes(tmp_path: Path) -> None:
    """Its text says: 8 × 12 inches, corners and five holes of 0.266 inches."""
    data = needs_shared("parts")
    _run("section", data / "plate_holes.STL", "--plane", "z=6", "-o", tmp_path / "s.json")
    [s] = json.loads((tmp_path / "s.json").read_text())["sections"]
    assert s["found"] == {"lines": 4, "arcs": 4, "circles": 5, "splines": 0}
    holes = [p for o in s["outlines"] for p in o["pieces"] if p["kind"] == "circle"]
    assert np.allclose([2 * h["radius_mm"] for h in holes], 0.266 * 25.4, atol=1e-3)
    pieces = next(o["pieces"] for o in s["outlines"] if len(o["pieces"]) == 8)
    assert all(p["joint"] == "tangent" for p in pieces)


def test_stl_has_no_sigma_and_is_drawn_all_the_same(tmp_path: Path) -> None:
    source = tmp_path / "h.stl"
    source.write_bytes(write_stl(wall(regular(6, 20.0), np.array([0.0, 9.0]), None)))
    _run("section", source, "--plane", "z=4", "-o", tmp_path / "s.json")
    [s] = json.loads((tmp_path / "s.json").read_text())["sections"]
    assert s["found"]["lines"] == 6
    assert set(s["polylines"][0]["sigma_mm"]) == {None}


def test_a_scan_is_reconstructed_and_cut(tmp_path: Path) -> None:
    """A cylinder of 50 mm, in few steps: its section is a circle and nothing else."""
    scan, out = tmp_path / "cylinder.turnscan", tmp_path / "s.json"
    _run("simulate", "cylinder", "-o", scan, "--steps", 24, "--rig", "ciclop", "--no-speckle")
    said = _run("section", scan, "--plane", "z=20", "-o", out)
    assert "1 circle" in said
    [section] = json.loads(out.read_text())["sections"]
    [outline] = section["outlines"]
    [circle] = outline["pieces"]
    assert circle["kind"] == "circle"
    # A sheet of light as thick as the ciclop's makes round parts 0.05 mm smaller.
    assert -0.1 < 2 * circle["radius_mm"] - 50.0 < 0.02
    assert 0.001 < circle["radius_sigma_mm"] < 0.02

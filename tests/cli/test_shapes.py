"""``turnscan shapes``: what it prints and writes, and one clear line for bad input."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import turnscan as ts
from tests.shapes.solids import noisy, prism
from turnscan.cli import main, turnscan
from turnscan.formats import write_ply, write_stl
from turnscan.mesh import Mesh, Provenance
from turnscan.workflows import read_mesh_file


def _run(*args: object) -> str:
    done = CliRunner().invoke(turnscan, [str(a) for a in args], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The walls of a block of 40 × 30 mm."""
    path = tmp_path_factory.mktemp("shapes") / "block.ply"
    block = prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.8)
    path.write_bytes(write_ply(noisy(block, 0.02, 1)))
    return path


def test_a_block_is_told_coloured_and_reported(part: Path, tmp_path: Path) -> None:
    coloured, page, data = (tmp_path / n for n in ("c.ply", "r.html", "r.json"))
    said = _run("shapes", part, "-o", coloured, "--report", page, "--edges")
    assert said.count(": edge between normals 90.") + said.count(": edge between normals 89.") == 4
    assert "4 shapes on" in said
    assert said.count(": plane, normal") == 4
    sure = re.findall(r"normal \([^)]*\) ± (\S+)°", said)
    assert len(sure) == 4
    assert all(0 < float(x) < 0.1 and re.search(r"[1-9]\d$", x) for x in sure)
    assert "perpendicular (measured" in said
    assert said.count(": distance ") == 2
    colour = read_mesh_file(coloured).colour
    assert colour is not None
    scatter = []
    for path in (part, coloured):
        at = read_mesh_file(path).vertices[:, :2]
        scatter.append(float(at[np.hypot(*(at - (40, 30)).T) < 0.3].std(axis=0).max()))
    assert scatter[1] < 0.002 < 0.006 < scatter[0]  # the corner is one line
    assert len(np.unique(colour, axis=0)) in (4, 5)
    text = page.read_text()
    assert text.count("<img") == 2
    assert "Relations adopted" in text
    table = tmp_path / "r.csv"
    _run("shapes", part, "--report", table)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    quantities = sorted(r["quantity"] for r in rows)
    forms = 4 * ["flatness"] + 2 * ["parallelism"] + 2 * ["perpendicularity"]
    assert quantities == 4 * ["angle"] + 2 * ["distance"] + forms
    sides = [r for r in rows if r["quantity"] == "distance"]
    assert sorted(round(float(r["value"]), 1) for r in sides) == [30, 40]
    for row in sides:
        off = min(abs(float(row["value"]) - true) for true in (30, 40))
        assert off < 2 * float(row["expanded uncertainty k=2"]) < 0.02
    for row in rows:
        if row["quantity"] == "angle":  # square by adoption, so told as it was measured
            u = float(row["standard uncertainty"])
            assert abs(float(row["value"]) - 90) < 4 * u
            assert u > 1e-3
    said = _run("shapes", part, "--report", data, "--json", "--as-measured")
    figures = json.loads(said)
    assert figures == {k: v for k, v in json.loads(data.read_text()).items() if k != "findings"}
    assert figures["relations"] == []
    assert [s["kind"] for s in figures["shapes"]] == 4 * ["plane"]
    found = ts.find_shapes(part, as_measured=True)
    assert found.figures() == figures


def test_what_is_not_known_is_no_number_in_a_file(tmp_path: Path) -> None:
    cube = np.array([(x, y, z) for x in (0, 9) for y in (0, 9) for z in (0, 9)], dtype=float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])
    part, data, table = (tmp_path / n for n in ("cube.stl", "r.json", "r.csv"))
    part.write_bytes(write_stl(Mesh(cube, faces)))  # knows no sigma
    found = ts.measure(part, sizes=True)
    found.save_report(data)
    found.save_report(table)
    (whole,) = [d for d in json.loads(data.read_text())["dimensions"] if d["quantity"] == "volume"]
    assert whole["value"] == pytest.approx(729)
    assert whole["standard_uncertainty"] is None
    assert "nan" not in (data.read_text() + table.read_text()).lower()


def test_a_scanned_mesh_says_that_it_knows_its_noise_alone(tmp_path: Path) -> None:
    """What moves all points alike is known to the scan, and to the result of a reconstruction."""
    block = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 4.0), 0.02, 1)
    whole = np.arange(len(block.vertices), dtype=np.int32)
    origin = Provenance(np.full(len(whole), 0.02), 0 * whole, whole, whole, ("red",))
    scanned, plain = tmp_path / "scanned.ply", tmp_path / "plain.ply"
    scanned.write_bytes(write_ply(replace(block, provenance=origin)))
    plain.write_bytes(write_ply(block))
    (said,) = ts.measure(scanned, sphere=True).findings
    assert (said.code, said.severity, said.where) == ("measure.noise-alone", "note", str(scanned))
    assert ts.measure(plain, sphere=True).findings == ()


def _fails(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *args: object):
    monkeypatch.setattr("sys.argv", ["turnscan", *map(str, args)])
    with pytest.raises(SystemExit) as end:
        main()
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1, error
    return end.value.code, error


def test_bad_input_is_one_line(
    part: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loose = tmp_path / "loose.ply"
    loose.write_bytes(write_ply(Mesh(np.eye(3), np.zeros((0, 3), dtype=int))))
    junk = tmp_path / "junk.stl"
    junk.write_bytes(b"no mesh at all")
    for args, words in (
        ((loose,), "no faces"),
        ((junk,), "junk.stl"),
        ((tmp_path / "none.ply",), "none.ply"),
        ((tmp_path / "x.igs",), "x.igs: IGES is written, not read → export a .step"),
        ((part, "-o", tmp_path / "x.stl"), ".ply or .glb or .step or .stp"),
        ((part, "--report", tmp_path / "x.txt"), ".html or .pdf or .json or .csv"),
        ((part, "-o", part), "is an input"),
        ((part, "--tolerance", "0"), "--tolerance"),
    ):
        code, error = _fails(capsys, monkeypatch, "shapes", *args)
        assert code == 2, error
        assert words in error
    assert sorted(p.name for p in tmp_path.iterdir()) == ["junk.stl", "loose.ply"]


def test_all_freeform_is_said(tmp_path: Path) -> None:
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    outline = [
        (r * np.cos(a), r * np.sin(a)) for a, r in zip(t, 20 + 3 * np.sin(3 * t), strict=True)
    ]
    body = prism(outline, 30, 0.8)
    X = body.vertices * 1.0
    X[:, :2] *= (1 + 0.1 * np.sin(X[:, 2:] / 4)) * (1 + 0.02 * np.cos(X[:, :1] / 3))
    path = tmp_path / "vase.ply"
    path.write_bytes(write_ply(noisy(Mesh(X, body.faces), 0.02, 2)))
    assert "freeform: no shape" in _run("shapes", path)
    assert "freeform: no shape" in _run("measure", path)


@pytest.mark.parametrize("verb", ["measure", "shapes"])
def test_every_report_is_written(verb: str, part: Path, tmp_path: Path) -> None:
    """The last alone was, without a word."""
    table, data = tmp_path / "r.csv", tmp_path / "r.json"
    said = _run(verb, part, "--report", table, "--report", data)
    assert f"{table}: written" in said
    assert f"{data}: written" in said
    assert len(table.read_text().splitlines()) > 5
    assert json.loads(data.read_text())


def test_a_dimension_report_shows_each_feature(part: Path, tmp_path: Path) -> None:
    page, sheet, table, data = (tmp_path / f"m.{s}" for s in ("html", "pdf", "csv", "json"))
    said = _run("measure", part, "--report", page)
    assert "plane 1 to plane 2: " in said or "plane 1 to plane 3: " in said
    assert said.replace(f"{page}: written\n", "") == _run("measure", part)  # without options, too
    assert "distance" not in _run("measure", part, "--planes")
    text = page.read_text()
    assert text.count("<img") == 1 + len({*_features(_run("measure", part, "--report", table))})
    assert "U (k = 2)" in text
    assert ">nan<" not in text
    assert ">not known<" in text
    _run("measure", part, "--report", sheet)
    assert sheet.read_bytes().startswith(b"%PDF")
    _run("measure", part, "--report", data)
    rows = json.loads(data.read_text())["dimensions"]
    sides = sorted(r["value"] for r in rows if r["quantity"] == "distance")
    assert sides == pytest.approx([30, 40], abs=0.01)
    # The mesh file has no sigma, so that of its area is not known, and that is said.
    known = [r for r in rows if r["standard_uncertainty"] is not None]
    assert {r["quantity"] for r in rows if r not in known} == {"area"}
    assert all(r["expanded_uncertainty"] == 2 * r["standard_uncertainty"] for r in known)
    assert len(rows) == len(list(csv.DictReader(table.read_text().splitlines())))
    assert "shapes" in rows[0]


def _features(said: str) -> list[str]:
    lines = [line.split(": ")[0] for line in said.splitlines()]
    return [who for who in lines if who.startswith("plane ")]

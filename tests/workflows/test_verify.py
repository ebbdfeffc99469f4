"""``turnscan verify`` from files: values, history, drift, report, and what is refused."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.analytic import full_turn, make_rig, scan_shape, sphere
from tests.once import once
from turnscan.cli import turnscan
from turnscan.errors import FormatError, InputError, ScanCorrupt, ScanNewer
from turnscan.formats import export
from turnscan.mesh import Mesh
from turnscan.scan import Frame, Scan, ScanPlan, read_verifications
from turnscan.simulate import part
from turnscan.workflows import verification_history, verify

BAR = """
format = "turnscan-artefact"
version = 1
kind = "ball-bar"
name = "bar"
measured = "exact"
diameters_mm = 30.0
diameters_U_mm = 0.001
distance_mm = 100.0
distance_U_mm = 0.001
form_mm = 0.0
[limits_mm]
size = 0.02
distance = 0.03
"""


def write_bar(path: Path, seed: int, larger: float = 0.0) -> Path:
    """The mesh of a ball bar with noise of 10 µm, its balls larger by so many mm in radius."""
    whole = part("ball-bar").mesh
    v = whole.vertices.copy()
    for z in (20.0, 120.0):
        out = v - (0, 0, z)
        away = np.linalg.norm(out, axis=1)
        on = np.abs(away - 15) < 0.01
        grow = larger + 0.01 * np.random.default_rng(seed).standard_normal(len(v))
        v[on] += (out / np.maximum(away, 1)[:, None] * grow[:, None])[on]
    path.write_bytes(export(Mesh(v, whole.faces), ".ply"))
    return path


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(folder: Path) -> None:
        for seed in range(3):
            write_bar(folder / f"{seed}.ply", seed)
        write_bar(folder / "off.ply", 7, 0.05)
        (folder / "bar.toml").write_text(BAR)

    return once(tmp_path_factory, "verify", make)


def test_three_scans_pass_and_a_fourth_that_is_off_fails_and_rings(
    room: Path, tmp_path: Path
) -> None:
    history = tmp_path / "h.sqlite"
    good = verify(
        [room / f"{k}.ply" for k in range(3)], room / "bar.toml", time=1e9, history=history
    )
    assert good.passed
    values = {v.name: v for v in good.scans[0].values}
    assert abs(values["distance of the balls"].value) < 2 * values["distance of the balls"].expanded
    assert values["size of ball 1"].verdict == "pass"
    assert {v.name for v in good.repeated} >= {"repeatability of size of ball 1"}
    assert not any(t.alarm for t in good.trends)
    off = verify([room / "off.ply"], room / "bar.toml", time=2e9, history=history)
    assert not off.passed
    codes = [(f.code, f.severity) for f in off.findings]
    assert codes.count(("verify.limit", "error")) == 2
    rung = {t.name for t in off.trends if t.alarm}
    assert {"size of ball 1", "size of ball 2"} <= rung
    assert "distance of the balls" not in rung
    assert [len(r.figures) for r in read_verifications(history)] == [21, 7]


def test_the_command_writes_reports_and_says_1_where_a_limit_is_exceeded(
    room: Path, tmp_path: Path
) -> None:
    html, facts, png = (tmp_path / n for n in ("r.html", "r.json", "t.png"))
    words = ["verify", str(room / "0.ply"), "--artefact", str(room / "bar.toml")]
    more = ["--history", str(tmp_path / "h"), "--report", str(html), "--report", str(facts)]
    done = CliRunner().invoke(turnscan, [*words, *more, "--trend", str(png)])
    assert done.exit_code == 0, done.output
    assert "size of ball 1" in done.output
    assert "passed" in done.output
    body = json.loads(facts.read_text())
    assert body["passed"]
    assert len(body["scans"][0]["values"]) == 7
    assert body["scans"][0]["values"][2]["sigma_calibration_mm"] is None
    assert "no statement of conformity" in html.read_text()
    assert png.read_bytes().startswith(b"\x89PNG")
    tight = CliRunner().invoke(turnscan, [*words, "--limit", "form=0.001"])
    assert tight.exit_code == 1
    assert "verify.limit" in tight.output


def _files(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_bad_input_is_one_line_and_nothing_is_written(room: Path, tmp_path: Path) -> None:
    scan, bar = room / "0.ply", room / "bar.toml"
    cloud, plate, foreign, newer, damaged = (
        tmp_path / n for n in ("cloud.ply", "plate.stl", "other.sqlite", "newer", "damaged")
    )
    mesh = part("ball-bar").mesh
    cloud.write_bytes(export(Mesh(mesh.vertices, np.zeros((0, 3), np.int32)), ".ply"))
    plate.write_bytes(export(part("plate").mesh, ".stl"))
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(BAR.replace("= 30.0", "= -30.0"))
    with closing(sqlite3.connect(foreign)) as db, db:
        db.execute("CREATE TABLE t (x)")
    verify([scan], bar, time=1.0, history=newer)
    shutil.copy(newer, damaged)
    with closing(sqlite3.connect(newer)) as db, db:
        db.execute("PRAGMA user_version = 2")
    with closing(sqlite3.connect(damaged)) as db, db:
        db.execute("DROP TABLE figures")
    before = _files(tmp_path)
    cases = [
        (scan, wrong, None, {}, FormatError, "diameters_mm = -30.0"),
        (scan, bar, None, {"size": 0.0}, InputError, "limit size = 0 mm"),
        (scan, bar, None, {"flatness": 1.0}, InputError, "no test of a ball-bar"),
        (scan, bar, scan, {}, FormatError, "not a history of verifications"),
        (scan, bar, foreign, {}, FormatError, "not a history of verifications"),
        (scan, bar, newer, {}, ScanNewer, "version 2 of the history"),
        (scan, bar, damaged, {}, ScanCorrupt, "its tables are not those"),
        (scan, bar, tmp_path, {}, InputError, "a folder, not a history"),
        (cloud, bar, tmp_path / "new", {}, InputError, "no faces"),
        (plate, bar, tmp_path / "new", {}, InputError, "ball 1 of 30 mm was not found"),
        (tmp_path / "none.ply", bar, None, {}, InputError, "no such file"),
        (scan, tmp_path / "none.toml", None, {}, InputError, "no such file"),
        (bar, bar, None, {}, FormatError, "not a scan file"),
    ]
    for source, artefact, history, limits, error, said in cases:
        with pytest.raises(error) as e:
            verify([source], artefact, time=1.0, history=history, limits=limits)
        assert said in str(e.value), (said, str(e.value))
        assert "\n" not in str(e.value)
        assert _files(tmp_path) == before, said


def test_what_nobody_measured_is_said(room: Path, tmp_path: Path) -> None:
    nominal = tmp_path / "n.toml"
    nominal.write_text(BAR.replace('"exact"', '""'))
    done = verify([room / "0.ply"], nominal, time=1.0)
    assert "verify.nominal" in {f.code for f in done.findings}
    assert done.passed


@pytest.mark.slow
def test_the_modern_rig_within_its_limits_and_its_moved_laser_found_by_the_third_scan(
    tmp_path: Path,
) -> None:
    """Pictures of a ball bar, simulated with speckle, three steps of the table a scan."""
    from turnscan.simulate import (
        SimCamera,
        SimLasers,
        SimTurntable,
        Simulated,
        World,
        bench,
        spec_of,
    )
    from turnscan.workflows._scanning._simulated import plan_of, scan_into_file

    (tmp_path / "bar.toml").write_text(BAR)
    scans = []
    for k, moved in enumerate((0.0, 0.0, 0.05)):
        spec, faults = spec_of(f"sim:ball-bar?rig=modern&steps=3&seed={k}")
        made = bench(spec)
        rig = made.rig
        by = moved * rig.sheets[0].normal
        sheet = replace(rig.sheets[0], centre=rig.sheets[0].centre + by)
        beam = replace(made.beams[0], apex=made.beams[0].apex + by)
        moved_rig = replace(rig, sheets=(sheet,))
        world = World(replace(made, rig=moved_rig, beams=(beam,)), faults, None)
        seen = Simulated(spec, world, SimCamera(world), SimTurntable(world), SimLasers(world))
        scans.append(tmp_path / f"{k}.turnscan")
        scan_into_file(seen, plan_of(seen), scans[-1], "sparse")
    history = tmp_path / "h"
    for k, path in enumerate(scans):
        done = verify([path], tmp_path / "bar.toml", time=float(k), rig=rig, history=history)
        values = {v.name: v for v in done.scans[0].values}
        alarms = {t.name for t in done.trends if t.alarm}
        for v in values.values():
            print(f"scan {k + 1}: {v.name} {v.value:+.4f} ± {v.expanded:.4f} mm")
        if k < 2:
            assert abs(values["distance of the balls"].value) < 0.03
            assert abs(values["size of ball 1"].value) < 0.02
            assert abs(values["size of ball 2"].value) < 0.02
            assert done.passed
            assert not alarms
    assert {"size of ball 1", "size of ball 2"} <= alarms
    assert not done.passed


def test_a_history_is_read_by_artefact_and_rig(room: Path, tmp_path: Path) -> None:
    history = tmp_path / "h.sqlite"
    assert verification_history(history) == ()
    for time, name in ((1e9, "0"), (2e9, "off")):
        verify([room / f"{name}.ply"], room / "bar.toml", time=time, history=history)
    (one,) = verification_history(history)
    assert one.artefact == "bar"
    assert one.rig_key == ""
    assert len(one.trends) == 7
    assert all(t.times == (1e9, 2e9) for t in one.trends)
    assert all(len(t.values) == len(t.noise) == 2 for t in one.trends)


def test_what_is_wrong_with_the_points_of_a_scan_is_said_but_fails_nothing(tmp_path: Path) -> None:
    """Half a turn about a ball; the stripes are drawn."""
    rig, angles, columns = make_rig(elevation=0.1, lift=20.0), full_turn(24)[:12], np.arange(320)
    path, ball = tmp_path / "half.turnscan", tmp_path / "ball.toml"
    with Scan.create(path, ScanPlan(320, 240, "uint8", 1, ("L0",), 12, 12.0), rig) as scan:
        for k, s in enumerate(scan_shape(rig, sphere(20.0, (0.0, 0.0, 25.0)), angles)):
            at = np.nan_to_num(s.position, nan=-1e3)[:, None]
            light = 12 + 180 * np.exp(-0.5 * ((columns - at) / 1.5) ** 2)
            scan.add(Frame(k, "L0", light.astype(np.uint8), None, commanded=float(angles[k])))
    ball.write_text(
        'format = "turnscan-artefact"\nversion = 1\nkind = "sphere"\nname = "ball"\n'
        'measured = "exact"\ndiameter_mm = 40.0\ndiameter_U_mm = 0.001\nform_mm = 0.0\n'
    )
    found = verify([path], ball, time=0.0)
    [half] = [f for f in found.findings if f.code == "points.open-turn"]
    assert half.severity == "warning"
    assert half.where == "half.turnscan, laser L0"
    assert found.passed
    assert not any(f.severity == "note" for f in found.scans[0].findings)

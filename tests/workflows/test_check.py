"""`check` called from Python: what a scan or a mesh file holds, and what is wrong with it."""

from __future__ import annotations

import math
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from tests.formats.parts import torus
from turnscan.errors import FormatError, InputError
from turnscan.formats import export
from turnscan.mesh import Mesh
from turnscan.progress import Cancelled, Progress
from turnscan.scan import Frame, ScanPlan, replacing_scan
from turnscan.workflows import CheckedMesh, CheckedScan, check


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """Five steps, of which the third is missing and the last has no angle."""
    path = tmp_path / "a.turnscan"
    plan = ScanPlan(24, 16, "uint8", 1, ("left",), 5, threshold=5.0, keep="full")
    with replacing_scan(path, plan) as made:
        for step in (0, 1, 3, 4):
            lit = np.random.default_rng(step).integers(0, 255, (16, 24)).astype(np.uint8)
            angle = math.nan if step == 4 else math.radians(10.0 * step)
            made.add(Frame(step=step, laser="left", lit=lit, commanded=angle))
        made.add_missing(2, "left", "no picture", math.radians(20))
    return path


def test_what_a_scan_holds(scan: Path) -> None:
    reports: list[tuple[float, str]] = []
    done = check(scan, Progress(lambda fraction, text: reports.append((fraction, text))))
    assert isinstance(done, CheckedScan)
    assert (done.path, done.complete, done.closed, done.damaged) == (scan, True, True, False)
    assert (done.rig, done.edits, done.raw_bytes) == (None, 0, 4 * 16 * 24)
    left = done.lasers["left"]
    assert (left.frames, left.missing) == (4, {"2": "no picture"})
    assert left.step_deg == pytest.approx(10)
    assert (left.first_deg, left.last_deg) == (pytest.approx(0), pytest.approx(30))
    assert [f.code for f in done.findings] == ["scan.missing-step", "scan.no-angle"]
    remedy = done.findings[1].remedy
    assert not isinstance(remedy, str)
    assert [option.name for option in remedy.options] == ["angles"]
    assert reports[-1] == (pytest.approx(1.0), "checking")


def test_a_damaged_scan_is_no_error_of_the_check(scan: Path) -> None:
    db = sqlite3.connect(scan)
    (payload,) = db.execute("SELECT payload FROM frames WHERE step = 1").fetchone()
    altered = payload[:-1] + bytes([payload[-1] ^ 1])
    db.execute("UPDATE frames SET payload = ? WHERE step = 1", (altered,))
    db.commit()
    db.close()
    done = check(scan)
    assert isinstance(done, CheckedScan)
    assert done.damaged
    assert "scan.damaged" in [f.code for f in done.findings]


def test_what_a_mesh_holds(tmp_path: Path) -> None:
    part = torus(20, 12)
    (tmp_path / "a.ply").write_bytes(export(part, ".ply"))
    done = check(tmp_path / "a.ply")
    assert isinstance(done, CheckedMesh)
    assert (done.faces, done.closed, done.findings) == (len(part.faces), True, ())
    assert done.volume_mm3 == pytest.approx(part.volume)
    (tmp_path / "b.ply").write_bytes(export(Mesh(part.vertices, part.faces[1:]), ".ply"))
    assert [f.code for f in check(tmp_path / "b.ply").findings] == ["surface.open"]


def test_what_is_no_scan_and_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("words")
    with pytest.raises(FormatError) as caught:
        check(tmp_path / "a.txt")
    assert "name a scan file, or a mesh" in str(caught.value)
    (tmp_path / "a.xyz").write_bytes(export(torus(20, 12), ".xyz"))
    with pytest.raises(FormatError, match=r"a\.xyz: holds points, and no faces to check → name"):
        check(tmp_path / "a.xyz")
    (tmp_path / "a.stp").write_text("ISO-10303-21;")
    with pytest.raises(FormatError, match=r"a\.stp: holds curved surfaces, and no faces to check"):
        check(tmp_path / "a.stp")
    (tmp_path / "a.stl").write_text("words")
    for name in ("a.stl", "none.stl"):
        with pytest.raises(InputError):
            check(tmp_path / name)


def test_cancelled(scan: Path) -> None:
    with pytest.raises(Cancelled):
        check(scan, Progress(cancelled=lambda: True))

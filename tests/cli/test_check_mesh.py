"""``turnscan check`` of a mesh."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.formats.parts import torus
from turnscan.cli._check import verb
from turnscan.formats import audit, export
from turnscan.mesh import Mesh, join


def check(path: Path, mesh: Mesh) -> tuple[int, dict[str, object], str]:
    path.write_bytes(export(mesh, path.suffix))
    found = CliRunner().invoke(verb, [str(path), "--json"])
    told = CliRunner().invoke(verb, [str(path)])
    assert told.exit_code == found.exit_code
    return found.exit_code, json.loads(found.stdout), told.stdout


def test_a_sound_mesh_and_others(tmp_path: Path) -> None:
    part = torus(20, 12)
    code, report, told = check(tmp_path / "a.stl", part)
    assert (code, report["closed"], report["findings"]) == (0, True, [])
    assert report["volume_mm3"] == pytest.approx(part.volume, rel=1e-5)
    assert "sound: closed" in told
    code, report, told = check(tmp_path / "b.ply", Mesh(part.vertices, part.faces[1:]))
    assert (code, report["closed"]) == (1, False)
    assert "surface.open" in told
    twice = join([part, Mesh(part.vertices + (3.0, 0.1, 0.2), part.faces)])
    code, _, told = check(tmp_path / "c.obj", twice)
    assert code == 1
    assert "surface.crossing" in told


def test_an_stl_says_that_it_cannot_tell_what_was_measured(tmp_path: Path) -> None:
    part = torus(20, 12)
    real = np.arange(len(part.faces)) % 4 > 0
    part = replace(part, measured=real)
    _, report, told = check(tmp_path / "a.stl", part)
    assert report["faces_not_measured"] is None
    assert "STL cannot mark the measured faces" in told
    (remark,) = audit(export(part, ".stl"), part, ".stl")
    assert remark.code == "export.unmarked"
    assert remark.message.startswith(f"{(~real).sum()} faces")
    for suffix in (".ply", ".obj", ".3mf", ".dxf"):
        _, report, _ = check(tmp_path / f"a{suffix}", part)
        assert report["faces_not_measured"] == (~real).sum()
        assert not [
            f for f in audit(export(part, suffix), part, suffix) if f.code.startswith("export.un")
        ]

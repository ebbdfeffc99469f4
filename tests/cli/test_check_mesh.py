"""``turnscan check`` of a mesh."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.export.parts import torus
from turnscan.cli._check import verb
from turnscan.export import export
from turnscan.surface import Mesh, join


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

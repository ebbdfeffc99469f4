"""``turnscan revolve`` from a mesh to a drawing, a solid and a report."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from click.testing import CliRunner

from tests.needs import needs
from tests.shapes.solids import noisy, turned
from turnscan import workflows
from turnscan.cli import turnscan
from turnscan.drawings import read_step
from turnscan.errors import ExportError
from turnscan.formats import export
from turnscan.mesh import Mesh

CUP = [(0.5, 4), (18, 4), (20, 50), (24, 50), (22, 0)]
COARSE = 1.0
"""mm of facets where only solids and volume are asked, which the faces themselves tell."""


@pytest.fixture(scope="module")
def cup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cup, its wall from the inside of its bottom over the rim to the foot."""
    path = tmp_path_factory.mktemp("revolve") / "cup.ply"
    path.write_bytes(export(noisy(turned(CUP[::-1], 0.8, 120), 0.03, 1), ".ply"))
    return path


def test_a_cup_becomes_a_drawing_a_solid_and_a_report(cup: Path) -> None:
    needs("OpenCASCADE")
    names = ["half.dxf", "half.svg", "solid.step", "report.pdf"]
    dxf, svg, step, report = (cup.with_name(n) for n in names)
    asked = ["revolve", str(cup), "-o", str(dxf), "-o", str(svg), "-o", str(step)]
    done = CliRunner().invoke(turnscan, [*asked, "--report", str(report), "--height", "20"])
    assert done.exit_code == 0, done.output
    assert "a valid solid" in done.output
    drawn = ezdxf.readfile(dxf)
    assert not drawn.audit().errors
    assert len(drawn.modelspace().query('LINE[layer=="TURNSCAN_SECTION_FITTED_MM"]')) >= 4
    assert "⌀" in svg.read_text()
    part = read_step(step.read_bytes(), COARSE)
    assert part.valid
    true = 3.14159265 / 3 * (50 * (22**2 + 22 * 24 + 24**2) - 46 * (18**2 + 18 * 20 + 20**2))
    assert part.volume == pytest.approx(true, rel=2e-3)
    assert report.read_bytes().startswith(b"%PDF")
    told = CliRunner().invoke(turnscan, ["revolve", str(cup), "--json", "--height", "20"])
    figures = json.loads(told.stdout)
    assert {r["hollow"] for r in figures["roundness"]} == {False, True}
    assert all(abs(r["height"] - 20) < 1e-6 for r in figures["roundness"])


def test_a_ring_and_a_plate_become_what_they_are_or_nothing(tmp_path: Path) -> None:
    needs("OpenCASCADE")
    t = np.linspace(0, 2 * np.pi, 61)
    strip = turned([(20 + 4 * np.cos(a), 4 * np.sin(a)) for a in t], 0.42, 160)
    last = len(strip.vertices) - 160
    ring = noisy(Mesh(strip.vertices[:last], strip.faces % last), 0.02, 1)
    plate = noisy(turned([(60, 0), (60, 3), (0.5, 3)], 1.5, 90), 0.01, 1)
    made, drawn, data = (tmp_path / n for n in ("ring.step", "plate.step", "plate.json"))
    found = workflows.revolve(_written(tmp_path / "ring.ply", ring))
    found.save(made)
    part = read_step(made.read_bytes(), COARSE)
    assert part.volume == pytest.approx(2 * np.pi**2 * 20 * 4**2, rel=0.02)
    flat = workflows.revolve(_written(tmp_path / "plate.ply", plate))
    with pytest.raises(ExportError, match="encloses nothing"):
        flat.save(drawn)
    assert not drawn.exists()
    flat.save_report(data)
    assert "NaN" not in data.read_text()


def _written(path: Path, mesh: Mesh) -> Path:
    path.write_bytes(export(mesh, ".ply"))
    return path


def test_what_cannot_be_is_one_line(cup: Path) -> None:
    done = CliRunner().invoke(turnscan, ["revolve", str(cup), "--height", "200"])
    assert done.exit_code
    assert "height 200 mm: the part reaches from 0 to 50" in str(done.exception)
    done = CliRunner().invoke(turnscan, ["revolve", str(cup), "-o", "part.stl"])
    assert done.exit_code
    assert ".dxf or .svg" in str(done.exception)

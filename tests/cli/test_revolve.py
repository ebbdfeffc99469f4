"""``turnscan revolve`` from a mesh to a drawing, a solid and a report."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import pytest
from click.testing import CliRunner

from tests.needs import needs
from tests.shapes.solids import noisy, turned
from turnscan.cli import turnscan
from turnscan.drawings import read_step
from turnscan.formats import export

CUP = [(0.5, 4), (18, 4), (20, 50), (24, 50), (22, 0)]


@pytest.fixture(scope="module")
def cup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cup, its wall from the inside of its bottom over the rim to the foot."""
    path = tmp_path_factory.mktemp("revolve") / "cup.ply"
    path.write_bytes(export(noisy(turned(CUP[::-1], 0.8, 120), 0.01, 1), ".ply"))
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
    part = read_step(step.read_bytes())
    assert part.valid
    true = 3.14159265 / 3 * (50 * (22**2 + 22 * 24 + 24**2) - 46 * (18**2 + 18 * 20 + 20**2))
    assert part.volume == pytest.approx(true, rel=2e-3)
    assert report.read_bytes().startswith(b"%PDF")
    told = CliRunner().invoke(turnscan, ["revolve", str(cup), "--json", "--height", "20"])
    figures = json.loads(told.stdout)
    assert {r["hollow"] for r in figures["roundness"]} == {False, True}
    assert all(abs(r["height"] - 20) < 1e-6 for r in figures["roundness"])


def test_what_cannot_be_is_one_line(cup: Path) -> None:
    done = CliRunner().invoke(turnscan, ["revolve", str(cup), "--height", "200"])
    assert done.exit_code
    assert "height 200 mm: the part reaches from 0 to 50" in str(done.exception)
    done = CliRunner().invoke(turnscan, ["revolve", str(cup), "-o", "part.stl"])
    assert done.exit_code
    assert ".dxf or .svg" in str(done.exception)

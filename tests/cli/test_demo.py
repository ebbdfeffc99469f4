"""The demo, short: every file is there, and the report carries its pictures itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from turnscan.cli import turnscan

pytestmark = pytest.mark.slow


def test_demo_from_end_to_end(tmp_path: Path) -> None:
    out = tmp_path / "demo-output"
    result = CliRunner().invoke(turnscan, ["demo", "-o", str(out), "--steps", "12"])
    assert result.exit_code == 0, result.output
    names = {p.name for p in out.iterdir()}
    files = {f"cup.{s}" for s in ("turnscan", "dxf", "stl", "ply")}
    pictures = {f"{s}.png" for s in ("frame", "stripe", "grid", "mesh", "quality", "deviation")}
    assert names == files | pictures | {"rig.json", "report.html"}
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") >= 6
    assert 'src="http' not in page
    assert "deviation from the true shape, measured with the true rig" in result.output
    assert "no error of a calibration" in page
    assert "quality map: the 20% of the points" in page
    assert "quality map: the 20% of the points" in result.output
    # What the run says about itself must be near the truth: the stripe noise is about 0.09 mm.
    rms = float(result.output.split("rms ")[1].split(" mm")[0])
    assert 0.04 < rms < 0.2
    # Once more over what is there; that needs no whole turn.
    again = CliRunner().invoke(turnscan, ["demo", "-o", str(out), "--steps", "4"])
    assert again.exit_code == 0, again.output

"""``turnscan compare`` from the command line's side."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from turnscan.cli._compare import verb
from turnscan.errors import FormatError, InputError
from turnscan.formats import export
from turnscan.mesh import Mesh


def _sheet(height: float, size: float = 10.0) -> Mesh:
    v = np.array([[0, 0, height], [size, 0, height], [size, size, height], [0, size, height]])
    return Mesh(v, np.array([[0, 1, 2], [0, 2, 3]]))


def _write(folder: Path, name: str, mesh: Mesh) -> str:
    path = folder / name
    path.write_bytes(export(mesh, path.suffix))
    return str(path)


def test_figures_of_a_sheet_above_another(tmp_path: Path) -> None:
    low, half = _sheet(0.0), _sheet(0.1, 10.0)
    half = Mesh(half.vertices * (0.5, 1, 1), half.faces)
    args = [_write(tmp_path, "got.ply", half), _write(tmp_path, "truth.stl", low), "--json"]
    done = CliRunner().invoke(verb, [*args, "--tolerance", "0.11"], catch_exceptions=False)
    figures = json.loads(done.stdout)
    assert figures["mean_mm"] == pytest.approx(0.1, abs=1e-6)
    assert figures["rms_mm"] == pytest.approx(0.1, abs=1e-6)
    row = figures["tolerances"][0]
    assert row["precision"] == 1.0
    # Half of the reference lies below the measured half, and a strip of √(0.11² − 0.1²) more.
    assert row["completeness"] == pytest.approx(0.5 + np.sqrt(0.11**2 - 0.1**2) / 10, abs=2e-3)
    assert row["f_score"] == pytest.approx(
        2 * row["completeness"] / (1 + row["completeness"]), abs=1e-9
    )


def test_units_are_the_users_word(tmp_path: Path) -> None:
    in_m = _sheet(0.0)
    in_m = Mesh(in_m.vertices / 1000, in_m.faces)
    args = [_write(tmp_path, "mm.ply", _sheet(0.0)), _write(tmp_path, "m.ply", in_m)]
    done = CliRunner().invoke(verb, [*args, "--reference-unit", "m", "--json"])
    assert json.loads(done.stdout)["rms_mm"] < 1e-6


def test_picture_is_written(tmp_path: Path) -> None:
    args = [_write(tmp_path, "a.ply", _sheet(0.1)), _write(tmp_path, "b.ply", _sheet(0.0))]
    out = tmp_path / "map.png"
    CliRunner().invoke(verb, [*args, "--picture", str(out)], catch_exceptions=False)
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_missing_file_and_a_text_file_are_named(tmp_path: Path) -> None:
    good = _write(tmp_path, "a.ply", _sheet(0.1))
    with pytest.raises(InputError, match=r"none\.stl"):
        CliRunner().invoke(verb, [good, str(tmp_path / "none.stl")], catch_exceptions=False)
    text = tmp_path / "text.ply"
    text.write_text("not a mesh")
    with pytest.raises(FormatError, match=r"text\.ply"):
        CliRunner().invoke(verb, [good, str(text)], catch_exceptions=False)


def test_what_was_not_measured_or_lies_off_an_open_reference_does_not_count(tmp_path: Path) -> None:
    """A sheet 0.1 mm above, going on beyond the reference, with a filled face far away."""
    wide = _sheet(0.1, 20.0)
    vertices = np.concatenate([wide.vertices, _sheet(0.1).vertices[2:3], [[5.0, 5.0, 9.0]]])
    part = Mesh(
        vertices,
        np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 1, 5]]),
        measured=np.array([True, True, True, True, False]),
    )
    args = [_write(tmp_path, "got.ply", part), _write(tmp_path, "truth.stl", _sheet(0.0))]
    figures = json.loads(CliRunner().invoke(verb, [*args, "--json"]).stdout)
    # The corner at the origin and the one above the reference's far corner are left.
    assert figures["vertices"] == 2
    assert figures["max_mm"] == pytest.approx(0.1, abs=1e-6)

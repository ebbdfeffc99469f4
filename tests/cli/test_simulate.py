"""`turnscan simulate`: what it writes, and one clear line for what cannot be simulated."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from turnscan.cli import main
from turnscan.errors import InputError
from turnscan.formats import write_stl
from turnscan.simulate import SimulationSpec, bench, check_view, part


@dataclass(frozen=True)
class Done:
    exit_code: int
    output: str


Simulate = Callable[..., Done]


@pytest.fixture
def simulate(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Simulate:
    """The verb through the door, where errors become one line."""

    def run(*arguments: str | Path) -> Done:
        monkeypatch.setattr(sys, "argv", ["turnscan", "simulate", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as e:
            code = int(e.code or 0)
        said = capsys.readouterr()
        return Done(code, said.err if code else said.out + said.err)

    return run


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no-such-part"], "no scene 'no-such-part'"),
        (["missing.stl"], "no such file"),
        (["cup", "--rig", "none"], "no rig 'none'"),
        (["cup", "--theta-deg", "0"], "theta 0"),
        (["cup", "--theta-deg", "95"], "theta 95"),
        (["cup", "--exposure", "-1"], "exposure -1"),
        (["cup", "--exposure", "0"], "exposure 0"),
        (["cup", "--steps", "0"], "0 steps"),
        (["cup", "--lasers", "3"], "3 lasers"),
        (["sim:cup?x=500"], "larger than the field of view"),
        (["sim:cup?galvo=0"], "galvanometer 0"),
        (["sim:cup?colour=red"], "no key 'colour'"),
        (["sim:cup?seed=x"], "not a value for seed"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    tmp_path: Path, simulate: Simulate, arguments: list[str], words: str
) -> None:
    out = tmp_path / "out.turnscan"
    result = simulate(*arguments, "-o", out)
    assert result.exit_code != 0
    assert words in result.output
    assert "Traceback" not in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert not any(tmp_path.iterdir())


def test_a_mesh_without_faces_is_refused(tmp_path: Path, simulate: Simulate) -> None:
    empty = tmp_path / "empty.stl"
    empty.write_bytes(b"\0" * 80 + struct.pack("<I", 0))
    result = simulate(empty, "-o", tmp_path / "out.turnscan")
    assert result.exit_code != 0
    assert "no triangles" in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["empty.stl"]


def test_a_laser_that_never_hits_the_axis_is_refused() -> None:
    made = bench(SimulationSpec("sphere"))
    beam = made.beams[0]
    away = replace(beam, apex=beam.apex + 80.0 * made.rig.sheets[0].normal)
    sheet = replace(
        made.rig.sheets[0],
        centre=made.rig.sheets[0].centre + 80.0 * np.asarray(made.rig.sheets[0].normal),
    )
    moved = replace(made, rig=replace(made.rig, sheets=(sheet,)), beams=(away,))
    with pytest.raises(InputError, match="never hits the rotation axis"):
        check_view(moved)


def test_a_mesh_file_is_photographed_into_a_folder(tmp_path: Path, simulate: Simulate) -> None:
    stl = tmp_path / "ball.stl"
    stl.write_bytes(write_stl(part("sphere").mesh))
    out = tmp_path / "pictures"
    result = simulate(stl, "-o", out, "--steps", "2")
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {"dark", "right", "angles.csv", "rig.json"}
    lit, dark = (
        np.asarray(Image.open(out / name / "step_0000.png"), dtype=float)
        for name in ("right", "dark")
    )
    assert lit.shape == (480, 640)
    assert (lit - dark).max() > 60  # the stripe stands out
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    again = simulate(stl, "-o", out, "--steps", "2")
    assert again.exit_code != 0
    assert "not an empty folder" in again.output
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before

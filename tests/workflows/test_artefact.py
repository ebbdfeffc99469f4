"""``turnscan artefact``: what is printed has the size it says, and its file is read by verify."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from turnscan.calibrate import detect_board, parse_board
from turnscan.cli import turnscan
from turnscan.errors import InputError
from turnscan.formats import read_mesh
from turnscan.mesh import is_closed, sample_surface
from turnscan.shapes.verification import Survey, artefact_from_text, values_of
from turnscan.workflows import TARGET, artefact

PIXEL = 25.4 / 300
"""mm of the PNG's pixels."""


@pytest.mark.parametrize("board", [TARGET, "charuco:7x5:25:19:DICT_4X4_50"])
def test_a_target_is_found_and_to_scale_to_a_pixel(board: str) -> None:
    (data,) = artefact("target", board=board, sheet="png").values()
    picture = np.asarray(Image.open(io.BytesIO(data)).convert("L"))
    assert sorted(picture.shape) == pytest.approx([210.0 / PIXEL, 297.0 / PIXEL], abs=1)
    view = detect_board(picture, parse_board(board), "target")
    assert len(view.ids) == len(view.board.points)
    flat = view.points[:, :2] - view.points[:, :2].mean(axis=0)
    seen = (view.corners - view.corners.mean(axis=0)) * PIXEL
    assert np.abs(seen - flat).max() < PIXEL


@pytest.mark.parametrize("sheet", ["pdf", "svg"])
def test_sheets_have_the_size_of_the_paper_and_are_the_same_each_time(sheet: str) -> None:
    first = artefact("target", sheet=sheet)  # type: ignore[arg-type]
    assert first == artefact("target", sheet=sheet)  # type: ignore[arg-type]
    (data,) = first.values()
    if sheet == "pdf":
        box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", data)
        assert box is not None
        points = [float(x) / 72 * 25.4 for x in box.groups()]
    else:
        found = re.search(rb'width="([\d.]+)pt" height="([\d.]+)pt"', data)
        assert found is not None
        points = [float(x) / 72 * 25.4 for x in found.groups()]
    assert points == pytest.approx([297.0, 210.0], abs=0.01)


def test_bodies_are_closed_and_verify_finds_their_nominal_dimensions() -> None:
    for form, size in (("ball-bar", 7), ("step-block", 7)):
        files = artefact(form, name='a "good" one')
        body = read_mesh(files[f"{form}.stl"], ".stl")
        assert is_closed(body)
        known = artefact_from_text(files[f"{form}.toml"].decode(), form)
        assert known.name == 'a "good" one'
        assert not known.measured
        values = values_of(known, Survey(sample_surface(body, 60_000)[0]))
        assert len(values) == size
        for v in values:
            if v.test in ("size", "distance", "height"):
                # The flat triangles of the STL lie up to 20 µm inside of a ball.
                assert abs(v.value) < 0.04, v
    assert is_closed(read_mesh(artefact("ball-bar")["ball-bar-stand.stl"], ".stl"))


@pytest.mark.parametrize(
    ("form", "wish", "said"),
    [
        ("teapot", {}, "no artefact 'teapot'"),
        ("ball-bar", {"diameter": 30.0, "distance": 30.0}, "1.2 diameters apart"),
        ("step-block", {"heights": (5.0, 3.0)}, "ascending"),
        ("step-block", {"name": "a\nb"}, "printable"),
        ("target", {"board": "charuco:20x20:24:18:DICT_5X5_1000"}, "larger paper"),
        ("target", {"board": "chessboard:8x6:20"}, "no ChArUco board"),
        ("target", {"paper": "b5"}, "no paper 'b5'"),
    ],
)
def test_what_cannot_be_is_one_line(form: str, wish: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as e:
        artefact(form, **wish)  # type: ignore[arg-type]
    assert said in str(e.value)
    assert "\n" not in str(e.value)


def test_the_command_replaces_nothing(tmp_path: Path) -> None:
    words = ["artefact", "step-block", "-o", str(tmp_path / "new"), "--heights", "4,9"]
    done = CliRunner().invoke(turnscan, words)
    assert done.exit_code == 0, done.output
    made = {p.name for p in (tmp_path / "new").iterdir()}
    assert made == {"step-block.stl", "step-block.toml", "step-block-drawing.pdf"}
    again = CliRunner().invoke(turnscan, words)
    assert isinstance(again.exception, InputError)

"""``turnscan artefact``: what is printed has the size it says, and its file is read by verify."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from turnscan.calibrate import detect_board, detect_markers, parse_board
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


@pytest.mark.parametrize(
    ("spec", "count", "side", "size"),
    [({}, 9, 24.0, 194.0), ({"markers": "DICT_5X5_50:14", "diameter": 150.0}, 12, 14.0, 150.0)],
)
def test_the_markers_of_a_dial_are_found_where_it_says(
    spec: dict[str, object], count: int, side: float, size: float
) -> None:
    (data,) = artefact("dial", sheet="png", **spec).values()  # type: ignore[arg-type]
    picture = np.asarray(Image.open(io.BytesIO(data)).convert("L"))
    dictionary = str(spec.get("markers", "DICT_4X4_50")).partition(":")[0]
    seen = detect_markers(picture, dictionary)
    assert seen.numbers.tolist() == list(range(count))
    corners = seen.corners * PIXEL
    assert np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1) == pytest.approx(
        side, abs=2 * PIXEL
    )
    middle = corners.mean(axis=1)
    axis = np.array([105.0, 8.0 + size / 2])
    assert middle.mean(axis=0) == pytest.approx(axis, abs=2 * PIXEL)
    # The first stands at 0°, and angles grow against the clock (rows of a picture grow downwards).
    turn = np.degrees(np.arctan2(*((axis - middle) * [-1, 1]).T[::-1]))
    assert (turn - np.arange(count) * 360 / count + 180) % 360 - 180 == pytest.approx(
        np.zeros(count), abs=0.15
    )


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
    ("form", "spec", "said"),
    [
        ("teapot", {}, "no artefact 'teapot'"),
        ("ball-bar", {"diameter": 30.0, "distance": 30.0}, "1.2 diameters apart"),
        ("step-block", {"heights": (5.0, 3.0)}, "ascending"),
        ("step-block", {"name": "a\nb"}, "printable"),
        ("target", {"board": "charuco:20x20:24:18:DICT_5X5_1000"}, "larger paper"),
        ("target", {"board": "chessboard:8x6:20"}, "no ChArUco board"),
        ("target", {"paper": "b5"}, "no paper 'b5'"),
        ("dial", {"diameter": 250.0}, "needs 266 mm of paper, this has 210"),
        ("dial", {"diameter": 80.0}, "no room for 4 markers of 24 mm"),
        ("dial", {"markers": "DICT_4X4_50"}, "not a side length"),
        ("dial", {"markers": "DICT_7:20"}, "no marker dictionary is called 'DICT_7'"),
    ],
)
def test_what_cannot_be_is_one_line(form: str, spec: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as e:
        artefact(form, **spec)  # type: ignore[arg-type]
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

"""What an import says of pictures while they can still be taken again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from tests.calibrate.boards import marker_picture
from tests.calibrate.world import true_layout, true_rig
from turnscan.errors import InputError
from turnscan.rig import Rig
from turnscan.workflows import EvenSteps, import_pictures

STEP = 12.0
SIZE = (80, 120)


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten pictures of the platter, 12° apart, with a line that moves."""
    folder = tmp_path_factory.mktemp("turning")
    for k in range(10):
        picture = marker_picture(np.radians(STEP * k)).astype(np.float64)
        picture += 60 * np.exp(-((np.arange(640) - 40 - 3 * k) ** 2) / 4)
        Pillow.fromarray(picture.clip(0, 255).astype(np.uint8)).save(folder / f"p{k}.png")
    return folder


def rig() -> Rig:
    camera = replace(true_rig().camera, distortion=np.zeros(5))
    markers = replace(true_layout(), shape=np.zeros(5)).markers("DICT_4X4_50")
    return replace(true_rig(), camera=camera, markers=markers)


@pytest.mark.parametrize(
    ("step", "says"),
    [(-STEP, "turns the other way: the markers say \\+12"), (6.0, "other steps: the markers say")],
)
def test_markers_contradict_steps_of_another_sign_or_size(
    tmp_path: Path, turning: Path, step: float, says: str
) -> None:
    out = tmp_path / "a.turnscan"
    with pytest.raises(InputError, match=says) as caught:
        import_pictures(turning, out, EvenSteps(step), rig=rig())
    assert caught.value.option is not None
    assert not isinstance(caught.value.hint, str)
    right = caught.value.hint.options[0].value_text
    assert float(right.removeprefix("step:")) == pytest.approx(STEP, abs=0.1)
    assert not out.exists()


def test_right_steps_pass_the_markers(tmp_path: Path, turning: Path) -> None:
    done = import_pictures(turning, tmp_path / "a.turnscan", EvenSteps(STEP), rig=rig())
    assert done.frames == 10


def _pictures(folder: Path, line: float, noise: float) -> Path:
    folder.mkdir()
    for k in range(6):
        picture = 30 + noise * np.random.default_rng(k).standard_normal(SIZE)
        picture += line * np.exp(-((np.arange(SIZE[1]) - 20 - 12 * k) ** 2) / 8)
        Pillow.fromarray(picture.clip(0, 255).astype(np.uint8)).save(folder / f"p{k}.png")
    return folder


@pytest.mark.parametrize(("line", "clipped"), [(150.0, False), (900.0, True)])
def test_a_clipped_line_is_said(tmp_path: Path, line: float, clipped: bool) -> None:
    pictures = _pictures(tmp_path / "p", line, 1.0)
    done = import_pictures(pictures, tmp_path / "a.turnscan", EvenSteps(5))
    assert done.line_share > 0.9
    codes = [f.code for f in done.findings]
    assert ("scan.overexposed" in codes) == clipped
    assert "scan.no-line" not in codes


def test_specks_are_no_line(tmp_path: Path) -> None:
    folder = tmp_path / "p"
    folder.mkdir()
    for k in range(6):
        dice = np.random.default_rng(k)
        picture = 30 + dice.standard_normal(SIZE)
        picture[np.arange(SIZE[0]), dice.integers(5, SIZE[1] - 5, SIZE[0])] += 120
        Pillow.fromarray(picture.clip(0, 255).astype(np.uint8)).save(folder / f"p{k}.png")
    done = import_pictures(folder, tmp_path / "a.turnscan", EvenSteps(5))
    assert done.line_share < 0.3
    assert "scan.no-line" in [f.code for f in done.findings]

"""The commands of docs/how-to/phone.md, on pictures as a phone makes them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from tests.calibrate.phone import BALL, RADIUS, board_pictures, save, table_pictures
from turnscan.arrays import Floats
from turnscan.cli import turnscan
from turnscan.formats import read_mesh
from turnscan.shapes import fit_sphere

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "phone.md"


def by_hand(count: int, seed: int) -> Floats:
    """Angles of a disc that is turned once around, by steps as even as a hand makes them."""
    steps = np.random.default_rng(seed).uniform(0.7, 1.3, count)
    angles: Floats = 2 * np.pi * np.cumsum(steps) / steps.sum()
    return angles


def test_a_phone_and_a_hand_measure_a_ball(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(board_pictures(8, False, 1), tmp_path / "boards")
    save(board_pictures(6, True, 2), tmp_path / "lines")
    save(table_pictures(by_hand(10, 3), False, 3), tmp_path / "table")
    save(table_pictures(by_hand(20, 4), True, 4), tmp_path / "part")
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^turnscan (.*)$", PAGE.read_text(), re.M)
    assert [c.split()[0] for c in commands] == ["calibrate", "import", "reconstruct"]
    for command in commands:
        done = CliRunner().invoke(turnscan, shlex.split(command))
        assert done.exit_code == 0, f"{command}: {done.output} {done.exception!r}"
    assert_ball(tmp_path / "part.stl")
    as_video(tmp_path / "part", tmp_path / "part.mp4")
    for command in (commands[1].replace(" part ", " part.mp4 "), commands[2]):
        done = CliRunner().invoke(turnscan, shlex.split(command.replace("part.tu", "film.tu")))
        assert done.exit_code == 0, f"{command}: {done.output} {done.exception!r}"
    assert_ball(tmp_path / "part.stl")


def as_video(pictures: Path, path: Path) -> None:
    """What a phone films while the disc is turned past the places of the pictures."""
    read = [cv2.imread(str(name)) for name in sorted(pictures.iterdir())]
    size = read[0].shape[1], read[0].shape[0]
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 30, size)
    for picture in read:
        film.write(picture)
    film.release()


def assert_ball(path: Path) -> None:
    """It has the size that it has and lies where it does. A pixel is 0.9 mm wide there."""
    points = np.asarray(read_mesh(path.read_bytes(), ".stl").vertices)
    ball = points[points[:, 2] > 8.0]
    for _ in range(3):
        fit = fit_sphere(ball)
        off = np.abs(np.linalg.norm(ball - fit.centre, axis=1) - fit.radius)
        ball = ball[off < 3 * np.median(off) + 0.05]
    assert len(ball) > 0.5 * len(points)
    assert 2 * fit.radius == pytest.approx(2 * RADIUS, abs=0.5)
    assert fit.centre == pytest.approx(BALL, abs=0.4)

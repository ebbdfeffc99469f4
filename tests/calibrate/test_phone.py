"""The commands of docs/how-to/phone.md, on pictures as a phone makes them."""

from __future__ import annotations

import contextlib
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
from turnscan.errors import DidNotConverge
from turnscan.formats import read_mesh
from turnscan.shapes import Sphere, fit_sphere

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
    assert_ball(tmp_path / "part.stl", 0.5)
    as_video(tmp_path / "part", tmp_path / "part.mp4")
    for command in (commands[1].replace(" part ", " part.mp4 "), commands[2]):
        done = CliRunner().invoke(turnscan, shlex.split(command.replace("part.tu", "film.tu")))
        assert done.exit_code == 0, f"{command}: {done.output} {done.exception!r}"
    assert_ball(tmp_path / "part.stl", 0.75)


def as_video(pictures: Path, path: Path) -> None:
    """What a phone films while the disc is turned past the places of the pictures."""
    read = [cv2.imread(str(name)) for name in sorted(pictures.iterdir())]
    size = read[0].shape[1], read[0].shape[0]
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 30, size)
    for picture in read:
        film.write(picture)
    film.release()


def distances(points: Floats, sphere: Sphere) -> Floats:
    return np.asarray(np.abs(np.linalg.norm(points - sphere.centre, axis=1) - sphere.radius))


def through_most(points: Floats) -> Sphere:
    """Of spheres through ten points each, the one that half of all points lie nearest to."""
    draw = np.random.default_rng(5)
    some = []
    for _ in range(100):
        with contextlib.suppress(DidNotConverge):  # ten that lie badly tell none
            some.append(fit_sphere(draw.choice(points, 10, replace=False)))
    return min(some, key=lambda sphere: float(np.median(distances(points, sphere))))


def assert_ball(path: Path, most: float) -> None:
    """It has its size to ``most`` mm and lies where it does. A pixel is 0.9 mm wide there.

    A twentieth of a film's points are traces of compression beside the ball, up to 50 mm off: a fit
    to all of them may come to rest elsewhere, so it begins with a sphere that most points lie on.
    """
    points = np.asarray(read_mesh(path.read_bytes(), ".stl").vertices)
    points = points[points[:, 2] > 8.0]
    off = distances(points, through_most(points))
    ball = points[off < 3 * np.median(off)]
    for _ in range(3):
        fit = fit_sphere(ball)
        off = distances(ball, fit)
        ball = ball[off < 3 * np.median(off) + 0.05]
    assert len(ball) > 0.8 * len(points)
    assert 2 * fit.radius == pytest.approx(2 * RADIUS, abs=most)
    assert fit.centre == pytest.approx(BALL, abs=0.4)

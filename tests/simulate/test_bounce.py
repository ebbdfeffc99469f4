"""Light by a second surface: there where surfaces see each other, nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.benches import bench, light
from turnscan.simulate import Bench, Material, _shade, part


def bright(name: str, height: float, **more: object) -> Bench:
    """A bench with so much light that no share of it counts as too faint to follow."""
    made = bench(part(name), height=height, waist=0.9, **more)  # type: ignore[arg-type]
    return replace(made, beams=(replace(made.beams[0], power=1e4),))


def test_exchange_is_that_of_lambertian_patches() -> None:
    points, up = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    lamps = np.array([[3.0, 0.0, 4.0], [0.0, 0.0, -5.0]])
    down = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    got = _shade.exchange(points, up, lamps, down, np.array([2.0, 2.0]), 0.1)
    assert got[0, 0] == pytest.approx(2.0 / math.pi * (4 / 5) ** 2 / 25.0)
    assert got[0, 1] == 0.0  # below the horizon


@pytest.mark.parametrize(("name", "least", "most"), [("v-groove", 0.05, 0.4), ("sphere", 0, 1e-6)])
def test_a_groove_lights_itself_and_a_ball_does_not(name: str, least: float, most: float) -> None:
    single = bright(name, float(part(name).mesh.bounds[1, 2]) / 2)
    double = replace(single, bounces=True)
    direct, both = light(single, 0.2), light(double, 0.2)
    share = both.sum() / direct.sum() - 1.0
    assert least <= share <= most
    assert (both >= direct * (1 - 1e-6)).all()


def test_the_share_of_diffuse_bounces_follows_the_albedo() -> None:
    shares = []
    for albedo in (0.2, 0.8):
        paint = Material((albedo, albedo, albedo))
        single = bright("v-groove", 40.0, material=paint)
        double = replace(single, bounces=True)
        shares.append(light(double, 0.2).sum() / light(single, 0.2).sum() - 1.0)
    assert shares[1] / shares[0] == pytest.approx(4.0, rel=0.05)


def test_a_polished_groove_shows_a_ghost_line() -> None:
    matt = Material((0.5, 0.5, 0.5))
    polished = replace(matt, specular=0.3, roughness=0.1)
    ghosts = []
    for paint in (matt, polished):
        single = bright("v-groove", 40.0, material=paint)
        ghosts.append(light(replace(single, bounces=True), 0.2) - light(single, 0.2))
    # A narrow line: its peak stands out far more than its share of the light.
    assert ghosts[1].max() > 3 * ghosts[0].max()
    row = ghosts[1][240]
    assert (row > 0.5 * row.max()).sum() < 12

"""Surfaces that run into each other without an edge, and rounds of few rows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import averaged, noisy, prism, turned
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import find_shapes
from turnscan.shapes.primitives._ground import prepared
from turnscan.shapes.primitives._judged import fair, rows
from turnscan.shapes.primitives._surface_kernels import CYLINDER, PLANE

RADIUS, WALL = 12.0, 9.0


def _rounded() -> Mesh:
    """The walls of a bar of 9 mm sides with corners of 12 mm, which are tangent to them."""
    turn = np.linspace(0, np.pi / 2, 25)
    corners = [(WALL / 2, WALL / 2), (-WALL / 2, WALL / 2), (-WALL / 2, -WALL / 2)]
    outline = [
        (x + RADIUS * np.cos(t + k * np.pi / 2), y + RADIUS * np.sin(t + k * np.pi / 2))
        for k, (x, y) in enumerate([*corners, (WALL / 2, -WALL / 2)])
        for t in turn
    ]
    return prism(outline, 14.0, 0.7)


@pytest.mark.parametrize("seed", range(3))
def test_walls_and_the_fillets_between_them_are_found(seed: int) -> None:
    """Points are known to a tenth of a millimetre: a wall's tolerance reaches far into a fillet."""
    found = find_shapes(averaged(_rounded(), 0.08, seed, rounds=0), relations=False)
    planes, rounds = found.of("plane"), found.of("cylinder")
    assert len(planes) == 4
    for s in planes:
        assert float(np.abs(s.point @ s.axis)) == pytest.approx(WALL / 2 + RADIUS, abs=0.06)
        assert np.abs(s.axis).max() > np.cos(np.radians(1.5))
    assert len(rounds) >= 3
    for s in rounds:
        assert s.radius == pytest.approx(RADIUS, abs=max(4 * s.radius_sigma, 0.3))
    assert len(planes) + len(rounds) == len(found.shapes)


def test_rows_are_counted_across_a_plane_and_round_a_cylinder() -> None:
    strip = prism([(0, 0), (20, 0), (20, 2), (0, 2)], 30, 1.0)
    g = prepared(strip, None, None)
    q = np.array([10, 0, 15, 0, -1, 0, 0, 0, 0, 0.0])
    for width in (3, 6, 12):
        member = np.flatnonzero((strip.vertices[:, 1] == 0) & (strip.vertices[:, 0] <= width))
        assert rows(g, PLANE, q, member) == pytest.approx(width + 1, abs=0.5)
    rod = turned([(10, 0), (10, 30)], 1.0, 60)
    g = prepared(rod, None, None)
    q = np.array([0, 0, 0, 0, 0, 1.0, 10, 0, 0, 0])
    angle = np.arctan2(rod.vertices[:, 1], rod.vertices[:, 0])
    for many in (3, 7):
        member = np.flatnonzero((angle > -0.01) & (angle < (many - 0.5) * 2 * np.pi / 60))
        assert rows(g, CYLINDER, q, member) == pytest.approx(many, abs=0.5)
    assert rows(g, CYLINDER, q, np.arange(len(rod.vertices))) == np.inf


@pytest.mark.parametrize("known", [False, True])
def test_three_rows_of_a_file_tell_no_radius(known: bool) -> None:
    """Three vertices side by side, rounded as stripes are over the gap of a gear, lie on a round;
    where sigmas tell which of them an edge has bent, these decide."""
    rod = noisy(turned([(10, 0), (10, 80)], 0.4, 45), 0.02, 1)
    sigma = np.full(len(rod.vertices), 0.02) if known else None
    g = prepared(rod, sigma, None)
    q = np.array([0, 0, 0, 0, 0, 1.0, 10, 0, 0, 0])
    column = np.round(np.arctan2(rod.vertices[:, 1], rod.vertices[:, 0]) / (2 * np.pi / 45))
    said = [fair(g, CYLINDER, q, np.flatnonzero(np.abs(column) <= k)) for k in (1, 2, 4)]
    assert said == [known, True, True]

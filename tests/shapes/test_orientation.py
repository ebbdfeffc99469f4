"""Orientation, run-out and roundness of shapes, and thickness of walls: those that are there are
shown as large as they are, and chance is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, prism, turned, wrapped
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import FormError, find_shapes, orientation_errors
from turnscan.shapes.walls import wall_thickness
from turnscan.workflows import find_shapes as shapes_of

SIGMA = 0.02
BOX = [(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)]
SHAFT = [(20.0, 0.0), (20.0, 30.0), (14.0, 30.0), (14.0, 60.0)]


def _told(mesh: Mesh, kind: str, tolerance: float | None = None) -> list[FormError]:
    found = find_shapes(mesh, tolerance=tolerance)
    return [e for e in orientation_errors(mesh, found) if e.kind == kind]


def test_sides_of_a_box_are_parallel_and_square_as_far_as_chance_lets_tell() -> None:
    z = []
    for seed in range(6):
        mesh = noisy(prism(BOX, 20, 0.5), SIGMA, seed)
        every = orientation_errors(mesh, find_shapes(mesh))
        assert sorted(e.kind for e in every) == 2 * ["parallelism"] + 2 * ["perpendicularity"]
        assert not any(e.shown for e in every)
        z += [(e.value - e.noise) / e.sigma for e in every]
    assert abs(np.mean(z)) < 3 / np.sqrt(len(z))
    assert 0.4 < np.std(z) < 1.8


def test_a_side_that_leans_is_not_parallel_and_not_square() -> None:
    mesh = noisy(prism([(0, 0), (40, 0), (40, 30.5), (0, 30)], 20, 0.5), SIGMA, 3)
    (lean,) = (e for e in _told(mesh, "parallelism") if e.shown)
    # The middles of the outermost cells stand for the ends of the side.
    assert lean.value == pytest.approx(0.5 * (1 - 3 * lean.side / 40), abs=0.06)
    assert lean.datum == 0


def _shaft(off: float, seed: int, lobes: float = 0.0) -> Mesh:
    """Two steps, the upper one ``off`` mm beside the axis and with three lobes."""
    body = turned(SHAFT, 0.5, 250)
    X = body.vertices.copy()
    upper = np.hypot(X[:, 0], X[:, 1]) < 14.01
    turn = np.arctan2(X[:, 1], X[:, 0])
    X[upper, :2] *= (1 + lobes / 2 / 14 * np.cos(3 * turn[upper]))[:, None]
    X[upper, 0] += off
    return noisy(Mesh(X, body.faces), SIGMA, seed)


def test_run_out_is_twice_the_eccentricity() -> None:
    for off in (0.0, 0.1):
        mesh = _shaft(off, 1)
        (ring,), (whole,) = _told(mesh, "run-out"), _told(mesh, "total run-out")
        assert (ring.shown, whole.shown) == (off > 0, off > 0)
        assert ring.value == pytest.approx(np.hypot(2 * off, ring.noise), abs=0.02)
        assert whole.value >= ring.value
        assert (ring.shape, ring.datum) == (1, 0)


def test_a_shoulder_that_leans_is_not_square_to_the_axis_and_lobes_are_not_round() -> None:
    mesh = _shaft(0.0, 2, lobes=0.08)
    round_low, round_high = _told(mesh, "roundness", 0.2)
    assert (round_low.shown, round_high.shown) == (False, True)
    assert round_high.value == pytest.approx(0.08 + round_high.noise / 2, abs=0.015)
    flat = turned([(20, 0), (20, 30), (8, 30)], 0.5, 250)
    X = flat.vertices.copy()
    top = X[:, 2] > 29.9
    X[top, 2] += 0.01 * X[top, 0]
    (tip,) = _told(noisy(Mesh(X, flat.faces), SIGMA, 1), "perpendicularity")
    assert tip.shown
    assert 0.25 < tip.value < 0.4


def test_the_wall_of_a_tube_is_as_thick_as_it_is() -> None:
    """Also where it gets thinner to the top; what has no far side has no wall."""
    even = wall_thickness(noisy(turned([(20, 0), (20, 40), (17, 40), (17, 0)], 0.5, 250), SIGMA, 1))
    assert even is not None
    assert even.median == pytest.approx(3.0, abs=4 * even.median_sigma)
    assert even.median_sigma < 0.002
    assert 3.0 - 2 * even.noise < even.least < 3.0
    assert even.noise < 0.05
    assert even.share > 0.9
    cone = turned([(20, 0), (20, 40), (18.5, 40), (17, 0)], 0.5, 250)
    thin = wall_thickness(noisy(cone, SIGMA, 1))
    assert thin is not None
    assert 1.45 < thin.least < 1.65
    assert thin.where[2] > 35
    assert wall_thickness(noisy(turned([(20, 0), (17, 30)], 0.5, 250), SIGMA, 1)) is None


@pytest.mark.parametrize("radius", [20.0, 200.0])
def test_noise_that_turns_the_normals_makes_no_wall_thicker(radius: float) -> None:
    """0.15 mm of noise over 1.5 mm between points turn the mean normals by 2 to 3 degrees."""
    outline = [(radius, 0.0), (radius, 60.0), (radius - 10, 60.0), (radius - 10, 0.0)]
    clean = turned(outline, 1.5, int(radius * 4))
    z = []
    for seed in range(4):
        found = wall_thickness(noisy(clean, 0.15, seed))
        assert found is not None
        z.append((found.median - 10.0) / found.median_sigma)
    assert abs(np.mean(z)) < 1.5
    assert found.median_sigma < 0.01


def test_faces_that_cut_an_edge_make_no_wall_thin() -> None:
    """The profiles of a coarse turn are 4 mm apart, and miss the edges of a plate of 10 mm."""
    x = np.arange(-24.0, 25.0, 4.0)
    back, front = ([(u, y) for u in x[::way]] for y, way in ((-5.0, 1), (5.0, -1)))
    outline = np.array([*back, (28.0, -4.0), (30.0, 0.0), *front, (-29.0, 3.0), (-30.0, -2.0)])
    heights = np.arange(0, 60.5, 0.5)
    grid = np.stack([np.column_stack([outline, np.full(len(outline), z)]) for z in heights])
    found = wall_thickness(noisy(wrapped(grid), 0.05, 1))
    assert found is not None
    assert found.least > 10.0 - 2 * found.noise - 3 * found.least_sigma
    assert found.median == pytest.approx(10.0, abs=3 * found.median_sigma)


def test_what_moves_one_side_alone_counts_in_the_thickness() -> None:
    mesh = noisy(turned([(20, 0), (20, 40), (17, 40), (17, 0)], 0.5, 250), SIGMA, 1)
    out = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]) > 18.5
    radial = np.where(out[:, None], mesh.vertices, 0.0) * [1, 1, 0] / 20
    found = wall_thickness(mesh, [0.03 * radial])
    both = wall_thickness(mesh, [np.tile([0.03, 0.0, 0.0], (len(mesh.vertices), 1))])
    assert found is not None
    assert both is not None
    assert found.median_sigma == pytest.approx(0.03, rel=0.05)
    assert both.median_sigma < 0.002


def test_a_filled_side_has_no_thickness() -> None:
    mesh = turned([(20, 0), (20, 40), (17, 40), (17, 0)], 0.5, 250)
    inner = np.hypot(*mesh.vertices[:, :2].T)[mesh.faces].max(axis=1) < 18.5
    assert wall_thickness(Mesh(mesh.vertices, mesh.faces, measured=~inner)) is None


def test_sizes_come_in_the_order_of_a_drawing_and_steps_and_gaps_have_their_names() -> None:
    outline = [(0, 0), (60, 0), (60, 30), (40, 30), (40, 12), (20, 12), (20, 40), (0, 40)]
    found = shapes_of(noisy(prism([(float(x), float(y)) for x, y in outline], 30, 0.5), SIGMA, 1))
    named = [(d.quantity, round(d.value, 1)) for d in found.dimensions]
    assert {("step height", 10.0), ("step height", 18.0), ("gap width", 20.0)} <= set(named)
    assert {("distance", 60.0), ("distance", 40.0), ("distance", 12.0)} <= set(named)
    kinds = [s.kind for s in found.sizes]
    assert kinds == sorted(kinds, key=["distance", "angle"].index)
    said = str(found)
    assert "gap width 20." in said
    assert "wall thickness: at least" in said
    values = found.figures()
    assert values["walls"]["least_mm"] == pytest.approx(12.0, abs=0.1)
    assert {f["datum"] for f in values["forms"] if f["kind"] == "parallelism"} >= {1}

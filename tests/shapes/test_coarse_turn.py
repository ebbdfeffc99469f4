"""Shapes of parts that were scanned in few steps, whose profiles are far apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.shapes.solids import averaged, noisy, prism, turned
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import find_shapes
from turnscan.shapes.primitives._ground import prepared

SIGMA = 0.03
SHAFT = [(20.0, 0.0), (20.0, 30.0), (12.0, 30.0), (12.0, 54.0), (11.0, 55.0), (0.5, 55.0)]
"""With a chamfer of 1 mm, which a wide tolerance takes for a part of the cylinder below it."""


@pytest.mark.parametrize("steps", [24, 36, 200])
def test_a_coarse_turn_is_no_noise_and_a_chamfer_no_part_of_a_cylinder(steps: int) -> None:
    errors = []
    for seed in range(3):
        found = find_shapes(averaged(turned(SHAFT, 0.4, steps), SIGMA, seed, rounds=0))
        assert found.tolerance < 6 * SIGMA
        cylinders = sorted(found.of("cylinder"), key=lambda s: s.radius)
        for shape, true in zip(cylinders, (12.0, 20.0), strict=True):
            errors.append((shape.radius - true) / shape.radius_sigma)
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 2.0


def test_how_much_of_the_curvature_is_noise_does_not_jump() -> None:
    wall, known = turned(SHAFT, 0.4, 36), []
    for sigma in np.geomspace(0.01, 0.3, 60):
        mesh = averaged(wall, float(sigma), 1, rounds=0)
        known.append(prepared(mesh, np.full(len(mesh.vertices), 1e-6), None).usual / sigma)
    assert known[0] > 0.9
    assert known[-1] == pytest.approx(1.0, abs=0.1)
    assert np.abs(np.diff(np.log(known))).max() < 0.12


@pytest.mark.parametrize("steps", [24, 60])
def test_a_coarse_freeform_body_has_no_shape_without_sigma(steps: int) -> None:
    """Between profiles 8 mm apart all of it curves, which is no noise that a shape may hide in."""
    for seed in range(3):
        found = find_shapes(noisy(_head(steps), SIGMA, seed))
        assert not found.shapes
        assert SIGMA < found.tolerance < 5 * SIGMA


@pytest.mark.parametrize("steps", [24, 200])
def test_a_coarse_turn_without_sigma_keeps_its_cylinders(steps: int) -> None:
    for seed in range(3):
        found = find_shapes(noisy(turned(SHAFT, 0.4, steps), SIGMA, seed))
        assert found.tolerance < 6 * SIGMA
        large = [s for s in found.of("cylinder") if s.radius > 15]
        assert [s.radius for s in large] == [pytest.approx(20.0, abs=0.01)]


def test_a_band_no_wider_than_its_points_are_known_is_no_shape() -> None:
    """The sides of a plate of 6 mm are planes, but not to points that may be 1.5 mm off them."""
    plate = prism([(0.0, 0.0), (40.0, 0.0), (40.0, 6.0), (0.0, 6.0)], 40, 0.4)
    mesh = averaged(plate, SIGMA, 1, rounds=0)
    assert len(find_shapes(mesh).of("plane")) == 4
    assert mesh.provenance is not None
    doubt = replace(mesh.provenance, sigma=np.full(len(mesh.vertices), 0.5))
    planes = find_shapes(replace(mesh, provenance=doubt)).of("plane")
    assert [s.area > 1000 for s in planes] == [True, True]


@pytest.mark.parametrize(("columns", "rows"), [(1000, 8), (200, 10), (20, 400)])
def test_rows_far_apart_tell_their_noise_without_sigma(columns: int, rows: int) -> None:
    """Also where points on a row are nearer to each other than the noise; in a part whose rows are
    20 mm apart there is no shape within any tolerance."""
    for sigma in (0.05, 0.2):
        found = find_shapes(_lumps(columns, rows, sigma))
        assert not found.shapes
        assert 3 * sigma < found.tolerance < 6 * sigma


def test_what_is_rough_as_a_form_is_no_noise_without_sigma() -> None:
    found = find_shapes(_lumps(100, 8, 1.0))
    assert not found.shapes
    assert found.tolerance < 1.7, "of a part of 150 mm"


def _lumps(columns: int, rows: int, sigma: float) -> Mesh:
    """A lumpy closed body of about 80 mm whose points are off in all directions."""
    turn = np.arange(columns) * 2 * np.pi / columns
    u, v = np.meshgrid(turn, np.linspace(0.05, np.pi - 0.05, rows))
    r = 40 + 8 * np.cos(3 * u) * np.sin(v) ** 3 + 4 * np.sin(5 * v)
    r += 5 * np.sin(2 * u + 1) * np.sin(v) ** 2
    X = np.stack([r * np.cos(u) * np.sin(v), r * np.sin(u) * np.sin(v), r * np.cos(v)], axis=-1)
    X = X.reshape(-1, 3) + np.random.default_rng(1).normal(0, sigma, (rows * columns, 3))
    i, j = (k.ravel() for k in np.meshgrid(np.arange(columns), np.arange(rows - 1)))
    a, b = j * columns + i, j * columns + (i + 1) % columns
    c, d = a + columns, b + columns
    return Mesh(X, np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]))


def _head(steps: int) -> Mesh:
    """A lumpy wall of so many profiles, open above and below."""
    turn, z = np.meshgrid(np.arange(steps) * 2 * np.pi / steps, np.arange(0, 80, 0.4))
    r = 30 + 5 * np.cos(3 * turn + z / 30) + 4 * np.sin(z / 9) + 2 * np.sin(2 * turn - z / 12)
    X = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(steps), np.arange(len(z) - 1)))
    a, b = j * steps + i, j * steps + (i + 1) % steps
    c, d = a + steps, b + steps
    return Mesh(X, np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]))

"""Shapes of parts that were scanned in few steps, whose profiles are far apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import averaged, turned
from turnscan.shapes.primitives import find_shapes
from turnscan.shapes.primitives._regions import prepared

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

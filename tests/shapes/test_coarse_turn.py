"""Shapes of parts that were scanned in few steps, whose profiles are far apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import averaged, turned
from turnscan.shapes.primitives import find_shapes

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

"""What a growing region rests on: points spread evenly, and one misfit wherever it is computed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, turned
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import prepared
from turnscan.shapes.primitives._judged import excess


@pytest.mark.parametrize(("many", "most"), [(5, 9), (9, 9), (1000, 7), (4001, 400)])
def test_some_of_many_reach_from_the_first_to_the_last(many: int, most: int) -> None:
    some = surface.some_of(np.arange(many, dtype=np.int64), most)
    assert len(some) == min(many, most)
    assert (some[0], some[-1]) == (0, many - 1)
    assert np.ptp(np.diff(some)) <= 1, "evenly"


def test_a_fit_while_growing_knows_the_misfit_that_a_region_is_judged_by() -> None:
    ground = prepared(noisy(turned([(20, 0), (26, 30)], 0.7, 150), 0.02, 1), None, None)
    member = np.arange(len(ground.vertices), dtype=np.int64)
    some = surface.some_of(member, 400)
    q = np.array([0, 0, 15.0, 0, 0, 1, 23.0, np.arctan(0.2) + 1e-3, 0, 0])
    for kind, alike in ((surface.CYLINDER, False), (surface.CONE, True)):
        fit, cost, misfit = surface.refitted(
            kind, q, ground.vertices, ground.scale, ground.limit, ground.off, some,
            4 * ground.size, 30,
        )  # fmt: skip
        assert misfit == pytest.approx(excess(ground, kind, fit, member, 400), abs=1e-9)
        assert (misfit < 0.22) == alike, "a cone is no cylinder"
        assert np.isfinite(cost)

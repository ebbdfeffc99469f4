"""A view that has a single neighbour in another one is moved by what that says, and no further."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.poses._refine import Equations, _solve


@pytest.mark.parametrize("weight", [1.0, 2.0**20, 2.0**40])
def test_one_link_leaves_no_singular_matrix(weight: float) -> None:
    """Six unknowns, and one equation that holds all of them alike."""
    J = np.concatenate([-np.ones(6), np.ones(6)])
    motion = np.zeros((12, 12))
    e = Equations(weight * np.outer(J, J), weight * 0.6 * J, motion, 0.0, [], [], np.zeros((2, 3)))
    step = _solve(e, None, 1)
    assert step[6:].sum() == pytest.approx(0.6, rel=1e-2)
    assert np.abs(step[6:]).max() < 0.2
    assert not step[:6].any()

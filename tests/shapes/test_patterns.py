"""Patterns of holes: adopted where the holes agree with them, refused where one does not."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.shapes.primitives import Relation
from turnscan.shapes.primitives._relations import Adopted, adopt
from turnscan.shapes.primitives._surface_kernels import CYLINDER

SIGMA = 0.01
"""mm: standard uncertainty of a hole's place across."""
TURN = np.linspace(0, 2 * np.pi, 6, endpoint=False)
RING = 20 * np.column_stack([np.cos(TURN + 0.3), np.sin(TURN + 0.3)]) + [3, -2]
ROW = np.outer(np.arange(5), [9.0, 3.0])
CORNERS = np.array([[0, 0], [40, 0], [40, 25], [0, 25]], dtype=float)


def _holes(at: Floats, seed: int, radius: float = 3.0) -> Adopted:
    """Holes at places (n, 2), each measured with the noise of its uncertainty; what is adopted."""
    dice = np.random.default_rng(seed)
    n = len(at)
    q = np.zeros((n, 10))
    q[:, :2] = at + dice.normal(0, SIGMA, at.shape)
    q[:, 2] = 5.0
    q[:, 5] = 1.0
    q[:, 3:5] = dice.normal(0, 1e-3, (n, 2))
    q[:, 3:6] /= np.linalg.norm(q[:, 3:6], axis=1, keepdims=True)
    q[:, 6] = radius + dice.normal(0, SIGMA, n)
    own = np.square([1e-3, 1e-3, SIGMA, SIGMA, 0.0, SIGMA, 0.0])
    return adopt([CYLINDER] * n, [-1.0] * n, q, np.diag(np.tile(own, n)))


def _patterns(made: Adopted) -> list[Relation]:
    return [r for r in made.relations if "holes" in r.kind]


@pytest.mark.parametrize(
    ("at", "kind", "sizes", "share"),
    [
        (RING, "circle of holes", {"pitch circle diameter": 40.0}, 2 / np.sqrt(6)),
        (ROW, "row of holes", {"pitch": float(np.hypot(9, 3))}, 1 / np.sqrt(10)),
        (CORNERS, "rectangle of holes", {"pitch along": 40.0, "pitch across": 25.0}, 1.0),
    ],
)
def test_a_pattern_is_adopted_with_its_sizes(
    at: Floats, kind: str, sizes: dict[str, float], share: float
) -> None:
    """Their uncertainty is that of least squares over all holes. 5 % of true ones are refused."""
    dice = np.random.default_rng(1)
    off, adopted = list[float](), 0
    for seed in range(4):
        order = dice.permutation(len(at))
        every = _patterns(_holes(at[order], seed))
        adopted += len(every)
        if not every:
            continue
        (found,) = every
        assert found.kind == kind
        assert sorted(found.shapes) == list(range(len(at)))
        assert {name for name, _, _ in found.sizes} == set(sizes)
        for name, value, sigma in found.sizes:
            assert sigma == pytest.approx(share * SIGMA, rel=0.02)
            off.append((value - sizes[name]) / sigma)
    assert adopted >= 3
    assert np.abs(off).max() < 4
    assert np.std(off) > 0.3


@pytest.mark.parametrize("at", [RING, ROW, CORNERS])
def test_a_hole_that_is_out_of_place_is_in_no_pattern_with_the_others(at: Floats) -> None:
    moved = at.copy()
    moved[2] += [0.12, -0.1]
    everyone = set(range(len(at)))
    for found in _patterns(_holes(moved, 3)):
        assert set(found.shapes) != everyone


def test_a_hole_in_the_middle_of_a_circle_is_none_of_it() -> None:
    (found,) = _patterns(_holes(np.vstack([RING, RING.mean(axis=0)]), 2))
    assert found.kind == "circle of holes"
    assert sorted(found.shapes) == list(range(6))


def test_holes_anywhere_are_in_no_pattern() -> None:
    dice = np.random.default_rng(5)
    for seed in range(4):
        at = dice.uniform(-30, 30, (6, 2)) + np.outer(np.arange(6), [31.0, 7.0])
        assert not _patterns(_holes(at, seed))

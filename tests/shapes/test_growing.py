"""What a growing region rests on: points spread evenly, and one misfit wherever it is computed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, turned
from turnscan.arrays import Floats
from turnscan.shapes.primitives import _fit_kernels, _start_kernels
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import prepared
from turnscan.shapes.primitives._judged import excess
from turnscan.shapes.primitives._start import first_guesses


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
        fit, cost, misfit = _fit_kernels.refitted(
            kind, q, ground.vertices, ground.scale, ground.limit, ground.off, some,
            4 * ground.size, 30,
        )  # fmt: skip
        assert misfit == pytest.approx(excess(ground, kind, fit, member, 400), abs=1e-9)
        assert (misfit < 0.22) == alike, "a cone is no cylinder"
        assert np.isfinite(cost)


AXIS = np.array([2.0, 3.0, 6.0]) / 7
SURFACES = {
    surface.PLANE: (0.0, 0.0),
    surface.SPHERE: (30.0, 0.0),
    surface.CYLINDER: (30.0, 0.0),
    surface.CONE: (30.0, 0.3),
    surface.TORUS: (30.0, 9.0),
}


def _patch_on(kind: int) -> tuple[Floats, Floats, Floats]:
    """The ten numbers of a leaning surface, and points (100, 3) of a patch on it with normals."""
    q = np.array([5.0, -4.0, 7.0, *AXIS, *SURFACES[kind], 0, 0])
    e1, e2 = surface.frame(AXIS)
    wide = 1.0 if kind == surface.TORUS else 3.0
    u, v = (wide * k.ravel() for k in np.meshgrid(np.linspace(-1, 1, 10), np.linspace(-1, 1, 10)))
    away = 0.0 if kind == surface.PLANE else 40.0
    X = q[:3] + (away + u)[:, None] * e1 + v[:, None] * e2 + (u - v + 2)[:, None] * AXIS
    for _ in range(3):
        d, n = surface.distances(kind, q, X)
        X = X - d[:, None] * n
    return q, X, n


@pytest.mark.parametrize("kind", SURFACES)
def test_a_first_guess_is_the_surface_that_a_patch_lies_on(kind: int) -> None:
    q, X, normals = _patch_on(kind)
    assert np.abs(surface.distances(kind, q, X)[0]).max() < 1e-9
    guessed = dict(first_guesses(X, normals))[kind]
    off = float(np.abs(surface.distances(kind, guessed, X)[0]).max())
    if kind == surface.TORUS:
        # The cubic through its normals follows a torus least.
        assert off < 0.05
        assert guessed[6:8] == pytest.approx(q[6:8], rel=0.3)
        return
    assert off < 0.02
    guessed, cost = _fit_kernels.fitted(
        kind, guessed, X, np.full(len(X), 1e-3), np.arange(len(X)), surface.FREE[kind],
        6.0, 500.0, 30,
    )  # fmt: skip
    assert cost < 1e-6
    same = np.sign(guessed[3:6] @ AXIS)
    if kind != surface.SPHERE:
        assert guessed[3:6] * same == pytest.approx(AXIS, abs=1e-6)
    if kind == surface.CONE:
        # Its point slides along the axis, and the radius with it.
        along = (guessed[:3] - q[:3]) @ AXIS
        assert guessed[6] == pytest.approx(q[6] + along * np.tan(q[7]), abs=1e-3)
        assert guessed[7] * same == pytest.approx(q[7], abs=1e-6)
    else:
        assert guessed[6:8] == pytest.approx(q[6:8], abs=1e-3)


def test_small_systems_are_solved_as_numpy_does() -> None:
    rng = np.random.default_rng(1)
    for k in (1, 3, 10):
        M, right = rng.normal(size=(k, k)), rng.normal(size=k)
        fine, x = _start_kernels.solved(M, right)
        assert fine
        assert x == pytest.approx(np.linalg.solve(M, right), rel=1e-9)
    assert not _start_kernels.solved(np.zeros((2, 2)), np.ones(2))[0]


@pytest.mark.parametrize("spread", [(1.0, 2.0, 3.0), (0.0, 0.0, 5.0), (1e-9, 1.0, 1.0)])
def test_principal_directions_are_eigenvectors_the_least_first(spread: tuple[float, ...]) -> None:
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    M = turn @ np.diag(spread) @ turn.T
    M = (M + M.T) / 2
    values, vectors = _start_kernels.principal(M)
    assert values == pytest.approx(spread, abs=1e-12)
    assert vectors.T @ vectors == pytest.approx(np.eye(3), abs=1e-12)
    assert M @ vectors == pytest.approx(vectors * values, abs=1e-12)


@pytest.mark.parametrize("kind", SURFACES)
def test_rows_of_a_fit_are_the_derivatives_and_distances_of_its_surface(kind: int) -> None:
    q, X, _ = _patch_on(kind)
    X = X + 0.01 * np.random.default_rng(3).normal(size=X.shape)
    scale = np.random.default_rng(4).uniform(0.5, 2.0, len(X))
    e1, e2 = surface.frame(q[3:6])
    P = _fit_kernels._gathered(X, scale, np.arange(len(X)))
    rows = np.empty((8, len(X)))
    cost = _fit_kernels._rows(kind, q, e1, e2, P, 6.0, rows)
    off, slopes = surface.jacobian(kind, q, X)
    assert pytest.approx(slopes / scale[:, None], abs=1e-12) == rows[:7].T
    assert rows[7] == pytest.approx(off / scale, abs=1e-12)
    assert cost == pytest.approx(((off / scale) ** 2).sum())

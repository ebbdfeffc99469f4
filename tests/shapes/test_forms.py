"""Form errors: those that are there are shown, and noise is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, prism, turned
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import find_shapes, form_errors

SIGMA = 0.02


def _drum(wave: float, seed: int) -> Mesh:
    """A cylinder ⌀ 40 whose radius has three lobes of ``wave`` mm from valley to crest."""
    body = turned([(20, 0), (20, 30)], 0.5, 250)
    X = body.vertices.copy()
    turn = np.arctan2(X[:, 1], X[:, 0])
    X[:, :2] *= (1 + wave / 2 / 20 * np.cos(3 * turn))[:, None]
    return noisy(Mesh(X, body.faces), SIGMA, seed)


def test_noise_alone_is_no_form_error() -> None:
    z = []
    for seed in range(8):
        mesh = _drum(0.0, seed)
        (form,) = form_errors(mesh, find_shapes(mesh))
        assert (form.kind, form.shown) == ("cylindricity", False)
        assert form.value < SIGMA * 2  # the range of single points is 8 sigma
        z.append((form.value - form.noise) / form.sigma)
    assert abs(np.mean(z)) < 2.0
    assert np.std(z) < 2.5


def test_lobes_are_shown_as_large_as_they_are() -> None:
    mesh = _drum(0.06, 1)
    (form,) = form_errors(mesh, find_shapes(mesh, tolerance=0.15))
    assert form.shown
    assert form.value == pytest.approx(0.06 + form.noise / 2, abs=0.012)


def test_flat_sides_are_flat() -> None:
    mesh = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5), SIGMA, 3)
    forms = form_errors(mesh, find_shapes(mesh))
    assert [f.kind for f in forms] == 4 * ["flatness"]
    assert not any(f.shown for f in forms)

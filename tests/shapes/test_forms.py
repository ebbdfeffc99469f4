"""Form errors: those that are there are shown, and noise is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, prism, turned
from turnscan.mesh import Mesh, Provenance
from turnscan.shapes.primitives import find_shapes, form_errors
from turnscan.shapes.verification._statistics import noise_range

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
    assert abs(np.mean(z)) < 3 / np.sqrt(8)
    assert 0.4 < np.std(z) < 1.8


def test_the_range_of_noise_is_that_of_order_statistics() -> None:
    for n, mean, sigma in ((10, 3.0775, 0.7971), (100, 5.0152, 0.6052)):  # W. A. Shewhart's d₂, d₃
        assert noise_range(np.full(n, 0.1)) == pytest.approx((0.1 * mean, 0.1 * sigma), rel=0.05)
        assert noise_range(np.full(n, 0.1))[0] == pytest.approx(0.1 * mean, rel=1e-4)
    scatter = np.repeat([0.1, 0.2, 0.05], 40)
    drawn = np.ptp(np.random.default_rng(1).normal(0, scatter, (20_000, len(scatter))), axis=1)
    assert noise_range(scatter)[0] == pytest.approx(drawn.mean(), rel=0.01)
    assert noise_range(scatter)[1] == pytest.approx(drawn.std(), rel=0.05)
    assert noise_range(np.zeros(5)) == (0.0, 0.0)


def test_lobes_are_shown_as_large_as_they_are() -> None:
    mesh = _drum(0.06, 1)
    (form,) = form_errors(mesh, find_shapes(mesh, tolerance=0.15))
    assert form.shown
    assert form.value == pytest.approx(0.06 + form.noise / 2, abs=0.012)


def _averaged(mesh: Mesh, seed: int) -> Mesh:
    """Noise that neighbours share, as where several lasers were merged: each is the mean of those
    about it."""
    X = mesh.vertices
    noise = np.random.default_rng(seed).normal(0.0, 3 * SIGMA, X.shape)
    ends = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    off, many = noise.copy(), np.ones(len(X))
    np.add.at(off, ends[:, 0], noise[ends[:, 1]])
    np.add.at(many, ends[:, 0], 1.0)
    off /= many[:, None]
    return _known(Mesh(X + off, mesh.faces), np.full(len(X), off.std()))


def _known(mesh: Mesh, sigma: np.ndarray) -> Mesh:
    one = np.zeros(len(sigma), dtype=np.int32)
    return Mesh(mesh.vertices, mesh.faces, Provenance(sigma, one, one, one, ("right",)))


def test_noise_that_neighbours_share_is_no_form_error() -> None:
    plain = prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5)
    for seed in range(4):
        mesh = _averaged(plain, seed)
        forms = form_errors(mesh, find_shapes(mesh))
        assert [f.kind for f in forms] == 4 * ["flatness"]
        assert not any(f.shown for f in forms)
    bowed = plain.vertices.copy()
    front = bowed[:, 1] < 1e-9
    bowed[front, 1] += 0.15 * np.sin(np.pi * bowed[front, 0] / 40)
    mesh = _averaged(Mesh(bowed, plain.faces), 1)
    told = [f for f in form_errors(mesh, find_shapes(mesh, tolerance=0.4)) if f.shown]
    assert [f.value for f in told] == [pytest.approx(0.12, abs=0.03)]


def test_what_an_edge_bent_is_no_form_error() -> None:
    # Neighbours off alike, which say so: their sigma is twice that of the others.
    mesh = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5), SIGMA, 3)
    X, sigma = mesh.vertices.copy(), np.full(len(mesh.vertices), SIGMA)
    bent = (X[:, 1] < 1.0) & (X[:, 0] > 34.0) & (X[:, 0] < 39.0)
    X[bent, 1] -= 2 * SIGMA

    def shown(sigma: np.ndarray) -> list[str]:
        told = _known(Mesh(X, mesh.faces), sigma)
        return [f.kind for f in form_errors(told, find_shapes(told)) if f.shown]

    assert shown(sigma) == ["flatness"]
    sigma[bent] *= 2
    assert shown(sigma) == []


def test_flat_sides_are_flat() -> None:
    mesh = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5), SIGMA, 3)
    forms = form_errors(mesh, find_shapes(mesh))
    assert [f.kind for f in forms] == 4 * ["flatness"]
    assert not any(f.shown for f in forms)

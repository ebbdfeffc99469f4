"""Pixels to millimetres: exact where the truth is known, with the uncertainty they claim."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analytic import full_turn, make_rig, scan_shape, sphere, with_noise
from turnscan.errors import InputError
from turnscan.points import (
    build_grid,
    pixel_moves,
    point_covariance,
    systematic_sigma,
    to_object,
    triangulate,
)
from turnscan.rig import planar_point
from turnscan.stripes import Stripe, StripeFlag

BENT = {
    "elevation": 0.25,
    "lift": 25.0,
    "offset": 0.8,
    "bow": (2e-5, 1e-5, 0.0),
    "distortion": (-0.12, 0.03, 0.001, -0.002, 0.0),
    "tilt": (0.02, -0.03),
}


@settings(max_examples=60)
@given(
    theta=st.floats(0.15, 1.0),
    pan=st.floats(-0.1, 0.1),
    offset=st.floats(-5, 5),
    x=st.floats(-60, 150),
    y=st.floats(-100, 100),
    angle=st.floats(-7, 7),
)
def test_agrees_with_the_papers_closed_form(theta, pan, offset, x, y, angle):
    """Equations (1)-(4), generalised to a panned camera and a laser beside the axis."""
    rig = make_rig(theta=theta, pan=pan, offset=offset)
    c = rig.camera
    want = planar_point(x / c.fx, y / c.fy, theta, 490.0, 1.0, pan, offset)
    X, _ = triangulate(rig, "L0", [[c.cx + x, c.cy - y]], [0.1])
    got = to_object(rig, X, angle)[0]
    if np.isnan(want.R):
        assert np.isnan(got).all()
        return
    assert np.hypot(got[0], got[1]) == pytest.approx(want.rho, rel=1e-9, abs=1e-9)
    assert got[2] == pytest.approx(want.z, rel=1e-9, abs=1e-9)
    turned = want.azimuth - angle
    assert np.allclose(got[:2], want.rho * np.array([np.cos(turned), np.sin(turned)]), atol=1e-8)


@pytest.mark.parametrize("steps", [16])
def test_a_noise_free_sphere_is_exact(steps):
    rig = make_rig(**BENT)
    angles = full_turn(steps)
    centre, radius = (4.0, -3.0, 25.0), 30.0
    stripes = scan_shape(rig, sphere(radius, centre), angles)
    grid = build_grid(rig, "L0", stripes, np.arange(steps), angles)
    assert grid.found.sum() > 100 * steps / 2
    away = np.linalg.norm(grid.points[grid.found] - centre, axis=1) - radius
    assert np.abs(away).max() < 1e-9
    flat = make_rig(**{**BENT, "bow": (0.0, 0.0, 0.0)})
    wrong = build_grid(flat, "L0", stripes, np.arange(steps), angles)
    away = np.linalg.norm(wrong.points[wrong.found] - centre, axis=1) - radius
    assert np.nanmax(np.abs(away)) > 1e-3, "the sheet's bow must matter"


@pytest.mark.parametrize("across", [0, 1])
def test_sigma_is_the_derivative(across):
    """|∂X/∂u| σ, against central differences, with lens, tilted sensor and bent sheet."""
    rig = make_rig(**BENT)
    rng = np.random.default_rng(3)
    pixels = rng.uniform((60, 40), (260, 200), (200, 2))
    X, sigma = triangulate(rig, "L0", pixels, 0.2, across=across)
    h = 1e-4
    move = h * np.eye(2)[across]
    ends = [triangulate(rig, "L0", pixels + s * move, 0.2)[0] for s in (1, -1)]
    want = 0.2 * np.linalg.norm(ends[0] - ends[1], axis=1) / (2 * h)
    assert not np.isnan(X).any()
    assert np.allclose(sigma, want, rtol=1e-6)


def test_sigma_is_neither_too_small_nor_too_large():
    rig = make_rig(**BENT)
    angles = full_turn(8)
    exact = scan_shape(rig, sphere(30.0, (4.0, -3.0, 25.0)), angles)
    truth = build_grid(rig, "L0", exact, range(8), angles)
    noisy = build_grid(rig, "L0", with_noise(exact, 0.15, 7), range(8), angles)
    both = truth.found & noisy.found
    off = np.linalg.norm(noisy.points - truth.points, axis=-1)[both]
    z = off / noisy.sigma[both]
    assert both.sum() > 500
    assert 0.93 < np.sqrt(np.mean(z**2)) < 1.07


def test_a_horizontal_stripe_is_measured_across_its_rows():
    rig = make_rig(**BENT)
    columns = rig.camera.width
    position = np.full(columns, np.nan)
    position[100:200] = 120.25
    values = np.where(np.isnan(position), np.nan, 1.0)
    flags = np.where(np.isnan(position), StripeFlag.DARK, 0).astype(np.uint16)
    stripe = Stripe(position, 0.1 * values, values, values, flags, "horizontal")
    grid = build_grid(rig, "L0", [stripe], [0], [0.3])
    X, sigma = triangulate(rig, "L0", [[150.0, 120.25]], [0.1], across=1)
    assert np.allclose(grid.points[0, 150], to_object(rig, X[0], 0.3))
    assert grid.sigma[0, 150] == pytest.approx(sigma[0])


def test_what_the_rig_does_not_know_shows_in_the_points():
    """The covariance carried through agrees with rigs drawn from it."""
    rig = make_rig(elevation=0.2, lift=25.0)
    names = list(rig.parameter_names)
    rng = np.random.default_rng(5)
    A = np.zeros((len(names), 3))
    for k, (name, size) in enumerate(
        [("camera.fx", 1.0), ("L0.offset", 0.05), ("table.shift_x", 0.04)]
    ):
        A[names.index(name), k] = size
    A[names.index("L0.turn_along"), 0] = 1e-3
    known = make_rig(elevation=0.2, lift=25.0, covariance=A @ A.T)
    pixels, angles = np.array([[170.0, 90.0], [120.0, 150.0]]), np.array([0.3, 2.0])
    C = point_covariance(known, "L0", pixels, angles)
    drawn = []
    for _ in range(1500):
        moved = rig.perturbed(A @ rng.normal(size=3))
        X, _ = triangulate(moved, "L0", pixels, 0.1)
        drawn.append(to_object(moved, X, angles))
    for i in range(2):
        want = np.cov(np.array(drawn)[:, i].T)
        assert np.allclose(C[i], want, atol=0.12 * np.trace(want))
    assert not point_covariance(rig, "L0", pixels, angles).any()
    stripes = scan_shape(known, sphere(30.0, (0.0, 0.0, 25.0)), full_turn(4))
    grid = build_grid(known, "L0", stripes, range(4), full_turn(4))
    some = systematic_sigma(known, grid, 50)
    assert len(some) == 50
    assert 0.02 < np.median(some) < 1.0
    assert len(systematic_sigma(rig, grid)) == 0


def test_what_does_not_fit_is_refused_by_name():
    rig = make_rig()
    stripes = scan_shape(rig, sphere(20.0, (0, 0, 0)), np.zeros(1))
    with pytest.raises(InputError, match="1 stripes, 2 steps, 1 angles"):
        build_grid(rig, "L0", stripes, [0, 1], [0.0])
    with pytest.raises(KeyError, match="no laser 'blue'"):
        build_grid(rig, "blue", stripes, [0], [0.0])
    short = Stripe(*[np.full(5, np.nan)] * 4, np.ones(5, np.uint16))
    with pytest.raises(InputError, match="different lengths"):
        build_grid(rig, "L0", [*stripes, short], [0, 1], [0.0, 1.0])


def test_a_ray_that_misses_the_sheet_is_missing_not_guessed():
    rig = make_rig(theta=0.05)
    n = rig.camera.height
    ones = np.ones(n)
    far = Stripe(0.0 * ones, 0.1 * ones, ones, ones, np.zeros(n, np.uint16))
    grid = build_grid(rig, "L0", [far], [0], [0.0])
    assert not grid.found.any()
    assert (grid.flags == StripeFlag.OUTSIDE).all()
    assert np.isnan(grid.sigma).all()
    assert np.isnan(grid.amplitude).all()


def test_a_place_in_the_pixel_moves_all_points_that_have_it_alike():
    rig = make_rig()
    laser = rig.sheets[0].name
    middle = rig.camera.project(rig.T_camera_table.apply([[0.0, 0.0, 30.0]]))[0]
    here = np.floor(middle) + [0.3, 0.0]
    pixels = here + [[0.0, 0.0], [0.5, 0.0], [0.25, 0.0], [0.0, 0.5]]
    still = to_object(rig, rig.sheet(laser).intersect(rig.camera.rays(pixels)), np.zeros(4))
    aside = rig.sheet(laser).intersect(rig.camera.rays(pixels + [1e-3, 0.0]))
    per_pixel = 1e3 * (to_object(rig, aside, np.zeros(4)) - still)
    fields = np.stack(list(pixel_moves(rig, laser, pixels, np.zeros(4), 0)))
    share = np.einsum("kij,ij->ki", fields, per_pixel) / (per_pixel**2).sum(axis=1)
    assert np.allclose((share**2).sum(axis=0), 0.005**2 / 2, rtol=1e-3), "as uncertain everywhere"
    assert np.allclose(share[:, 1], -share[:, 0], rtol=1e-3), "half a pixel on: the other way"
    assert np.isclose(share[:, 2] @ share[:, 0], 0.0, atol=1e-9), "a quarter: independent"
    assert np.allclose(share[:, 3], share[:, 0], rtol=1e-3), "lines are alike"

"""Planes, spheres and cylinders: exact on exact points, and honest about noisy ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.errors import DidNotConverge, InputError
from turnscan.rig import rotation_from_vector
from turnscan.shapes import fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes._fit import _circle, fit_circle


def frame(seed):
    rng = np.random.default_rng(seed)
    return rng, rotation_from_vector(rng.normal(0, 1.2, 3)), rng.normal(0, 50, 3)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_exact_points_give_exact_shapes(seed):
    rng, R, shift = frame(seed)
    flat = np.column_stack([rng.uniform(-20, 20, (60, 2)), np.zeros(60)]) @ R.T + shift
    plane = fit_plane(flat)
    assert plane.rms < 1e-10
    assert abs(abs(plane.normal @ R[:, 2]) - 1) < 1e-12
    assert np.abs(plane.distances(flat)).max() < 1e-9
    ball = rng.normal(size=(80, 3))
    ball = 17.0 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + shift
    sphere = fit_sphere(ball)
    assert np.allclose(sphere.centre, shift, atol=1e-8)
    assert sphere.radius == pytest.approx(17.0, abs=1e-8)
    t, z = rng.uniform(0, 2.5, 80), rng.uniform(-15, 15, 80)
    tube = np.column_stack([9 * np.cos(t), 9 * np.sin(t), z]) @ R.T + shift
    cylinder = fit_cylinder(tube)
    assert cylinder.radius == pytest.approx(9.0, abs=1e-7)
    assert abs(abs(cylinder.axis @ R[:, 2]) - 1) < 1e-12
    away = cylinder.point - shift
    assert np.linalg.norm(away - (away @ R[:, 2]) * R[:, 2]) < 1e-6


def test_the_uncertainty_is_that_of_repeated_measurements():
    """z-scores of 300 noisy repeats: neither too small nor too large."""
    rng = np.random.default_rng(1)
    flat = np.column_stack([rng.uniform(-20, 20, 120), rng.uniform(-5, 5, 120), np.zeros(120)])
    ball = rng.normal(size=(120, 3))
    ball[:, 2] = np.abs(ball[:, 2])
    ball *= 20.0 / np.linalg.norm(ball, axis=1, keepdims=True)
    t = rng.uniform(0, 2.0, 120)
    tube = np.column_stack([10 * np.cos(t), 10 * np.sin(t), rng.uniform(-20, 20, 120)])
    z = {"tilt": [], "shift": [], "centre": [], "radius": [], "axis": [], "tube": []}
    for _ in range(300):
        noise = rng.normal(0, 0.05, (120, 3))
        p = fit_plane(flat + noise)
        n = p.normal * np.sign(p.normal[2])
        # Tilt about the long direction of the points (x) is the worse known one: it moves n along y
        z["tilt"].append(n[1] / np.sqrt(p.covariance[1, 1]))
        z["shift"].append((p.centre @ n) / np.sqrt(p.covariance[2, 2]))
        s = fit_sphere(ball + noise)
        z["centre"].append(s.centre[2] / np.sqrt(s.covariance[2, 2]))
        z["radius"].append((s.radius - 20) / np.sqrt(s.covariance[3, 3]))
        c = fit_cylinder(tube + noise, axis=[0, 0, 1])
        z["tube"].append((c.radius - 10) / np.sqrt(c.covariance[4, 4]))
        tilt = np.array([c.axis[1], -c.axis[0]])
        C = c.covariance[:2, :2]
        z["axis"].append(np.linalg.norm(tilt) / np.sqrt(np.trace(C)))
    for name, values in z.items():
        assert 0.85 < np.sqrt(np.mean(np.square(values))) < 1.18, name


def test_known_sigma_is_a_floor_and_weighs():
    rng = np.random.default_rng(2)
    X = np.column_stack([rng.uniform(-10, 10, (50, 2)), np.zeros(50)])
    assert fit_plane(X, 0.1).covariance[2, 2] == pytest.approx(0.01 / 50)
    bad = X.copy()
    bad[0, 2] = 100.0
    sigma = np.full(50, 0.1)
    sigma[0] = 1e6
    assert abs(fit_plane(bad, sigma).normal[2]) == pytest.approx(1.0, abs=1e-6)
    assert abs(fit_plane(bad).normal[2]) < 0.999


def test_too_little_is_refused():
    line = np.outer(np.arange(10.0), [1, 2, 3])
    with pytest.raises(InputError, match="on one line"):
        fit_plane(line)
    with pytest.raises(InputError, match="2 points"):
        fit_plane(line[:2])
    with pytest.raises(InputError, match="in one plane"):
        fit_sphere(np.column_stack([np.random.default_rng(0).normal(size=(20, 2)), np.zeros(20)]))
    with pytest.raises(InputError, match="at least 6 finite"):
        fit_cylinder(np.full((9, 3), np.nan))
    with pytest.raises(InputError, match="positive"):
        fit_plane(np.eye(3), 0.0)


@pytest.mark.parametrize("bumps", [0.0, 1e-4, 1e-3, 1e-2])
def test_points_about_in_a_plane_are_a_vast_sphere_or_none(bumps):
    flat = np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0), [0.0]), axis=-1).reshape(-1, 3)
    flat[:, 2] += bumps * np.random.default_rng(1).normal(size=36)
    try:
        assert fit_sphere(flat).radius > 50
    except (DidNotConverge, InputError):
        return


def _ring(count, radius=25.0):
    t = 2 * np.pi * np.arange(count) / max(count, 1)
    return np.stack([radius * np.cos(t), radius * np.sin(t), 0 * t], axis=-1)


_POOR = {
    "nothing": np.zeros((0, 3)),
    "one ring": _ring(80),
    "one point, often": np.ones((30, 3)),
    "a line": np.outer(np.arange(30.0), [1, 2, 3]),
    "a flat plate": np.stack(np.meshgrid(np.arange(6.0), np.arange(6.0), [0.0]), -1).reshape(-1, 3),
    "two lines": np.vstack([np.outer(np.arange(9.0), [1, 0, 0]), [[0, 0, 5]]]),
    "a few": _ring(5),
    "a ring and its middle": np.vstack([_ring(12), np.zeros((1, 3))]),
    "the ends of three axes": np.vstack([np.eye(3), -np.eye(3)]),
    "vast": 1e9 * np.eye(3),
    "not numbers": np.full((20, 3), np.inf),
    "a cone": np.vstack([_ring(30, r) + [0, 0, 2 * r] for r in (0.0, 5.0, 9.0)]),
}


@pytest.mark.parametrize("what", list(_POOR))
@pytest.mark.parametrize("bump", [0.0, 1e-12, 1e-6])
@pytest.mark.filterwarnings("error")
def test_points_that_leave_a_fit_open_are_refused_by_name(what, bump):
    rng = np.random.default_rng(3)
    points = _POOR[what] + bump * rng.normal(size=_POOR[what].shape)
    for fit in (fit_plane, fit_sphere, fit_cylinder, lambda p: fit_circle(p, [0, 0, 1])):
        try:
            found = fit(points)
        except (InputError, DidNotConverge):
            continue
        assert np.isfinite(found.covariance).all()
        assert (np.diag(found.covariance) >= 0).all()
    if what == "one ring" and bump < 1e-9:
        with pytest.raises(InputError, match="cylinder: the points lie in one plane"):
            fit_cylinder(points)


def test_a_circle_needs_a_direction():
    with pytest.raises(InputError, match="normal"):
        fit_circle(_ring(9), [0, 0, 0])
    with pytest.raises(InputError, match="sigma nan"):
        fit_circle(_ring(9), [0, 0, 1], np.nan)


def test_points_of_a_circle_seen_along_its_axis_give_it_exactly():
    rng, R, shift = frame(3)
    t = rng.uniform(0, 2.5, 40)
    d = np.column_stack([9 * np.cos(t), 9 * np.sin(t), rng.uniform(-5, 5, 40)]) @ R.T + shift
    foot, radius, rms = _circle(d, R[:, 2])
    assert radius == pytest.approx(9.0)
    assert foot == pytest.approx(shift - (shift @ R[:, 2]) * R[:, 2])
    assert rms < 1e-9
    assert _circle(d, R[:, 0])[2] > 0.1

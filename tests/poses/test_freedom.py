"""Which motions a surface leaves open, told from two noisy measurements of it."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.poses import View, align
from turnscan.rig import Pose

NOISE = 0.02
TILT = 0.02
"""Radians: noise of the normals."""


def view_of(name, points, normals, seed):
    """Points with normals as a view, with noise in both."""
    rng = np.random.default_rng(seed)
    n = normals + rng.normal(0, TILT, normals.shape)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    off = rng.normal(0, NOISE, len(points))[:, None] * normals
    m = len(points)
    return View(
        name, points + off, n, np.full(m, NOISE), points + 300.0 * normals, np.ones(m, bool), 1.0
    )


def ball(rng):
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return 20.0 * n, n


def tube(rng):
    a, z = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(-20, 20, 4000)
    n = np.column_stack([np.cos(a), np.sin(a), 0 * a])
    return 15.0 * n + z[:, None] * [0, 0, 1.0], n


def plate(rng):
    p = rng.uniform(-20, 20, (4000, 3)) * [1, 1, 0]
    return p, np.broadcast_to([0.0, 0, 1], p.shape).copy()


def brick(rng):
    p = rng.uniform(-1, 1, (6000, 3))
    side = rng.integers(0, 3, 6000)
    rows = np.arange(6000)
    n = np.zeros_like(p)
    n[rows, side] = np.sign(p[rows, side])
    p[rows, side] = n[rows, side]
    return p * [20, 14, 9], n


@pytest.mark.parametrize(("shape", "open_motions"), [(ball, 3), (tube, 2), (plate, 3), (brick, 0)])
def test_every_motion_that_slides_on_the_surface_is_named(shape, open_motions):
    views = [view_of(n, *shape(np.random.default_rng(k)), seed=10 + k) for k, n in enumerate("ab")]
    found = align(views, [Pose(), Pose()])
    assert len(found.freedoms) == open_motions
    words = [str(f) for f in found.freedoms]
    if shape is ball:
        assert all(w.startswith("turning about") for w in words)
        assert all(np.linalg.norm(f.shift) < 0.2 for f in found.freedoms), "about its centre"
    # What is open stays as it was; the rest is known as well as noise and number say.
    turned = found.poses[1].rotation
    assert np.abs(turned - np.eye(3)).max() < 0.01
    spread = np.sqrt(np.diagonal(found.covariance[1]))[3:]
    if shape is brick:
        moved = found.poses[1].apply(found.middles[1]) - found.middles[1]
        assert (np.abs(moved) < 4 * spread + 1e-4).all()
        assert NOISE / 200 < spread.min() < spread.max() < NOISE / 5

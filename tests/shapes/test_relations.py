"""Relations that are adopted leave what they do not say as uncertain as it was measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.arrays import Floats
from turnscan.shapes.primitives._relations import adopt
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, frame

TURN = 0.02
"""rad: how well the plane's turn about the axis is known, and how the cone's axis leans."""


def shape(point: Floats, axis: Floats, *sizes: float) -> Floats:
    q = np.zeros(10)
    q[:3], q[3:6] = point, axis / np.linalg.norm(axis)
    q[6 : 6 + len(sizes)] = sizes
    return q


def turn_of(normal: Floats, axis: Floats) -> Floats:
    """(2,) how the local parameters of a plane turn it about an axis."""
    e1, e2 = frame(normal)
    about = np.cross(axis, normal)
    return np.array([about @ e1, about @ e2])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.permutations([0, 1, 2, 3]))
def test_a_plane_keeps_its_turn_about_axes_to_which_it_is_parallel(
    seed: int, order: list[int]
) -> None:
    """Axes that differ by their noise do not say together where the plane looks."""
    dice = np.random.default_rng(seed)
    up = np.array([0.0, 0.0, 1.0])
    noise = np.array([2e-4, 2e-4, TURN / 2, TURN])
    leans = [np.append(dice.normal(size=2) * s, 0.0) for s in noise]
    normal = np.array([1.0, dice.normal() * TURN, dice.normal() * 1e-3])
    shapes = [
        (CYLINDER, shape(np.zeros(3), up + leans[0], 18.0), noise[0]),
        (CYLINDER, shape(np.array([0, 0, 40.0]), up + leans[1], 12.0), noise[1]),
        (CONE, shape(np.array([0, 0, 20.0]), up + leans[2], 15.0, 0.5), noise[2]),
        (PLANE, shape(np.array([14.0, 0, 30.0]), normal), 1e-3),
    ]
    shapes = [shapes[k] for k in order]
    covariance = np.zeros((28, 28))
    for k, (kind, q, sigma) in enumerate(shapes):
        at = 7 * k
        directions = np.eye(2) * sigma**2
        if kind == PLANE:
            about = turn_of(q[3:6], up)
            directions = directions + TURN**2 * np.outer(about, about)
        covariance[at : at + 2, at : at + 2] = directions
        own = np.diag([0.01, 0.01, 0.01, 0.01, 0.0]) ** 2
        covariance[at + 2 : at + 7, at + 2 : at + 7] = own
    made = adopt(
        [k for k, _, _ in shapes], [1.0] * 4, np.array([q for _, q, _ in shapes]), covariance
    )
    plane = order.index(3)
    axis = made.q[order.index(0), 3:6]
    about = turn_of(made.q[plane, 3:6], axis)
    own = made.covariance[7 * plane : 7 * plane + 2, 7 * plane : 7 * plane + 2]
    assert np.sqrt(about @ own @ about) == pytest.approx(TURN, rel=0.05)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31))
def test_a_plane_keeps_its_turn_about_normals_that_are_found_to_be_parallel(seed: int) -> None:
    """One of two normals is hardly known. That both are square to two planes makes them parallel;
    their difference, which was noise, does not tell how these planes are turned about them."""
    dice = np.random.default_rng(seed)
    askew = [0.0872, -0.0157]
    true = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], *([1, 0, s] for s in askew)])
    true = true / np.linalg.norm(true, axis=1, keepdims=True)
    turns = [(0.01, 0.01, 0.01), (0.02, 0.02, 0.02), (1.25, 0.1, 0.1), (0.02, 0.02, 0.02),
             (0.14, 1.4, 0.14), (0.04, 0.18, 0.04)]  # fmt: skip
    shapes, covariance = list[Floats](), np.zeros((42, 42))
    for k, (normal, turn) in enumerate(zip(true, np.radians(turns), strict=True)):
        leans = normal + np.cross(turn * np.clip(dice.normal(size=3), -1, 1), normal)
        shapes.append(shape(np.zeros(3), leans))
        about = np.cross(np.diag(turn), shapes[-1][3:6]) @ np.stack(frame(shapes[-1][3:6])).T
        covariance[7 * k : 7 * k + 2, 7 * k : 7 * k + 2] = about.T @ about
    made = adopt([PLANE] * 6, [1.0] * 6, np.array(shapes), covariance)
    for k in (4, 5):
        about = turn_of(made.q[k, 3:6], made.q[1, 3:6])
        own = made.covariance[7 * k : 7 * k + 2, 7 * k : 7 * k + 2]
        assert np.degrees(np.sqrt(about @ own @ about)) == pytest.approx(turns[k][1], rel=0.05)

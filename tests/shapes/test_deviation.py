"""Distances from a surface against shapes where they are known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.mesh import Mesh, sample_surface
from turnscan.shapes import deviation

CUBE = Mesh(
    np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)]),
    np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]),
            *([0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]),
            *([0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
    ),
)


def _exact(p: np.ndarray) -> np.ndarray:
    q = np.abs(p - 1.0) - 1.0
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_signed_distance_from_a_cube_is_exact(seed: int) -> None:
    p = np.random.default_rng(seed).uniform(-2, 4, (40, 3))
    found = deviation(p, CUBE)
    assert np.allclose(found.distance, _exact(p), atol=1e-12)
    assert np.allclose(np.linalg.norm(p - found.closest, axis=1), np.abs(found.distance))


def test_summary_figures() -> None:
    p = np.array([[1.0, 1.0, 2.3], [1.0, 1.0, 1.9], [1.0, 1.0, 2.0], [5.0, 1.0, 1.0]])
    found = deviation(p, CUBE)
    assert found.mean == pytest.approx((0.3 - 0.1 + 0 + 3) / 4)
    assert found.rms == pytest.approx(np.sqrt((0.09 + 0.01 + 9) / 4))
    assert found.within(0.1 + 1e-9) == 0.5
    assert found.quantile(1.0) == pytest.approx(3.0)


def test_no_points_give_nan_not_a_guess() -> None:
    found = deviation(np.zeros((0, 3)), CUBE)
    assert np.isnan([found.mean, found.rms, found.within(1.0), found.quantile(0.5)]).all()


def test_a_mesh_without_faces_is_refused() -> None:
    with pytest.raises(InputError, match="no faces"):
        deviation(np.zeros((1, 3)), Mesh(np.zeros((3, 3)), np.zeros((0, 3))))


def test_samples_lie_on_the_surface_and_share_it_evenly() -> None:
    p, face = sample_surface(CUBE, 6000)
    assert np.abs(_exact(p)).max() < 1e-12
    corners = CUBE.triangles[face]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs(np.einsum("ni,ni->n", p - corners[:, 0], normal)).max() < 1e-12
    per_side = [np.isclose(p[:, k], v).sum() for k in range(3) for v in (0.0, 2.0)]
    assert np.abs(np.array(per_side) - 1000).max() <= 2
    top = p[np.isclose(p[:, 2], 2.0)][:, :2]
    counts, _, _ = np.histogram2d(top[:, 0], top[:, 1], bins=5, range=[[0, 2], [0, 2]])
    # Random samples would scatter by √40 ≈ 6 a cell; these must do clearly better.
    assert 0 < counts.std() < 4.5
    assert np.array_equal(p, sample_surface(CUBE, 6000)[0])


def test_what_lies_past_the_rim_of_an_open_surface_is_beyond_it() -> None:
    """Four triangles about a middle: each rim side is another corner pair of its face."""
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 0.0]])
    faces = np.array([[0, 1, 4], [4, 1, 2], [3, 4, 2], [0, 4, 3]])
    plate = Mesh(corners, faces)
    beside = [(2, -1, 0), (5, 2, 0.1), (2, 5, -0.1), (-1, 2, 0), (-1, -1, 0), (5, 5, 0.2)]
    above = [(2, 0, 1), (1, 1, 0.5), (2, 2, -1), (3.9, 2, 0.3), (0, 0, 1), (2, -0.1, 1.0)]
    inside = [(1, 1, 0), (2, 0, 0), (0, 0, 0), (2, 2, 0)]
    points = np.array([*beside, *above, *inside], float)
    found = deviation(points, plate).beyond
    assert found.tolist() == [True] * 6 + [False] * (len(above) + len(inside))
    assert not deviation(np.array([[5.0, 1, 1], [-1, -1, -1]]), CUBE).beyond.any()

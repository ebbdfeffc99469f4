"""The camera against OpenCV, against itself backwards, and where it has no answer."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.rig import Camera

WEBCAM = [-0.28, 0.11, 1.2e-3, -0.8e-3, 0.02]


def _camera(distortion: list[float], tilt: tuple[float, float] = (0.0, 0.0)) -> Camera:
    return Camera(640, 480, 610.0, 588.0, 322.5, 236.0, np.array(distortion), np.array(tilt))


def _grid(camera: Camera, n: int = 13) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, n), np.linspace(0, camera.height - 1, n))
    return np.stack([u, v], axis=-1)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.08, -0.05), (-0.2, 0.15)])
@pytest.mark.parametrize("distortion", [[0.0] * 5, WEBCAM, [0.15, -0.1, -1e-3, 2e-3, 0.05]])
def test_projects_like_opencv(distortion: list[float], tilt: tuple[float, float]) -> None:
    camera = _camera(distortion, tilt)
    rng = np.random.default_rng(1)
    points = rng.uniform([-120, -90, 300], [120, 90, 700], (200, 3))
    theirs, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, camera.opencv_distortion
    )
    np.testing.assert_allclose(camera.project(points), theirs[:, 0], atol=1e-9)
    assert len(camera.opencv_distortion) == (14 if any(tilt) else 5)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.08, -0.05)])
def test_undistorts_like_opencv(tilt: tuple[float, float]) -> None:
    camera = _camera(WEBCAM, tilt)
    pixels = _grid(camera)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    theirs = cv2.undistortPoints(
        pixels.reshape(-1, 1, 2), camera.matrix, camera.opencv_distortion, criteria=stop
    )
    np.testing.assert_allclose(
        camera.normalised(pixels).reshape(-1, 2), theirs.reshape(-1, 2), atol=1e-9
    )


lens = st.tuples(
    st.floats(-0.4, 0.4),
    st.floats(-0.15, 0.15),
    st.floats(-3e-3, 3e-3),
    st.floats(-3e-3, 3e-3),
    st.floats(-0.05, 0.05),
)


@given(lens, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
@settings(max_examples=80)
def test_pixel_to_ray_and_back(k: Any, tilt_x: float, tilt_y: float) -> None:
    camera = _camera(list(k), (tilt_x, tilt_y))
    pixels = _grid(camera)
    rays = camera.rays(pixels)
    known = np.isfinite(rays[..., 0])
    np.testing.assert_allclose(camera.project(rays)[known], pixels[known], atol=1e-6)
    assert known[5:8, 5:8].all(), "the middle of the picture is always invertible"
    assert (np.isnan(rays).all(axis=-1) | np.isfinite(rays).all(axis=-1)).all()
    assert (rays[known][:, 2] == 1.0).all()


@given(lens)
@settings(max_examples=60)
def test_ray_to_pixel_and_back(k: Any) -> None:
    """What the camera can project, it finds again: the fold is the same both ways."""
    camera = _camera(list(k))
    rng = np.random.default_rng(2)
    xy = rng.uniform(-1.2, 1.2, (300, 2))
    pixels = camera.project(np.column_stack([xy, np.ones(300)]))
    back = camera.normalised(pixels)
    found = np.isfinite(back[:, 0])
    # The tangential terms shift the true fold a little from the radial one, so near it a point
    # may be refused, but never replaced by another.
    inside = np.isfinite(pixels[:, 0]) & ((xy**2).sum(axis=1) < 0.8 * camera._fold)
    np.testing.assert_allclose(back[found], xy[found], atol=1e-6)
    assert found[inside].all()


def test_nothing_comes_from_beyond_the_fold() -> None:
    """Radial barrel r(1 − 0.9 r²): its slope is 1/20 at r² = 0.95/2.7, soon after it turns back."""
    camera = _camera([-0.9, 0, 0, 0, 0])
    fold = np.sqrt(0.95 / 2.7)
    edge = fold * (1 - 0.9 * fold**2)
    r = np.linspace(0, 2 * edge, 4001)
    pixels = np.column_stack([camera.cx + camera.fx * r, np.full(len(r), camera.cy)])
    x = camera.normalised(pixels)[:, 0]
    at_fold = np.abs(r - edge) < 1e-9
    np.testing.assert_array_equal(np.isfinite(x) | at_fold, (r < edge) | at_fold)
    assert np.nanmax(x) < fold
    assert (np.diff(x[np.isfinite(x)]) > 0).all()
    beyond = np.array([[1.2 * fold, 0, 1], [0.8 * fold, 0, 1], [1.0541, 0, 1]])
    seen = np.isfinite(camera.project(beyond)[:, 0])
    assert seen.tolist() == [False, True, False]


def test_missing_stays_missing() -> None:
    camera = _camera(WEBCAM, (0.05, 0.0))
    pixels = np.array([[np.nan, 3.0], [np.inf, 2.0], [100.0, 100.0]])
    rays = camera.rays(pixels)
    assert np.isnan(rays[:2]).all()
    assert np.isfinite(rays[2]).all()
    behind = camera.project([[1.0, 1.0, -5.0], [1.0, 1.0, 0.0], [np.nan, 1.0, 5.0]])
    assert np.isnan(behind).any(axis=-1).all()
    assert camera.rays(np.empty((0, 2))).shape == (0, 3)
    assert camera.rays([1.0, 2.0]).shape == (3,)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.1, -0.07)])
def test_ray_derivatives(tilt: tuple[float, float]) -> None:
    camera = _camera(WEBCAM, tilt)
    pixels, h = _grid(camera, 7), 1e-3
    J = camera.ray_derivatives(camera.normalised(pixels))
    for axis in (0, 1):
        step = np.eye(2)[axis] * h
        slope = (camera.normalised(pixels + step) - camera.normalised(pixels - step)) / (2 * h)
        np.testing.assert_allclose(J[..., axis], slope, atol=1e-9)


@pytest.mark.parametrize("distortion", [WEBCAM, [-0.9, 0.1, 1e-3, -1e-3, 0.0]])
def test_half_a_video_frame_of_rays_is_quick(distortion: list[float]) -> None:
    """In multiples of what the tangent of as many numbers takes: no loop over pixels in Python."""
    camera = _camera(distortion)
    pixels = np.stack(np.meshgrid(np.arange(320) * 2.0, np.arange(480.0)), axis=-1)

    def seconds(work: Callable[[np.ndarray], object]) -> float:
        start = time.process_time()  # others may be busy
        for _ in range(5):
            work(pixels)
        return time.process_time() - start

    assert seconds(camera.normalised) < 1000 * seconds(np.tan)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"width": 0}, "width"),
        ({"height": 200_000}, "height"),
        ({"fx": float("nan")}, "fx"),
        ({"fy": -1.0}, "fy"),
        ({"cx": float("inf")}, "cx"),
        ({"distortion": [0.1, 0.2]}, "distortion"),
        ({"tilt": [0.0, float("nan")]}, "tilt"),
    ],
)
def test_impossible_cameras_are_refused_by_name(change: dict[str, Any], named: str) -> None:
    good: dict[str, Any] = {"width": 6, "height": 4, "fx": 5.0, "fy": 5.0, "cx": 2.5, "cy": 1.5}
    with pytest.raises(ValueError, match=named):
        Camera(**good | change)


def test_arrays_are_read_only() -> None:
    camera = _camera(WEBCAM)
    with pytest.raises(ValueError, match="read-only"):
        camera.distortion[0] = 0.0

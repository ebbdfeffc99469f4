"""The closed form with pan and offset: both ways, and against the full three-dimensional rig."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.rig import Design, design_preset, paper, planar_pixel, planar_point

designs = st.builds(
    dict,
    theta=st.floats(0.15, 1.4),
    distance=st.floats(200, 900),
    focal=st.floats(4, 30),
    pan=st.floats(-0.25, 0.25),
    offset=st.floats(-8, 8),
)


def _design(values: dict[str, float]) -> Design:
    try:
        return replace(design_preset("paper"), columns=64, rows=48, **values)
    except InputError:
        assume(False)
        raise


def _pixels(d: Design) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels (u, v) of the picture and where they are on the sensor, mm."""
    u, v = np.meshgrid(np.linspace(0, d.columns - 1, 9), np.linspace(0, d.rows - 1, 7))
    x = (u - (d.columns - 1) / 2) * d.pixel_width
    y = -(v - (d.rows - 1) / 2) * d.pixel_height
    return np.stack([u, v], axis=-1), x, y


@given(designs)
@settings(max_examples=60)
def test_closed_form_equals_the_full_rig(values: dict[str, float]) -> None:
    d = _design(values)
    rig = d.rig(height=37.0, both=True)
    uv, x, y = _pixels(d)
    for name, side in (("right", 1.0), ("left", -1.0)):
        rays = rig.camera.rays(uv)
        world = rig.T_camera_table.inverse().apply(rig.sheet(name).intersect(rays))
        flat = planar_point(x, y, side * d.theta, d.distance, d.focal, d.pan, side * d.offset)
        size = np.maximum(1.0, np.abs(flat.R))
        # Rays along the sheet meet it at a distance that only rounding decides.
        along = np.abs(np.sin(side * d.theta + d.pan + np.arctan(x / d.focal))) < 1e-9
        np.testing.assert_array_equal(np.isnan(world[..., 0]) | along, np.isnan(flat.R) | along)
        Z = flat.z + 37.0
        truth = np.stack(
            [flat.rho * np.cos(flat.azimuth), flat.rho * np.sin(flat.azimuth), Z], axis=-1
        )
        # Nearly parallel to the sheet, rounding grows with the square of the distance.
        error = np.abs(world - truth).max(axis=-1) / (size * np.maximum(1.0, size / d.distance))
        assert np.nanmax(error[~along], initial=0.0) < 1e-9
        back = rig.camera.project(rig.T_camera_table.apply(truth))
        seen = np.isfinite(flat.R) & (np.abs(flat.R) < 10 * d.distance)
        np.testing.assert_allclose(back[seen], uv[seen], atol=1e-7)


@given(designs)
@settings(max_examples=60)
def test_there_and_back(values: dict[str, float]) -> None:
    d = _design(values)
    _, x, y = _pixels(d)
    p = d.point(x, y)
    seen = np.isfinite(p.R) & (np.abs(p.R) < 10 * d.distance)
    back = d.pixel(p.R, p.z)
    np.testing.assert_allclose(back[seen], np.stack([x, y], axis=-1)[seen], atol=1e-9)


def test_without_pan_and_offset_it_is_the_paper() -> None:
    x = np.linspace(-3, 3.5, 41)
    theta = math.radians(22.4)
    p = planar_point(x, 1.0, theta, 500.0, 12.5)
    R = paper.radius(x, theta, 500.0, 12.5)
    np.testing.assert_allclose(p.R, R, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(p.z, paper.height(R, 1.0, theta, 500.0, 12.5), rtol=1e-12)
    np.testing.assert_allclose(p.slope, paper.radius_slope(x, theta, 500.0, 12.5), rtol=1e-11)
    np.testing.assert_allclose(p.rho, np.abs(R), rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(np.cos(p.azimuth[R < -1] - theta), -1.0)


def test_general_slope_is_the_derivative() -> None:
    args = (0.5, 400.0, 16.0, 0.05, 1.5)
    x, h = np.linspace(-3, 4, 15), 1e-5
    secant = (planar_point(x + h, 0, *args).R - planar_point(x - h, 0, *args).R) / (2 * h)
    np.testing.assert_allclose(planar_point(x, 0, *args).slope, secant, rtol=1e-7)


def test_ignoring_the_offset_costs_e_cot() -> None:
    theta, L, f, e = math.radians(22.4), 490.0, 12.5, 0.1
    x = float(planar_pixel(50.0, 0, theta, L, f)[0])
    error = 50.0 - float(planar_point(x, 0, theta, L, f, 0.0, e).R)
    assert abs(error) == pytest.approx(e / math.tan(theta + math.atan(x / f)), rel=1e-9)
    assert f"{abs(error):.4f}" == "0.2158"


@pytest.mark.parametrize("theta_deg", [10, 22.4, 30, 45, 60])
def test_fig_7_a_panned_camera_resolves_twice_as_well(theta_deg: float) -> None:
    centred = replace(design_preset("paper"), theta=math.radians(theta_deg))
    half = centred.gamma_max / 2
    panned = replace(centred, pan=half, focal=centred.half_width / math.tan(half))
    assert panned.focal == pytest.approx(25.5, abs=0.05)
    assert panned.r_max == pytest.approx(centred.r_max)
    # Secants over the first and the last pixel.
    ends = [panned.half_width, -panned.half_width]
    last, first = (
        abs(float(np.diff(panned.point([x, x - math.copysign(0.011, x)]).R)[0])) for x in ends
    )
    was_first = float(paper.delta_r(0.011, centred.theta, 500.0, 12.5))
    was_last = float(np.diff(centred.point([3.52 - 0.011, 3.52]).R)[0])
    assert was_first / first == pytest.approx(2.075, abs=0.01)
    assert was_last / last == pytest.approx(1.93, abs=0.01)


def test_a_camera_that_looks_down_still_sees_the_axis() -> None:
    d = design_preset("modern")
    rig = d.rig(height=150.0, look_down=math.radians(15))
    aim = 150.0 - d.distance * math.tan(math.radians(15))
    uv = rig.camera.project(rig.T_camera_table.apply([0.0, 0.0, aim]))
    np.testing.assert_allclose(uv, [(2448 - 1) / 2, (2048 - 1) / 2], atol=1e-9)
    above = rig.camera.project(rig.T_camera_table.apply([0.0, 0.0, aim + 10]))
    assert above[1] < uv[1]
    right = rig.T_camera_table.apply([0.0, 10.0, aim])
    assert right[0] > 0


def test_the_working_cylinder_stands_on_the_platter() -> None:
    d = design_preset("paper")
    rig = d.rig()
    edge = np.array([math.cos(d.theta), math.sin(d.theta), 0.0]) * d.r_max
    u, v = rig.camera.project(rig.T_camera_table.apply(edge))
    assert u == pytest.approx(639.5)
    assert v == pytest.approx(479.5)


@pytest.mark.parametrize(
    ("wrong", "named"), [({"height": math.nan}, "height"), ({"look_down": 2.0}, "look_down")]
)
def test_impossible_cameras_are_refused(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(InputError, match=named):
        design_preset("paper").rig(**wrong)

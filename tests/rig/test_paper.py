"""The paper's equations against Table 1, against each other and against plain geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.rig import disagreements, paper, table_1, table_1_text
from turnscan.rig._table1 import as_printed

F, L, WIDE, HIGH = 12.5, 500.0, 0.011, 0.009
ANGLES = np.radians([10, 15, 30, 45, 60])
PRINTED = {
    "delta_x": "2.5 1.64 0.76 0.44 0.25",
    "delta_r": "2.53 1.7 0.88 0.62 0.51",
    "r_max": "312 265 189 155 140",
    "h_max": "67 84 116 135 149",
    "ratio": "0.008 0.0064 0.0047 0.004 0.0036",
}

angle = st.floats(0.05, 1.5)
on_sensor = st.floats(-4.0, 4.0)


@pytest.mark.parametrize("name", PRINTED)
def test_table_1_to_the_printed_digit(name: str) -> None:
    assert " ".join(table_1_text(name)) == PRINTED[name]


def test_the_printed_equations_do_not_give_the_printed_table() -> None:
    r_max = paper.r_max(paper.gamma_max(640, WIDE, F), ANGLES, L)
    beta = paper.beta_max(480, HIGH, F)
    assert f"{paper.delta_x(WIDE, ANGLES[0], L, F):.2f}" == "2.48"
    assert [f"{v:.2f}" for v in paper.delta_r(WIDE, ANGLES, L, F)][:2] == ["2.52", "1.69"]
    high = [f"{v:.1f}" for v in paper.h_max(r_max, beta, ANGLES, L)]
    assert high == ["68.6", "86.8", "119.7", "139.0", "153.2"]


def test_each_disagreement_is_one_line_with_its_numbers() -> None:
    found = disagreements()
    lines = [d.message for d in found]
    assert all("\n" not in line and len(line) < 260 for line in lines)
    text = " ".join(lines)
    for figure in ("2.48", "2.52 1.69", "69 87 120 139 153", "1/125", "1/123", "1/278", "1/275"):
        assert figure in text
    assert "1/831" in text
    assert "30°" in next(line for line in lines if line.startswith("ΔR/R_max"))
    for d in found:
        shown = [float(p.removeprefix("1/")) for p in d.printed]
        assert len(shown) == len(d.equation)
        assert not np.allclose(shown, d.equation, rtol=1e-3)


def test_angles_and_grid_of_the_text() -> None:
    assert f"{math.degrees(paper.gamma_max(640, WIDE, F)):.1f}" == "15.7"
    assert f"{math.degrees(paper.beta_max(480, HIGH, F)):.1f}" == "19.6"
    first, last = table_1()[0], table_1()[-1]
    step = math.radians(1.8)
    assert f"{paper.circumferential_distance(first.r_max, step):.1f}" == "9.8"
    assert f"{paper.circumferential_distance(last.r_max, step):.1f}" == "4.4"
    assert f"{paper.vertical_distance(first.h_max, 480):.2f}" == "0.14"
    assert f"{paper.vertical_distance(last.h_max, 480):.2f}" == "0.31"


@given(on_sensor, angle)
def test_with_and_without_trigonometry_agree(x: float, theta: float) -> None:
    R = paper.radius(x, theta, L, F)
    same = paper.radius_from_angle(paper.viewing_angle(x, F), theta, L)
    np.testing.assert_allclose(R, same, rtol=1e-9, atol=1e-9)


@given(on_sensor, angle)
def test_ray_and_laser_line_meet_where_equation_3_says(x: float, theta: float) -> None:
    R = float(paper.radius(x, theta, L, F))
    gamma = math.atan(x / F)
    meets = math.sin(theta + gamma) > 0
    assert math.isfinite(R) == meets
    if meets:
        X, Y = paper.position(R, theta)
        # The camera at (L, 0) looks along −X and sees +Y to the right.
        np.testing.assert_allclose(Y * F, x * (L - X), atol=1e-6 * max(1, abs(R)))
        np.testing.assert_allclose(
            paper.ccd_position(R, theta, L, F), x, atol=1e-9 * max(1.0, abs(R))
        )
        assert float(paper.height(R, 1.5, theta, L, F)) == pytest.approx((L - X) * 1.5 / F)


@given(on_sensor, angle)
def test_mirror_laser(x: float, theta: float) -> None:
    np.testing.assert_array_equal(paper.radius(-x, -theta, L, F), paper.radius(x, theta, L, F))
    np.testing.assert_allclose(
        paper.radius_slope(-x, -theta, L, F), -paper.radius_slope(x, theta, L, F)
    )


@given(st.floats(-0.5, 4.0), st.floats(0.1, 1.4))
def test_slope_is_the_derivative(x: float, theta: float) -> None:
    h = 1e-5
    secant = (paper.radius(x + h, theta, L, F) - paper.radius(x - h, theta, L, F)) / (2 * h)
    np.testing.assert_allclose(paper.radius_slope(x, theta, L, F), secant, rtol=1e-6)


def test_equation_5_is_the_secant_over_the_first_pixel() -> None:
    np.testing.assert_allclose(
        paper.delta_r(WIDE, ANGLES, L, F), paper.radius(WIDE, ANGLES, L, F), rtol=1e-14
    )
    np.testing.assert_allclose(
        paper.delta_r_tabulated(WIDE, ANGLES, L, F),
        WIDE * paper.radius_slope(0.0, ANGLES, L, F),
        rtol=1e-14,
    )
    np.testing.assert_allclose(
        paper.delta_x(WIDE, ANGLES, L, F), paper.delta_r(WIDE, ANGLES, L, F) * np.cos(ANGLES)
    )
    np.testing.assert_allclose(
        paper.delta_x_small_pixel(WIDE, ANGLES, L, F),
        paper.delta_r_tabulated(WIDE, ANGLES, L, F) * np.cos(ANGLES),
    )


def test_behind_the_axis_and_beyond_the_singularity() -> None:
    theta = math.radians(30)
    behind = float(paper.radius(-1.0, theta, L, F))
    g = math.atan(1 / F)
    assert behind == pytest.approx(-L * math.sin(g) / math.sin(theta - g))
    blind = paper.radius(F * math.tan(-math.radians(15.7)), math.radians(10), L, F)
    assert np.isnan(blind)
    assert np.isnan(paper.radius_slope(-10.0, math.radians(10), L, F))
    assert np.isnan(paper.ccd_position(2 * L, math.radians(1), L, F))


def test_equations_broadcast() -> None:
    x = np.linspace(-1, 3, 7)
    table = paper.radius(x[:, None], ANGLES, L, F)
    assert table.shape == (7, 5)
    assert table[3, 2] == paper.radius(x[3], ANGLES[2], L, F)
    assert paper.position(table, ANGLES).shape == (7, 5, 2)


@pytest.mark.parametrize(
    ("value", "places", "text"),
    [(2.4954, 2, "2.5"), (312.2, 0, "312"), (0.004, 4, "0.004"), (100.0, 0, "100"), (0, 2, "0")],
)
def test_rounding_as_the_paper_does(value: float, places: int, text: str) -> None:
    assert as_printed(value, places) == text

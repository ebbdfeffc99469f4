"""A thick sheet on a curved surface: its light's centre, integrated, beside what is taken off."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.points._curvature import curvature_shift, thin_doubt
from turnscan.points._lit_points import LitPoints

THICK = 0.6
"""mm rms of the sheet."""
AWAY = 400.0
"""mm from the axis to the camera."""
WINDOWED = 0.9112
"""Of the variance of a Gaussian, what is left within ± 2.5 of its widths."""
PIXEL = 0.4
"""mm of a pixel on the axis."""


def sheet_meets(outline, angle: float, d):
    """(m,) where planes y = d of the table meet a turned outline, the x nearest to the laser; and
    the outline's normals (m, 2) there."""
    radius, (cx, cy) = outline
    turned = complex(cx, cy) * np.exp(1j * angle)
    high = np.asarray(d, dtype=float) - turned.imag
    x = turned.real + np.sqrt(radius**2 - high**2)
    return x, np.stack([x - turned.real, high], axis=-1) / radius


def windowed(u: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Centre and rms width as the detector's window of ± 2.5 widths has them."""
    mean, wide = 0.0, float(np.sqrt((weight * u**2).sum() / weight.sum()))
    for _ in range(50):
        kept = weight * (np.abs(u - mean) <= 2.5 * wide)
        mean = float((kept * u).sum() / kept.sum())
        wide = float(np.sqrt((kept * (u - mean) ** 2).sum() / kept.sum() / WINDOWED))
    return mean, wide


def light_of(outline, theta: float, steps: int, lines: int = 16) -> tuple[LitPoints, np.ndarray]:
    """What is known of a round part's light, and how far (s,) px its centres truly lie beside."""
    eye = AWAY * np.array([np.cos(theta), np.sin(theta)])
    angles = 2 * np.pi * np.arange(steps) / steps
    d = np.linspace(-4 * THICK, 4 * THICK, 2001)
    points, eyes, moves, sheets, true, width = [], [], [], [], [], []
    for angle in angles:
        x0, _ = sheet_meets(outline, angle, 0.0)
        middle = np.array([float(x0), 0.0])
        ray = middle - eye
        far = np.linalg.norm(ray)
        aside = np.array([-ray[1], ray[0]]) / far * PIXEL * far / AWAY
        x, normals = sheet_meets(outline, angle, d)
        lit = np.stack([x, d], axis=-1)
        to_eye = eye - lit
        # A pixel's light is the radiance: what a piece sends counts by the pixels that see it.
        facing = np.einsum("mi,mi->m", normals, to_eye) / np.einsum("mi,mi->m", to_eye, to_eye)
        weight = np.exp(-0.5 * (d / THICK) ** 2) * facing
        # Pixels lie evenly on the tangent of the angle to the ray of the middle.
        beside = (lit - eye) @ aside / (aside @ aside)
        u = beside / ((lit - eye) @ ray / far**2)
        mean, wide = windowed(u, weight)
        true.append(mean)
        width.append(wide)
        back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        for out, v in (
            (points, middle), (eyes, eye), (moves, aside), (sheets, np.array([0.0, 1.0]))
        ):  # fmt: skip
            out.append(back @ v)

    def along(rows, z: bool = False):
        """(s, lines, 3) of (s, 2), the points at heights of their own."""
        flat = np.repeat(np.array(rows)[:, None], lines, axis=1)
        high = np.broadcast_to(0.4 * np.arange(lines) if z else np.zeros(lines), flat.shape[:2])
        return np.concatenate([flat, high[..., None]], axis=-1)

    wide = np.repeat(np.array(width)[:, None], lines, axis=1)
    up = along(eyes)[:, 0]
    light = LitPoints(
        along(points, z=True), up, along(moves), along(sheets), wide, np.ones_like(wide), angles,
        True,
    )  # fmt: skip
    return light, np.array(true)


@settings(max_examples=15)
@given(
    radius=st.floats(8.0, 60.0),
    aside=st.floats(0.0, 0.35),
    theta=st.sampled_from([-0.5, -0.39, 0.3, 0.6]),
    steps=st.integers(48, 120),
)
def test_what_is_taken_off_is_what_the_lights_own_centre_is_off(radius, aside, theta, steps):
    light, true = light_of((radius, (aside * radius, 0.0)), theta, steps)
    shift = curvature_shift(light, THICK)
    left = np.abs(true[:, None] - shift)
    assert np.median(left) <= np.median(np.abs(true)) / 6
    assert left.max() <= 0.3 * np.abs(true).max()


def test_square_to_a_cylinder_it_is_three_halves_of_the_square_over_the_radius_in_the_window():
    light, true = light_of((20.0, (0.0, 0.0)), np.radians(22.4), 100)
    shift = curvature_shift(light, THICK)
    depth = 1.5 * THICK**2 / 20.0
    to_eye = light.eyes[0, :2] - light.points[0, 0, :2]
    far = np.linalg.norm(to_eye)
    sunk = 0.797 * depth * abs(to_eye[1]) / far / (PIXEL * far / AWAY)
    assert abs(shift).mean() == pytest.approx(abs(true).mean(), rel=0.02)
    # What is nearer looks larger, too: one over the distance, beside one over R.
    assert abs(true).mean() == pytest.approx(sunk, rel=2 * 20.0 / AWAY)


def test_a_plane_that_the_camera_sees_aslant_is_shifted_too():
    """What is nearer looks larger: the centre moves to the side that is nearer."""
    light, true = light_of((1e5, (20.0 - 1e5, 0.0)), 0.39, 720)
    near = np.minimum(light.angles, 2 * np.pi - light.angles) < 0.3
    assert np.abs(true[near]).min() > 1e-4
    shift = curvature_shift(light, THICK)[near]
    assert np.abs(true[near, None] - shift).max() < 0.1 * np.abs(true[near]).max()


@pytest.mark.parametrize("height", [-50.0, 0.0, 50.0])
def test_a_camera_that_looks_up_or_down_sees_another_section_of_a_ball(height: float) -> None:
    """A line of the picture does not cut the ball level. With the level circle's curvature what is
    taken off is up to a fifth too small on the side turned away and a sixth too large on the other,
    which made a ball bar 10 µm too short."""
    radius, theta, steps = 15.0, 0.5, 96
    eye = AWAY * np.array([np.cos(theta), np.sin(theta), 0.0])
    d = np.linspace(-4 * THICK, 4 * THICK, 2001)
    latitude = np.radians(np.arange(-50.0, 50.5, 1.5))
    points = radius * np.stack([np.cos(latitude), 0 * latitude, np.sin(latitude)], axis=-1)
    points[:, 2] += height
    moves, true, width = [], [], []
    for middle in points:
        ray = middle - eye
        far = np.linalg.norm(ray)
        aside = np.array([-ray[1], ray[0], 0.0]) / np.hypot(ray[0], ray[1]) * PIXEL * far / AWAY
        up = np.cross(ray, aside)
        # Where the line's plane meets y = d on the ball: z = p - q x, then a square equation in x.
        p, q = (up @ eye - up[1] * d) / up[2] - height, up[0] / up[2]
        root = (p * q) ** 2 - (1 + q**2) * (p**2 + d**2 - radius**2)
        x = (p * q + np.sqrt(root)) / (1 + q**2)
        lit = np.stack([x, d, p - q * x + height], axis=-1)
        beside = (lit - eye) @ aside / (aside @ aside)
        u = beside / ((lit - eye) @ ray / far**2)
        # Each pixel has the radiance of what it sees: of a matt ball that is lit level.
        mean, wide = windowed(u, np.exp(-0.5 * (d / THICK) ** 2) * x * np.abs(np.gradient(u)))
        moves.append(aside)
        true.append(mean)
        width.append(wide)
    angles = 2 * np.pi * np.arange(steps) / steps
    back = np.zeros((steps, 3, 3))
    back[:, 0, 0] = back[:, 1, 1] = np.cos(angles)
    back[:, 0, 1], back[:, 1, 0] = np.sin(angles), -np.sin(angles)
    back[:, 2, 2] = 1.0
    of_all = (np.einsum("sij,nj->sni", back, np.array(v)) for v in (points, moves))
    sheets = np.einsum("sij,j->si", back, [0.0, 1.0, 0.0])
    wide = np.tile(width, (steps, 1))
    seen, aside = of_all
    light = LitPoints(
        seen, back @ eye, aside, np.repeat(sheets[:, None], len(latitude), axis=1), wide,
        np.ones_like(wide), angles, True,
    )  # fmt: skip
    shift = curvature_shift(light, THICK).mean(axis=0)
    # Over lines beside each other, what is taken off is the mean: not at the ends.
    inner = slice(6, -6)
    off = shift[inner] / np.array(true)[inner] - 1
    assert np.abs(off).max() < 0.12
    assert abs(off[: len(off) // 2].mean() - off[len(off) // 2 :].mean()) < 0.02


def test_an_edge_between_flat_sides_is_no_curvature():
    light, _ = light_of((20.0, (0.0, 0.0)), 0.39, 96)
    turn = light.angles
    # A square prism in the same light: the radius at each angle of a turn.
    side = np.mod(turn + np.pi / 4, np.pi / 2) - np.pi / 4
    flat = light.points * (14.0 / np.cos(side) / 20.0)[:, None, None]
    # From far away, so that what is nearer does not look larger.
    square = LitPoints(flat, 100 * light.eyes, light.moves, light.sheets, light.width,
                       light.amplitude, turn, True)  # fmt: skip
    round_ = np.abs(curvature_shift(light, THICK)).mean()
    away = np.abs(side) < 0.5
    assert np.abs(curvature_shift(square, THICK))[away].max() < 0.1 * round_


def test_beside_the_axis_the_noise_of_points_is_no_curvature():
    """A side 0.3 mm before the axis: a turn carries its points no further than noise does."""
    with np.errstate(invalid="ignore"):  # seen from its edge the sheet passes beside it
        light, _ = light_of((400.0, (0.3 - 400.0, 0.0)), 0.39, 120)
    near = np.minimum(light.angles, 2 * np.pi - light.angles) < 1.0
    draw = np.random.default_rng(5)
    along = np.stack([np.cos(light.angles), -np.sin(light.angles), 0 * light.angles], axis=-1)
    noise = draw.normal(0.0, 0.1, (*light.width.shape, 1)) * along[:, None]
    shaken = LitPoints(light.points + noise, light.eyes, light.moves, light.sheets, light.width,
                       light.amplitude, light.angles, True)  # fmt: skip
    moved = PIXEL * np.abs(curvature_shift(shaken, THICK))[near]
    assert np.quantile(moved, 0.99) < 0.05
    assert moved.max() < 0.15


@pytest.mark.parametrize("thick", [0.5, 1.0, 2.0])
def test_the_far_side_of_a_thin_plate_through_the_axis_is_no_curvature(thick: float) -> None:
    """Steps beside the axis are short, and those as far off as the sheet reaches lie on the back:
    its points were moved by 0.1 mm."""
    light, _ = light_of((20.0, (0.0, 0.0)), 0.39, 60)
    turn = light.angles
    aslant = np.abs(np.sin(turn)) > 0.1
    reach = 0.5 * thick / np.maximum(np.abs(np.sin(turn)), 0.1)
    points = np.where(aslant[:, None, None], light.points * (reach / 20.0)[:, None, None], np.nan)
    points[..., 2] = light.points[..., 2] + 0 * points[..., 2]
    plate = LitPoints(points, 100 * light.eyes, light.moves, light.sheets, light.width,
                      light.amplitude, turn, True)  # fmt: skip
    moved = PIXEL * np.abs(curvature_shift(plate, THICK))
    assert np.nanmax(moved) < 0.01


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5])
def test_a_turn_of_few_steps_comes_to_an_end(steps: int) -> None:
    """And has no curvature, as no two profiles lie to either side."""
    light, _ = light_of((20.0, (3.0, 0.0)), 0.4, steps)
    moved = curvature_shift(light, THICK)
    if steps < 4:
        assert np.all(np.isnan(moved) | (moved == 0.0))


@given(radius=st.floats(0.2, 6.0), steps=st.integers(24, 120))
def test_a_pin_is_doubted_by_what_its_curve_would_shift_and_no_more_than_it_is_thick(radius, steps):
    light = ring(np.full(steps, radius))
    doubt = thin_doubt(light, THICK)
    if radius < 3.99 * THICK:
        assert doubt == pytest.approx(0.7 * min(radius, 1.5 * THICK**2 / radius))
    elif radius > 4.01 * THICK:
        assert not doubt.any()


@pytest.mark.parametrize("beside", [0.0, 0.3, 1.0])
def test_a_face_that_passes_beside_the_axis_is_not_thin(beside: float) -> None:
    """It is so near for a few steps alone."""
    phi = 2 * np.pi * np.arange(100) / 100
    radius = np.minimum((beside + 0.05) / np.maximum(np.abs(np.cos(phi)), 1e-3), 15.0)
    radius = np.where(np.cos(phi) > 0, radius, 12.0)
    assert not thin_doubt(ring(radius), THICK).any()


def test_nothing_is_thin_where_nothing_was_measured() -> None:
    half = np.where(np.arange(40) < 20, 1.5, np.nan)
    doubt = thin_doubt(ring(half), THICK)
    assert (doubt[:20] > 0).all()
    assert not doubt[20:].any()
    assert not thin_doubt(ring(np.full(30, np.nan)), THICK).any()


def ring(radius: np.ndarray, lines: int = 30) -> LitPoints:
    """Points so far from the axis, mm, in even steps all round, a line every 0.4 mm."""
    phi = 2 * np.pi * np.arange(len(radius)) / len(radius)
    rim = np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)
    points = np.empty((len(phi), lines, 3))
    points[..., :2], points[..., 2] = rim[:, None], 0.4 * np.arange(lines)
    points[np.isnan(points[..., 0])] = np.nan
    plain = np.ones(points.shape[:2])
    return LitPoints(points, np.zeros((len(phi), 3)), points, points, plain, plain, phi, True)

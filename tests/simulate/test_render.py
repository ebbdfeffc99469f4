"""The renderer against closed formulae: centres, widths, energy, shadows, the paper's Table 1."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.benches import SECONDS, bench, centres, light, wall
from turnscan.arrays import Floats
from turnscan.rig import Pose, design_preset, table_1_designs
from turnscan.simulate import Bench, Body, Material, Part, Scene, part
from turnscan.simulate import _parts as parts
from turnscan.simulate import _solids as solids

Depth = Callable[[Floats, Floats], Floats]
"""Eye (3,) and rays (n, 3), table frame → length along the rays to the surface."""


def true_columns(made: Bench, rows: Floats, near: Floats, depth: Depth) -> Floats:
    """Columns, within 2 px of ``near``, whose rays meet the middle of the sheet; by bisection."""
    camera, T = made.rig.camera, made.rig.T_camera_table
    eye = T.inverse().translation

    def away(u: Floats) -> Floats:
        rays = T.inverse().turn(camera.rays(np.stack([u, rows], axis=-1)))
        return made.rig.sheets[0].distance(T.apply(eye + depth(eye, rays)[:, None] * rays))

    low, high = near - 2.0, near + 2.0
    sign = np.sign(away(low))
    assert (np.sign(away(high)) == -sign).all()
    for _ in range(40):
        middle = (low + high) / 2
        same = np.sign(away(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.asarray((low + high) / 2)


def plane_at(x: float) -> Depth:
    return lambda eye, rays: (x - eye[0]) / rays[:, 0]


def ball_at(radius: float, z: float) -> Depth:
    def depth(eye: Floats, rays: Floats) -> Floats:
        o = eye - (0.0, 0.0, z)
        a, b, c = (rays * rays).sum(1), rays @ o, o @ o - radius**2
        with np.errstate(invalid="ignore"):
            return np.asarray((-b - np.sqrt(b * b - a * c)) / a)

    return depth


def test_stripe_on_a_plane_is_centred_within_3_milli_pixels() -> None:
    made = bench(wall(5.0), waist=0.9)
    rows, u = centres(light(made))
    assert len(rows) > 400
    bias = u - true_columns(made, rows, u, plane_at(5.0))
    assert np.abs(bias).max() < 0.003


def test_stripe_on_a_sphere_is_centred_within_3_milli_pixels() -> None:
    design = design_preset("modern")
    small = replace(design, rows=512)  # a window of the sensor, for speed
    made = bench(part("sphere"), small, height=20.0, waist=0.12)
    rows, u = centres(light(made))
    near = np.abs(rows - 255.5) < 150  # below 40° of latitude
    assert near.sum() > 250
    bias = u[near] - true_columns(made, rows[near], u[near], ball_at(20.0, 20.0))
    assert abs(bias.mean()) < 0.003
    assert np.abs(bias).max() < 0.006


def test_stripe_width_follows_the_sheet_and_the_angle() -> None:
    made = bench(wall(0.0), waist=1.0)
    picture = light(made)
    rows, u = centres(picture)
    k = len(rows) // 2
    row = picture[int(rows[k])]
    sigma = math.sqrt((row * (np.arange(640) - u[k]) ** 2).sum() / row.sum() - 1 / 12)
    # A sheet of rms 0.5 mm cuts a wall square to the camera over 0.5/cos θ.
    on_wall = 0.5 / math.cos(design_preset("paper").theta)
    assert sigma == pytest.approx(on_wall * 12.5 / 500 / 0.011, rel=0.01)


def test_divergence_widens_the_sheet_away_from_its_waist() -> None:
    made = bench(wall(0.0))
    beam = replace(made.beams[0], waist=0.1, waist_distance=250.0)
    far = beam.radius(550.0)
    assert far == pytest.approx(0.1 * math.hypot(1, 300.0 / (math.pi * 0.01 / 632.8e-6)))
    assert far > 0.6


def test_albedo_step_shifts_the_centre_by_065_sigma() -> None:
    """White to dark 10:1 at the middle of the stripe: σ √(2/π) (1 − r)/(1 + r)."""
    plain = bench(wall(0.0), waist=1.2)
    # Half the turn light, half dark: on a wall through the axis the edge is at y = 0.
    paint = Material(pattern="bars", pitch=2 * math.pi * 25.0, pattern_ratio=0.1)
    edge = bench(wall(1e-9), waist=1.2, material=paint)
    picture = light(plain)
    rows, u = centres(picture)
    _, shifted = centres(light(edge))
    row = picture[240]
    sigma = math.sqrt((row * (np.arange(640) - u[240 - int(rows[0])]) ** 2).sum() / row.sum())
    shift = np.median(np.abs(shifted - u)) / sigma
    assert shift == pytest.approx(math.sqrt(2 / math.pi) * 0.9 / 1.1, rel=0.02)


def test_energy_balances_with_the_fans_flux() -> None:
    """All photons of the picture against the flux on a wall seen through the lens's aperture."""
    made = bench(wall(0.0), waist=0.6)
    got = light(made).sum()
    beam, T = made.beams[0], made.rig.T_camera_table
    back = T.inverse()
    apex, aim = back.apply(beam.apex), back.turn(beam.aim)
    half = math.tan(beam.half_angle)
    s = (np.arange(20000) + 0.5) / 10000 - 1
    way = aim + s[:, None] * half * np.array([0.0, 0.0, 1.0])
    points = apex + (-apex[0] / way[:, 0])[:, None] * way
    uv = made.rig.camera.project(T.apply(points))
    seen = np.abs(uv[:, 1] - 239.5) <= 240
    to_eye = back.translation - points
    distance = np.linalg.norm(to_eye, axis=1)
    cosine = to_eye[:, 0] / distance  # on the wall, and at the lens: both look along x
    flux = beam.power / len(s)
    glass = made.lens
    aperture = math.pi / 4 * (glass.focal / glass.f_number) ** 2
    # The wall is Lambertian; the image side's (1 + m)² is v²/f² with the true image distance v.
    per_point = flux * 0.6 / math.pi * cosine * aperture * cosine / distance**2
    v = glass.focal * (1 + glass.magnification)
    per_point *= (design_preset("paper").focal / v) ** 2
    photon = 6.62607015e-34 * 2.99792458e11 / beam.wavelength
    wanted = per_point[seen].sum() * glass.transmission * SECONDS / photon
    assert got == pytest.approx(wanted, rel=0.004)


def test_a_galvanometer_and_a_lens_bring_the_same_power() -> None:
    made = bench(wall(0.0))
    s = np.linspace(-1, 1, 20001)
    for profile in ("powell", "gaussian", "galvo"):
        beam = replace(made.beams[0], profile=profile, frequency=300.0)
        share = beam.share(s, 0.0, 0.04)  # 12 whole sweeps
        assert np.trapezoid(share, s) == pytest.approx(1.0, rel=0.01)
    ends = replace(made.beams[0], profile="galvo").share(np.array([0.0, 0.95]), 0.0, 0.04)
    assert ends[1] / ends[0] == pytest.approx(1 / math.sqrt(1 - 0.95**2), rel=0.03)


def test_a_broken_sweep_beats() -> None:
    beam = replace(bench(wall(0.0)).beams[0], profile="galvo", frequency=105.0)
    s = np.linspace(-0.9, 0.9, 181)
    flat = beam.share(s, 0.0, 4 / 105.0) * np.sqrt(1 - s * s)
    first, later = (beam.share(s, t, 0.04) * np.sqrt(1 - s * s) for t in (0.0, 0.0031))
    assert np.ptp(flat) < 0.01 * flat.mean()
    assert np.ptp(first) > 0.08 * first.mean()  # 4.2 sweeps: some places get one pass more
    assert np.abs(first - later).max() > 0.08 * first.mean()


def _post(radius: float, top: float, at: tuple[float, float]) -> Body:
    return Body(
        parts.cylinder(radius, 2 * top), Material(), Pose(translation=np.array([*at, -top]))
    )


def test_shadow_ends_where_geometry_says() -> None:
    """A round post between laser and wall: the shadow's upper end on the wall."""
    theta = design_preset("paper").theta
    reach, top, radius = 60.0, 15.0, 3.0
    at = (reach * math.cos(theta), reach * math.sin(theta))
    plain = bench(wall(0.0), height=30.0)
    made = replace(plain, scene=Scene((Body(wall(0.0)), _post(radius, top, at))))
    eye_z, far = 30.0, 550.0
    # The laser is above the post: its light passes over the far rim down to the wall.
    z = eye_z + (top - eye_z) * far / (far - (reach - radius))
    row = made.rig.camera.project(made.rig.T_camera_table.apply([0.0, 0.0, z]))[1]
    full, shaded = light(plain), light(made)
    near = slice(300, 340)
    lit = shaded[:, near].sum(axis=1) / np.maximum(full[:, near].sum(axis=1), 1e-9)
    edge = np.flatnonzero((lit[:-1] > 0.5) & (lit[1:] <= 0.5))
    fraction = [k + (lit[k] - 0.5) / (lit[k] - lit[k + 1]) for k in edge]
    assert min(abs(f - row) for f in fraction) < 0.6
    below = int(row) + 3
    assert lit[below : below + 20].max() < 0.05


def test_the_camera_does_not_see_through_a_post() -> None:
    plain = bench(wall(0.0), height=30.0)
    made = replace(plain, scene=Scene((Body(wall(0.0)), _post(3.0, 15.0, (60.0, 0.0)))))
    hidden, free = light(made), light(plain)
    post = made.rig.camera.project(made.rig.T_camera_table.apply([60.0, 0.0, 0.0]))
    row, column = int(post[1]), int(post[0])
    assert free[row - 4 : row + 4, column - 4 : column + 5].sum() > 0
    assert hidden[row - 4 : row + 4, column - 4 : column + 5].sum() == 0


@pytest.mark.parametrize(
    ("index", "delta_x", "delta_r", "r_max", "h_max"),
    [
        (0, 2.50, 2.53, 312, 67),
        (1, 1.64, 1.70, 265, 84),
        (2, 0.76, 0.88, 189, 116),
        (3, 0.44, 0.62, 155, 135),
        (4, 0.25, 0.51, 140, 149),
    ],
)
def test_table_1_comes_out_of_rendered_pictures(
    index: int, delta_x: float, delta_r: float, r_max: int, h_max: int
) -> None:
    """The printed numbers, measured in pictures as one would on a bench: moved walls, cylinders."""
    design = table_1_designs()[index]
    near, far = (light(bench(wall(x), design, waist=1.0)) for x in (1.0, -1.0))
    (_, a), (_, b) = centres(near), centres(far)
    measured = 2.0 / abs(np.median(a) - np.median(b))
    assert measured == pytest.approx(delta_x, abs=0.0051)
    assert measured / math.cos(design.theta) == pytest.approx(delta_r, abs=0.0051)

    radii, places, heights = (0.96 * r_max, 0.98 * r_max), [], []
    for R in radii:
        h = 0.45 * h_max
        # Its side alone: the camera stands at half its height, and sees neither end.
        drum = Part("drum", solids.revolved([(R, -h), (R, h)], 720))
        picture = light(bench(drum, design, waist=0.5))
        _, u = centres(picture, least=0.9)
        places.append(np.median(u))
        # Whole rows, and at both ends the share of a row that is lit.
        level = picture.sum(axis=1)
        a, b = np.flatnonzero(level > 0)[[0, -1]]
        lit = b - a - 1 + level[a] / level[a + 2] + level[b] / level[b - 2]
        heights.append(0.9 * h_max * 480 / lit)
    # 1/R is linear in 1/x: two measured points give the R of the sensor's edge.
    x, inverse = np.array(places) - 319.5, 1.0 / np.array(radii)
    slope = (inverse[1] - inverse[0]) / (1 / x[1] - 1 / x[0])
    assert 1 / (inverse[0] + slope * (1 / 320 - 1 / x[0])) == pytest.approx(r_max, abs=0.6)
    to_edge = (639.5 - places[1]) / (places[1] - places[0])
    assert heights[1] + to_edge * (heights[1] - heights[0]) == pytest.approx(h_max, abs=0.6)

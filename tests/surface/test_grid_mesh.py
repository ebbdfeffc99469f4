"""The grid's mesh: whole where the surface is, torn where it is not, facing outward."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analytic import (
    box,
    cylinder,
    full_turn,
    make_rig,
    scan_shape,
    sphere,
    torus,
    union,
    with_noise,
)
from tests.mesh.checks import check_sound, euler, sides
from tests.surface.grids import random_grid, turned
from turnscan.mesh import (
    boundary_loops,
    components,
    cut_touching,
    is_closed,
    submesh,
    vertex_normals,
)
from turnscan.points import RangeGrid, Volume, build_grid, clip, every
from turnscan.surface import TearLimits, mesh_grid


def scan(rig, shape, steps, noise=0.0, **turn):
    angles = full_turn(steps, **turn)
    stripes = scan_shape(rig, shape, angles)
    if noise:
        stripes = with_noise(stripes, noise, 11)
    return build_grid(rig, "L0", stripes, np.arange(steps), angles)


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("theta", [0.4, -0.4])
@pytest.mark.parametrize("steps", [24, 25])
def test_the_seam_closes_and_faces_look_outward(steps, theta, clockwise):
    rig = make_rig(theta=theta, lift=20.0, elevation=0.1)
    grid = clip(scan(rig, cylinder(25.0, 0.0, 40.0), steps, clockwise=clockwise), Volume(50, 5, 35))
    mesh = mesh_grid(grid)
    check_sound(mesh)
    assert euler(mesh) == 0, "a band"
    assert len(boundary_loops(mesh)) == 2
    t = mesh.triangles
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    assert (np.einsum("ij,ij->i", normal[:, :2], t[:, 0, :2]) > 0).all()
    opened = mesh_grid(replace(grid, closed=False))
    assert euler(opened) == 1, "a strip"


def test_the_outside_of_a_torus_is_one_band():
    rig = make_rig(lift=10.0, elevation=0.0)
    mesh = mesh_grid(scan(rig, torus(30.0, 8.0, 10.0), 40))
    check_sound(mesh)
    assert components(mesh).max() == 0
    assert euler(mesh) == 0
    c = mesh.vertices * (1, 1, 0)
    c *= 30.0 / np.linalg.norm(c, axis=1, keepdims=True)
    outward = np.einsum("ij,ij->i", vertex_normals(mesh), mesh.vertices - c - [0, 0, 10.0])
    assert outward.min() > 0


def test_two_steps_of_a_turn_are_not_closed_on_themselves():
    grid = scan(make_rig(lift=20.0), cylinder(25.0, 0.0, 40.0), 3)
    two = every(grid, 2)
    check_sound(mesh_grid(two))


def test_a_step_between_coaxial_cylinders_is_torn_and_a_slope_is_not():
    rig = make_rig(lift=20.0, elevation=0.0)
    stepped = union(cylinder(30.0, 0.0, 20.0), cylinder(18.0, 0.0, 40.0))
    grid = clip(scan(rig, stepped, 24), Volume(60, 2, 38))
    mesh = mesh_grid(grid)
    check_sound(mesh)
    assert components(mesh).max() == 1, "a wide and a narrow band"
    r = np.hypot(*mesh.vertices[:, :2].T)[mesh.faces]
    assert (np.ptp(r, axis=1) < 2.0).all()

    def cone(P):
        r = np.hypot(P[..., 0], P[..., 1])
        return np.maximum(r - 35.0 + 0.6 * P[..., 2], np.abs(P[..., 2] - 20.0) - 19.0)

    whole = mesh_grid(clip(scan(rig, cone, 24), Volume(60, 2, 38)))
    assert components(whole).max() == 0
    assert euler(whole) == 0


def test_steep_sides_of_a_box_stay_whole():
    """Spacing grows with incidence; corners and the top's edge are no tears."""
    rig = make_rig(elevation=0.35, lift=20.0)
    grid = clip(scan(rig, box((25, 18, 20), (3, 2, 20), 0.3), 60, 0.05), Volume(60, 2))
    mesh = mesh_grid(grid)
    check_sound(mesh)
    size = np.bincount(components(mesh))
    assert np.sort(size)[-2:].sum() > 0.98 * size.sum(), "front and what lies beyond the axis"


def test_a_jump_between_profiles_is_torn():
    """A pole beside a wall, both seen at the same heights."""
    rig = make_rig(lift=20.0)
    poles = union(
        lambda P: np.hypot(P[..., 0] - 30, P[..., 1]) - 5.0,
        lambda P: np.hypot(P[..., 0] + 30, P[..., 1]) - 5.0,
    )
    mesh = mesh_grid(clip(scan(rig, poles, 90), Volume(60, 5, 35)))
    check_sound(mesh)
    assert (np.ptp(mesh.vertices[mesh.faces][..., 0], axis=1) < 11).all()


def test_noise_alone_tears_little():
    rig = make_rig(lift=20.0, elevation=0.1)
    grid = clip(scan(rig, cylinder(25.0, 0.0, 40.0), 36, noise=0.3), Volume(50, 3, 37))
    mesh = mesh_grid(grid)
    check_sound(mesh)
    full = 36 * 2 * np.mean([np.isfinite(p[:, 0]).sum() - 1 for p in grid.points])
    assert len(mesh.faces) > 0.97 * full


@settings(max_examples=150)
@given(
    seed=st.integers(0, 10_000),
    steps=st.integers(1, 12),
    lines=st.integers(1, 12),
    missing=st.floats(0, 0.95),
    closed=st.booleans(),
    behind=st.sampled_from([0.0, 0.3]),
)
def test_whatever_is_missing_the_mesh_is_sound(seed, steps, lines, missing, closed, behind):
    grid = random_grid(seed, steps, lines, missing, closed, behind)
    for tears in (None, TearLimits(stretch=1.5, jump=0.0)):
        mesh = mesh_grid(grid, tears)
        check_manifold_only(mesh, mixed=behind > 0)
        again = mesh_grid(grid, tears)
        assert mesh.vertices.tobytes() == again.vertices.tobytes()
        assert mesh.faces.tobytes() == again.faces.tobytes()
        apart, _ = cut_touching(mesh)
        check_manifold_only(apart, mixed=behind > 0)
        assert len(apart.faces) <= len(mesh.faces)
        begins = [v for loop in boundary_loops(apart) for v in loop.tolist()]
        assert len(set(begins)) == len(begins), "every border vertex lies on one border"


def check_manifold_only(mesh, mixed):
    if mixed and len(mesh.faces):
        count, _ = sides(mesh)
        assert count.max() <= 2
        return
    check_sound(mesh)


def test_provenance_names_the_place_of_each_vertex():
    grid = random_grid(5, 9, 7, 0.2, True, 0.0)
    mesh = mesh_grid(grid)
    p = mesh.provenance
    assert p.lasers == ("L0",)
    assert np.array_equal(grid.points[p.step, p.line], mesh.vertices)
    assert np.array_equal(grid.sigma[p.step, p.line], p.sigma)


def test_a_cube_is_closed_and_a_part_of_it_is_not():
    rig = make_rig(lift=20.0)
    mesh = mesh_grid(clip(scan(rig, sphere(20.0, (0, 0, 20)), 24), Volume(50, 2)))
    assert not is_closed(mesh)
    half = submesh(mesh, mesh.triangles[:, :, 0].min(axis=1) > 0)
    assert 0 < len(half.faces) < len(mesh.faces)
    assert len(half.provenance.sigma) == len(half.vertices)


def test_tears_are_checked():
    with pytest.raises(ValueError, match="stretch"):
        TearLimits(stretch=0.5)


def test_what_is_long_is_judged_by_the_spacing_not_by_a_length():
    """A ledge of 3 mm is six lines wide; the same length is one step of a coarse turn."""
    ledge = np.where(np.arange(60) < 30, 30.0, 27.0)
    for steps in (18, 72):  # arcs of 10 mm and of 2.6 mm
        mesh = mesh_grid(turned(full_turn(steps), ledge, eyes=False))
        check_sound(mesh)
        assert components(mesh).max() == 1
        assert (np.ptp(np.hypot(*mesh.vertices[:, :2].T)[mesh.faces], axis=1) < 1.0).all()
        assert len(mesh.faces) == 2 * steps * 58, "torn at the ledge and there alone"


def test_a_surface_seen_at_an_angle_may_have_its_wide_spacing():
    """A cone of 76°: points in a row lie 2 mm apart, not 0.5, and none is torn off."""
    slope = 45.0 - 2.0 * np.arange(15)
    profile = np.concatenate([np.full(10, 45.0), slope, np.full(10, slope[-1])])
    mesh = mesh_grid(turned(full_turn(60), profile, eyes=False))
    assert len(mesh.faces) == 2 * 60 * (len(profile) - 1)


def test_a_sigma_larger_than_the_surface_shows_excuses_no_long_side():
    ledge = np.where(np.arange(60) < 30, 30.0, 27.0)
    mesh = mesh_grid(turned(full_turn(72), ledge, sigma=1.0, eyes=False))
    assert components(mesh).max() == 1


@settings(max_examples=40)
@given(step_deg=st.floats(1.0, 40.0), start=st.floats(0.0, 360.0))
def test_the_seam_closes_whatever_the_step(step_deg, start):
    """360° need not be a whole number of steps: the last gap is a smaller one."""
    angles = np.deg2rad(start + step_deg * np.arange(int(360.0 / step_deg)))
    mesh = mesh_grid(turned(angles, np.full(8, 25.0)))
    check_sound(mesh)
    assert euler(mesh) == 0, "a band"


def grazed_wall(degrees: float, leap: float = 0.0) -> RangeGrid:
    """A wall seen at this angle from far away, in noise; its middle step leads ``leap`` mm away."""
    rng = np.random.default_rng(2)
    s, n = 16, 30
    out = 1.5 * np.arange(s) + leap * (np.arange(s) >= s // 2)
    points = np.zeros((s, n, 3))
    points[..., 0] = 150.0 + out[:, None] * np.sin(np.deg2rad(degrees))
    points[..., 1] = out[:, None] * np.cos(np.deg2rad(degrees))
    points[..., 2] = 0.6 * np.arange(n)
    points[..., 1] += 0.05 * rng.standard_normal((s, n))
    return RangeGrid(
        "L0", np.arange(s), 0.01 * np.arange(s), points, np.full((s, n), 0.05),
        np.full((s, n), 100.0), np.zeros((s, n), np.uint16), False,
        np.tile([-1e5, 0.0, 9.0], (s, 1)),
    )  # fmt: skip


def test_a_side_seen_at_just_the_angle_of_tears_has_no_row_of_holes():
    grid = grazed_wall(80.0)
    s, n = grid.flags.shape
    assert len(mesh_grid(grid).faces) == 2 * (s - 1) * (n - 1)
    # Where it leaps from one surface to another it is still torn.
    apart = mesh_grid(grazed_wall(80.0, leap=6.0))
    assert components(apart).max() == 1
    assert len(apart.faces) == 2 * (s - 2) * (n - 1)


@pytest.mark.parametrize("steps", [24, 60, 120])
def test_noise_draws_no_face_deeper_than_its_vertices_lie(steps):
    """Of two diagonals between profiles the shorter one is the deeper one, by noise alone."""
    radius, noise, lines = 25.0, 0.1, 400
    angles = np.arange(steps) * 2 * np.pi / steps
    grid = turned(angles, np.full(lines, radius), sigma=noise)
    out = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    off = np.random.default_rng(steps).normal(0, noise, (steps, lines))
    mesh = mesh_grid(replace(grid, points=grid.points + off[..., None] * out[:, None]))
    ends = np.unique(np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0)
    p = mesh.provenance
    one, other = ends.T
    diagonal = (p.step[one] != p.step[other]) & (p.line[one] != p.line[other])
    x, y = mesh.vertices[ends[diagonal]].mean(axis=1)[:, :2].T
    deep = np.hypot(x, y) - radius * np.cos(np.pi / steps)
    assert len(deep) >= 0.95 * steps * (lines - 1)
    # Each vertex is on two or so: their means differ from none by its noise alone.
    assert abs(deep.mean()) < 4 * noise / np.sqrt(steps * lines)


def test_a_quad_that_leans_is_cut_along_its_shorter_diagonal():
    """Lines that climb from profile to profile, by a row each: the other diagonal spans two."""
    steps, lines, rise = 60, 80, 0.5
    angles = np.arange(steps) * 2 * np.pi / steps
    for way in (1, -1):
        grid = turned(angles, np.full(lines, 25.0))
        points = grid.points.copy()
        points[..., 2] += way * rise * np.arange(steps)[:, None]
        mesh = mesh_grid(replace(grid, points=points, closed=False))
        sides = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        p = mesh.provenance
        one, other = sides[p.step[sides[:, 0]] != p.step[sides[:, 1]]].T
        climbed = np.abs(mesh.vertices[one, 2] - mesh.vertices[other, 2])
        assert climbed.max() < 1.01 * rise

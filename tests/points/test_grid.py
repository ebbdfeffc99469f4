"""Turns, volumes, specks, clouds, profiles and their spacing."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import maximum_filter

from tests.analytic import cylinder, full_turn, make_rig, scan_shape, sphere, union
from tests.points.grids import plain_grid
from turnscan.errors import Degenerate, InputError, LimitExceeded
from turnscan.points import (
    Along,
    Volume,
    angle_findings,
    build_grid,
    clip,
    cloud,
    drop_specks,
    every,
    grid_findings,
    lost_frames,
    profiles,
    resample,
    view_mask,
    whole_turns,
    widened,
    without,
    working_volume,
)
from turnscan.points._build import goes_round
from turnscan.points._triangulate import beyond_axis
from turnscan.remedy import Remedy
from turnscan.rig import Marker, Pose, Rig
from turnscan.stripes import StripeFlag


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("step_deg", [1.8, 2.25, 7.0, 11.0])
def test_a_full_turn_closes_even_when_it_is_not_a_whole_number_of_steps(step_deg, sign):
    count = int(np.ceil(360 / step_deg - 1e-9))
    angles = sign * np.deg2rad(step_deg) * np.arange(count) + 0.4
    assert goes_round(angles)
    assert goes_round(np.arctan2(np.sin(angles), np.cos(angles))), "angles given modulo 360°"
    assert not goes_round(angles[: count - 3])
    assert goes_round(angles[::2]) == (360 - (count - 1) // 2 * 2 * step_deg <= 5 * step_deg)


def test_a_turn_that_goes_on_is_cut_and_said():
    angles = np.deg2rad(10.0) * np.arange(40)
    points = np.zeros((40, 2, 3)) + np.arange(40)[:, None, None]
    (turn,), again = whole_turns(plain_grid(points, angles))
    assert again == 4
    assert len(turn.steps) == 36
    assert turn.closed
    assert [f.code for f in angle_findings(turn, again)] == ["points.second-turn"]
    assert not goes_round([0.0, 0.1])
    assert not goes_round([0.0, 2.0, 1.0, 3.0])


@pytest.mark.parametrize("sign", [1, -1])
def test_every_whole_turn_is_a_grid_of_its_own(sign):
    angles = sign * np.deg2rad(7.0) * np.arange(130)  # 910°: two turns and a half
    points = np.zeros((130, 2, 3)) + np.arange(130)[:, None, None]
    turns, left = whole_turns(plain_grid(points, angles))
    assert [t.closed for t in turns] == [True, True]
    assert sum(len(t.steps) for t in turns) + left == 130
    assert list(turns[1].steps[:2]) == [len(turns[0].steps), len(turns[0].steps) + 1]
    first = np.abs(np.rad2deg(turns[1].angles[0] - turns[0].angles[0]))
    assert 356.5 <= first <= 363.5
    assert left == 130 - sum(len(t.steps) for t in turns) > 20


def test_every_nth_profile():
    grid = plain_grid(np.zeros((10, 4, 3)))
    assert list(every(grid, 3).steps) == [0, 3, 6, 9]
    with pytest.raises(InputError, match="every 0 steps"):
        every(grid, 0)


def test_findings_tell_open_turns_uneven_steps_and_lost_frames():
    angles = np.array([0.0, 0.1, 0.2, 0.6, 0.7])
    codes = [f.code for f in angle_findings(plain_grid(np.zeros((5, 2, 3)), angles), 0)]
    assert codes == ["points.uneven-steps", "points.open-turn"]
    lost = lost_frames("L0", {3: "camera timed out", 4: "camera timed out"}, 2)
    assert [f.code for f in lost] == ["points.missing-frames", "points.no-angle"]
    assert "2 steps have no frame (3, 4): camera timed out" in lost[0].message
    nothing = plain_grid(np.full((2, 3, 3), np.nan))
    assert grid_findings(nothing, nothing, Volume())[0].severity == "error"


def test_findings_tell_what_share_of_the_points_was_flagged():
    found = plain_grid(np.zeros((10, 10, 3)))
    flags = np.zeros((10, 10), np.uint16)
    flags[:2] = StripeFlag.HALO
    flags[5, 5] = StripeFlag.SATURATED
    flags[4:] |= np.uint16(StripeFlag.EDGE)
    flagged = replace(found, flags=flags)
    told = grid_findings(found, flagged, Volume())
    assert [f.code for f in told] == ["points.volume", "points.halo"]
    assert told[0].message.startswith("100 points kept; 0 removed, outside")
    assert told[1].message.startswith("20% of the points are shifted by a halo, by how much is not")
    sizes = np.full((10, 10), np.nan, np.float32)
    sizes[:2] = np.linspace(0.1, 0.3, 20).reshape(2, 10)
    (halo,) = grid_findings(found, replace(flagged, halo=sizes), Volume())[1:]
    sigma = np.median(flagged.sigma[:2])
    size = "half by 0.2 mm or more, 5 % by more than 0.29 mm"
    assert halo.message == f"20% of the points are shifted by a halo: {size} (sigma {sigma:.2g} mm)"


def test_a_stripe_s_halo_becomes_millimetres_along_the_sheet_and_stays_through_parts_of_a_grid():
    rig, angles = make_rig(lift=28.0), full_turn(12)
    stripes = scan_shape(rig, cylinder(20.0, 0.0, 60.0), angles)
    halo = np.where(stripes[1].found, -0.5, np.nan)
    seen = [replace(s, halo=halo) if k == 1 else s for k, s in enumerate(stripes)]
    aside = [replace(s, position=s.position + 0.5) for s in stripes]
    plain, grid, moved = (
        build_grid(rig, "L0", s, range(12), angles) for s in (stripes, seen, aside)
    )
    there = grid.found[1]
    assert plain.halo is None
    assert grid.halo is not None
    assert np.array_equal(~np.isnan(grid.halo[1]), there)
    assert np.isnan(grid.halo[2:]).all()
    true = np.linalg.norm(moved.points[1] - plain.points[1], axis=-1)
    assert grid.halo[1, there] == pytest.approx(true[there], rel=0.02)
    assert np.array_equal(every(grid, 2).halo, grid.halo[::2], equal_nan=True)
    few = grid.of_lines(slice(80, 120))
    assert np.array_equal(few.halo, grid.halo[:, 80:120], equal_nan=True)
    coarser = resample(grid, Along(5.0, "arc"))
    assert np.nanmax(coarser.halo) == pytest.approx(np.nanmax(grid.halo), rel=0.1)
    assert np.isnan(coarser.halo[2:]).all()


def test_a_point_s_own_noise_is_its_stripe_s_and_stays_through_parts_of_a_grid():
    rig, angles = make_rig(lift=28.0), full_turn(60)
    stripes = scan_shape(rig, sphere(18.0, (7.0, 2.0, 28.0)), angles)
    known = build_grid(rig, "L0", stripes, range(60), angles)
    shaky = build_grid(rig, "L0", stripes, range(60), angles, np.full(60, 0.06))
    there = known.found
    assert np.array_equal(~np.isnan(known.noise), there)
    assert np.array_equal(shaky.noise, known.noise, equal_nan=True), (
        "an angle moves a whole profile"
    )
    assert (known.noise[there] <= known.sigma[there] * (1 + 1e-6)).all()
    assert np.median(shaky.sigma[there] / shaky.noise[there]) > 1.5
    assert np.array_equal(every(shaky, 2).noise, shaky.noise[::2], equal_nan=True)
    few = shaky.of_lines(slice(80, 120))
    assert np.array_equal(few.noise, shaky.noise[:, 80:120], equal_nan=True)
    half = replace(shaky, noise=(shaky.sigma / 2).astype(np.float32))
    other = resample(half, Along(2.0))
    some = other.found
    assert other.noise[some] == pytest.approx(other.sigma[some] / 2, rel=1e-6)


@pytest.mark.parametrize(
    ("strategy", "advised", "word"),
    [
        ("window", True, "measured already"),
        ("centroid", True, "core of the stripe alone"),
        ("blais-rioux", False, "measured already"),
    ],
)
def test_a_halo_is_answered_by_what_was_not_done(strategy, advised, word):
    found = plain_grid(np.zeros((2, 2, 3)))
    found = replace(found, flags=np.full((2, 2), StripeFlag.HALO, np.uint16))
    said = grid_findings(found, found, Volume(), strategy)
    (remedy,) = (f.remedy for f in said if f.code == "points.halo")
    assert word in str(remedy)
    assert "matting spray" in str(remedy)
    options = remedy.options if isinstance(remedy, Remedy) else ()
    assert [(o.name, o.value) for o in options] == [("strategy", "blais-rioux")] * advised


@pytest.mark.parametrize(("lines", "said"), [(3, True), (4, True), (5, False)])
def test_profiles_too_low_to_tell_their_noise_are_named(lines, said):
    """Twenty times four lines in a row tell it: in 19 profiles, of five points each."""
    points = np.full((19, 9, 3), np.nan)
    points[:, 2 : 2 + lines] = 1.0
    found = plain_grid(points)
    named = [f for f in grid_findings(found, found, Volume()) if f.code == "points.few-lines"]
    assert len(named) == said
    assert all(f"at most {lines} points" in f.message for f in named)
    refined = replace(found, flags=np.where(found.found, StripeFlag.REFINED, 1).astype(np.uint16))
    assert not any(f.code == "points.few-lines" for f in grid_findings(refined, refined, Volume()))


def test_an_unsure_angle_of_the_table_is_in_the_sigma_of_what_it_carries_off_its_surface():
    """A ball beside the axis, each step's angle off by its own noise, and nothing else."""
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = full_turn(90)
    shaky = np.deg2rad(0.5)
    stripes = scan_shape(rig, sphere(20.0, (14.0, 3.0, 25.0)), angles)
    z = []
    for seed in range(3):
        told = angles + np.random.default_rng(seed).normal(0, shaky, 90)
        sure = build_grid(rig, "L0", stripes, range(90), angles, np.zeros(90))
        grid = build_grid(rig, "L0", stripes, range(90), told, np.full(90, shaky))
        off = np.linalg.norm(grid.points - (14.0, 3.0, 25.0), axis=-1) - 20.0
        carried = np.sqrt(np.maximum(grid.sigma**2 - sure.sigma**2, 0.0))
        # Where the turn leads along the surface the sphere's curvature is all there is.
        much = grid.found & (carried > 0.03)
        z.append(off[much] / carried[much])
    assert sum(map(len, z)) > 2000
    assert np.sqrt(np.mean(np.concatenate(z) ** 2)) == pytest.approx(1.0, abs=0.25)


def test_the_platter_disappears_and_the_part_stays():
    """A part on a wide platter: only the part is left, and all of it."""
    rig = make_rig(elevation=0.3, lift=25.0)
    scene = union(cylinder(25.0, 0.0, 40.0), cylinder(120.0, -5.0, 0.0))
    angles = full_turn(4)
    grid = build_grid(rig, "L0", scan_shape(rig, scene, angles), range(4), angles)
    volume = Volume(r_max=60.0, z_min=1.0)
    kept = clip(grid, volume)
    gone = grid.found & ~kept.found
    assert gone.sum() > 20
    assert (kept.flags[gone] == StripeFlag.OUTSIDE).all()
    assert np.isnan(kept.sigma[gone]).all()
    z, r = kept.points[kept.found][:, 2], np.hypot(*kept.points[kept.found][:, :2].T)
    assert z.min() >= 1.0
    assert r.max() <= 25.0 + 1e-9
    on_part = grid.found & (np.hypot(grid.points[..., 0], grid.points[..., 1]) < 25.0 + 1e-6)
    assert (kept.found == (on_part & (grid.points[..., 2] >= 1.0))).all()


def test_what_may_as_well_lie_on_the_platter_is_platter():
    points = np.array([[[20.0, 0.0, z] for z in (1.9, 2.1, 2.9, 3.1)]])
    unsure, sure = plain_grid(points, sigma=0.6), plain_grid(points, sigma=0.4)
    floor = Volume(z_min=2.0)
    assert clip(unsure, floor).found.tolist() == [[False, False, False, True]]
    assert clip(sure, floor).found.tolist() == [[False, True, True, True]]
    assert (clip(unsure, floor).flags[0, :3] == StripeFlag.OUTSIDE).all()
    # Where the platter is to be seen, nothing of it goes; where sigma is not known, nothing more.
    assert clip(unsure, Volume(z_min=-1.0)).found.all()
    assert clip(plain_grid(points, sigma=np.nan), floor).found.tolist() == [
        [False, True, True, True]
    ]


def test_the_automatic_volume_knows_what_the_rig_sees():
    rig = make_rig()
    reach = working_volume(rig, "L0")
    c = rig.camera
    gamma = np.arctan((c.width - 1 - c.cx) / c.fx)
    r_max = 490.0 * np.sin(gamma) / np.sin(np.deg2rad(25.0) + gamma)
    assert reach.r_max == pytest.approx(r_max, rel=1e-3)  # paper, (8) and Table 1
    assert reach.z_min == 2.0
    corners = np.array([[50, -5, 0], [60, -5, 0], [60, 5, 0], [50, 5, 0.0]])
    marked = Rig(c, rig.sheets, rig.T_camera_table, (Marker("DICT_4X4_50", 1, corners),))
    assert working_volume(marked, "L0").r_max == pytest.approx(np.hypot(60, 5))
    # A camera right above the axis has nothing before it.
    above = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 300.0]))
    with pytest.raises(Degenerate, match=r"laser 'L0': .* no distance from the rotation axis"):
        working_volume(replace(rig, T_camera_table=above), "L0")
    with pytest.raises(ValueError, match="holds no point"):
        Volume(z_min=3.0, z_max=2.0)


def test_the_mask_shows_the_volume_and_nothing_else():
    rig = make_rig(elevation=0.3, lift=25.0)
    volume = Volume(r_max=40.0, z_min=2.0, z_max=50.0)
    mask = view_mask(rig, "L0", volume)
    u, v = np.meshgrid(np.arange(320.0), np.arange(240.0))
    X = rig.sheet("L0").intersect(rig.camera.rays(np.stack([u, v], -1)))
    assert (mask == volume.contains(rig.T_camera_table.inverse().apply(X))).all()
    assert 500 < mask.sum() < mask.size / 2
    wide = view_mask(rig, "L0", volume, margin=8)
    assert wide[mask].all()
    assert np.flatnonzero(wide.any(axis=1))[0] == np.flatnonzero(mask.any(axis=1))[0] - 8


@pytest.mark.parametrize("margin", [0, 1, 2, 5, 8, 40])
def test_a_margin_is_a_square_round_each_pixel_cut_by_the_picture(margin):
    seen = np.random.default_rng(margin).random((37, 23)) < 0.01
    seen[[0, -1], [-1, 0]] = True
    wide = widened(seen, margin)
    assert (wide == maximum_filter(seen, 2 * margin + 1, mode="constant")).all()
    assert wide.flags.c_contiguous


@given(
    elevation=st.floats(0.05, 0.9),
    lift=st.floats(-60, 90),
    r_max=st.floats(3, 200),
    z_min=st.floats(-80, 40),
    lens=st.sampled_from([(0, 0, 0, 0, 0), (-0.3, 0.1, 0.002, -0.001, 0), (0.2, 0.4, 0, 0, 0.1)]),
    bow=st.sampled_from([(0, 0, 0), (2e-3, 0, 1e-3), (-3e-3, 1e-3, 0)]),
    rival=st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_the_mask_is_what_every_pixel_for_itself_sees(
    elevation, lift, r_max, z_min, lens, bow, rival
):
    look = {"bow": bow, "distortion": lens, "lasers": (0.45, -0.3)}
    rig = make_rig(elevation=elevation, lift=lift, **look)
    volume = Volume(r_max, z_min, z_min + 70.0)
    v, u = np.mgrid[:240, :320].astype(float)
    rays = rig.camera.rays(np.stack([u, v], -1))

    def sees(name, near):
        X = rig.sheet(name).intersect(rays)
        there = volume.contains(rig.T_camera_table.inverse().apply(X))
        return there & ~beyond_axis(rig, name, X) if near else there

    each = sees("L0", rival)
    if rival:
        each &= ~sees("L1", True)
    mask = view_mask(rig, "L0", volume, others=["L1"] if rival else [])
    assert (mask == each).all()


def test_specks_go_and_runs_stay():
    points = np.full((2, 12, 3), np.nan)
    points[0, [0, 1, 5, 6, 7, 11]] = 1.0
    points[1, :] = 2.0
    kept = drop_specks(plain_grid(points), 3)
    assert list(np.flatnonzero(kept.found[0])) == [5, 6, 7]
    assert kept.found[1].all()
    assert kept.flags[0, 0] == StripeFlag.AMBIGUOUS


def test_what_is_taken_away_keeps_what_was_known_of_its_light_and_gets_a_new_cause():
    grid = plain_grid(np.ones((1, 3, 3)))
    flags = [[StripeFlag.SATURATED | StripeFlag.HALO | StripeFlag.AMBIGUOUS, StripeFlag.HALO, 0]]
    grid = replace(grid, flags=np.array(flags, np.uint16))
    left = without(grid, np.array([[True, False, True]]), StripeFlag.OUTSIDE)
    assert left.flags[0, 0] == StripeFlag.SATURATED | StripeFlag.HALO | StripeFlag.OUTSIDE
    assert left.flags[0, 1] == StripeFlag.HALO
    assert left.flags[0, 2] == StripeFlag.OUTSIDE
    assert list(left.found[0]) == [False, True, False]


def test_the_cloud_keeps_its_provenance():
    points = np.full((2, 3, 3), np.nan)
    points[1, 2] = 5.0
    grid = plain_grid(points)
    got = cloud([grid, grid])
    assert got.lasers == ("L0", "L0")
    assert list(got.laser) == [0, 1]
    assert list(got.step) == [1, 1]
    assert list(got.line) == [2, 2]
    assert len(cloud([]).points) == 0


def test_profiles_break_at_gaps_and_jumps():
    points = np.zeros((1, 10, 3))
    points[0, :, 2] = np.arange(10)
    points[0, 3] = np.nan
    points[0, 7:, 0] = 50.0
    runs = profiles(plain_grid(points))[0]
    assert [list(p.lines) for p in runs] == [[0, 1, 2], [4, 5, 6], [7, 8, 9]]
    assert all(p.step == 0 and p.laser == "L0" for p in runs)


def test_equal_heights_lie_on_the_surface_between_its_points():
    rig = make_rig(elevation=0.2, lift=25.0, offset=0.5)
    angles = full_turn(6)
    stripes = scan_shape(rig, sphere(30.0, (2.0, 1.0, 25.0)), angles)
    grid = build_grid(rig, "L0", stripes, range(6), angles)
    new = resample(grid, Along(2.0))
    z = new.points[..., 2]
    passed = np.abs(z / 2 - np.round(z / 2)) < 1e-9
    flank = np.abs(z - 25.0) < 20.0
    assert passed[flank].all(), "only level parts and ends need other heights"
    assert np.array_equal(np.nanmax(z, axis=1), np.nanmax(grid.points[..., 2], axis=1))
    assert np.array_equal(np.nanmin(z, axis=1), np.nanmin(grid.points[..., 2], axis=1))
    off = np.linalg.norm(new.points[new.found] - [2, 1, 25], axis=1) - 30
    assert off.min() > -0.03
    assert off.max() < 1e-9, "a chord lies inside the ball"
    assert new.closed
    usual = np.nanmedian(grid.sigma)
    assert 0.6 * usual < np.nanmedian(new.sigma) < usual


@pytest.mark.parametrize("part", [0.1, 0.3, 0.5, 0.8])
def test_a_point_between_two_has_the_noise_that_it_takes_from_each(part):
    """A good point 1 mm below a poor one; the new point lies nearer to one of them."""
    rng = np.random.default_rng(4)
    count, good, poor = 4000, 0.01, 0.1
    points = np.zeros((count, 2, 3))
    points[:, :, 2] = -part, 1.0 - part
    points[:, 0, 0] = rng.normal(0, good, count)
    points[:, 1, 0] = rng.normal(0, poor, count)
    new = resample(plain_grid(points, sigma=np.tile([good, poor], (count, 1))), Along(0.3))
    level = np.abs(new.points[..., 2]) < 1e-9
    assert (level.sum(axis=1) == 1).all()
    z = new.points[level][:, 0] / new.sigma[level]
    # 4000 profiles: the scatter is known to 1.1 %.
    assert z.std() == pytest.approx(1.0, abs=0.05)
    assert new.amplitude[level] == pytest.approx(50.0)


def test_a_line_is_one_height_in_all_profiles_as_far_as_they_pass_it_once():
    z = np.linspace(40, 3, 80) + np.array([0.3, -0.9, 1.7])[:, None]
    points = np.stack([20 + 0 * z, 0 * z, z], axis=-1)
    points[1, :9] = np.nan
    new = resample(plain_grid(points), Along(2.0))
    z = new.points[..., 2]
    high = np.where(np.abs(z / 2 - np.round(z / 2)) < 1e-9, z, np.nan)
    common = high[:, (~np.isnan(high)).sum(axis=0) == 3]
    assert common.shape[1] >= 15
    assert np.ptp(common, axis=0).max() < 1e-9


def test_equal_arc_length():
    t = np.linspace(0, np.pi, 400)
    arc = np.stack([np.sin(t), 0 * t, -np.cos(t)], axis=-1)[None] * 20
    new = resample(plain_grid(arc), Along(1.5, "arc"))
    p = new.points[0][new.found[0]]
    sides = np.linalg.norm(np.diff(p, axis=0), axis=1)
    assert np.allclose(sides[:-1], 1.5, rtol=1e-3)
    assert 0.25 * 1.5 <= sides[-1] < 1.26 * 1.5
    assert np.array_equal(p[0], arc[0, 0])
    assert np.array_equal(p[-1], arc[0, -1])


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000), spacing=st.floats(0.3, 5), by=st.sampled_from(["height", "arc"])
)
def test_new_points_never_bridge_a_gap(seed, spacing, by):
    rng = np.random.default_rng(seed)
    points = np.zeros((3, 30, 3))
    points[..., 2] = np.arange(30) + rng.normal(0, 0.2, (3, 30))
    points[..., 0] = rng.normal(0, 0.2, (3, 30))
    points[rng.random((3, 30)) < 0.3] = np.nan
    grid = plain_grid(points)
    new = resample(grid, Along(spacing, by))
    for k in range(3):
        old = points[k]
        for p in new.points[k][new.found[k]]:
            pairs = itertools.pairwise(old)
            ends = [(a, b) for a, b in pairs if not np.isnan(a + b).any()]
            ends += [(a, a) for a in old if not np.isnan(a[0])]
            near = min(
                np.linalg.norm(p - a) + np.linalg.norm(p - b) - np.linalg.norm(a - b)
                for a, b in ends
            )
            assert near < 1e-9


def test_spacing_is_checked():
    grid = plain_grid(np.random.default_rng(0).normal(size=(2, 9, 3)))
    with pytest.raises(InputError, match="spacing 0"):
        Along(0.0)
    with pytest.raises(LimitExceeded, match="points a profile"):
        resample(grid, Along(1e-9))
    nothing = plain_grid(np.full((2, 3, 3), np.nan))
    assert resample(nothing, Along(1.0)) is nothing

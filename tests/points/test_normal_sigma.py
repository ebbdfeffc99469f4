"""Sigma of a point along the normal of its surface, against exact scans with known noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic import box, full_turn, make_rig, scan_shape, sphere, with_noise
from turnscan.points import RangeGrid, build_grid, normal_sigma
from turnscan.points import _normal_kernels as kernels
from turnscan.points import _normal_sigma as sigmas

NOISE = 0.08
"""px."""


def shares(points, moves, doubt, *, told=None, noise=0.0):
    """What the kernel of that name writes of profiles a millimetre apart, each point with so much
    ``doubt`` (s, n) mm and ``noise`` mm; ``told`` (s, n) by the stripes' widths."""
    size = points.shape[:2]
    nothing = np.full(size, np.nan) if told is None else told
    out = np.empty(size)
    kernels.shares(
        points,
        (doubt, np.hypot(doubt, noise)),
        moves,
        nothing.astype(np.float32),
        np.ones(size),
        (0.64, 0.2),
        False,
        (0, size[0]),
        out,
    )
    return out


def round_part(steps: int) -> RangeGrid:
    rig = make_rig()
    angles = full_turn(steps)
    exact = scan_shape(rig, sphere(22.0, (3.0, -2.0, 24.0)), angles)
    # Made without light: their width says nothing.
    stripes = [replace(s, width=np.full(len(s.width), np.nan)) for s in with_noise(exact, NOISE, 3)]
    return build_grid(rig, "L0", stripes, range(steps), angles)


@pytest.fixture(scope="module")
def ball() -> RangeGrid:
    return round_part(36)


def test_errors_off_a_ball_are_as_large_as_the_sigma_along_its_normal_says(ball):
    off = np.linalg.norm(ball.points[ball.found] - (3.0, -2.0, 24.0), axis=1) - 22.0
    sigma = normal_sigma(ball)[ball.found]
    z = off / sigma
    assert 0.93 < np.sqrt((z**2).mean()) < 1.05
    assert np.sqrt(((off / ball.sigma[ball.found]) ** 2).mean()) < 0.9, "along the sheet: too much"
    # Also near the poles by themselves, where little of a centre's error leads off the ball.
    pole = np.abs(ball.points[ball.found][:, 2] - 24.0) > 17.0
    assert 0.8 < np.sqrt((z[pole] ** 2).mean()) < 1.1


@pytest.mark.parametrize("steps", [60, 120, 200])
def test_on_a_face_that_turns_away_an_error_is_as_large_as_said_over_long_steps(steps):
    """Beside the axis a plate's face turns away from the light: its profiles lie up to four usual
    steps from each other, and a third of what moves a point leads off it."""
    rig, angles = make_rig(), full_turn(steps)
    exact = scan_shape(rig, box((26.0, 4.0, 25.0), (0.0, 0.0, 25.0), 0.0), angles)
    stripes = [replace(s, width=np.full(len(s.width), np.nan)) for s in with_noise(exact, NOISE, 3)]
    grid = build_grid(rig, "L0", stripes, range(steps), angles)
    x, y, z = np.moveaxis(grid.points, -1, 0)
    face = grid.found & (np.abs(np.abs(y) - 4.0) < 0.5) & (z > 4.0) & (z < 46.0)
    away = face & (np.abs(x) > 9.0) & (np.abs(x) < 20.0)
    assert away.sum() > 200
    off, sigma = np.abs(y[away]) - 4.0, normal_sigma(grid)[away]
    assert 0.85 < np.sqrt(np.mean((off / sigma) ** 2)) < 1.1
    assert np.sqrt(np.mean((off / grid.sigma[away]) ** 2)) < 0.6, "along the sheet: too much"


@pytest.mark.parametrize("steps", [18, 24])
def test_round_parts_in_coarse_steps_state_what_leads_off_them(steps):
    """Chords to the profiles before and after lie a step apart there, and neither as the surface
    does; the largest that either claims is a tenth too much where the light comes aslant."""
    grid = round_part(steps)
    X, along = grid.points[grid.found] - (3.0, -2.0, 24.0), grid.sigma[grid.found]
    off, sigma = np.linalg.norm(X, axis=1) - 22.0, normal_sigma(grid)[grid.found]
    aslant = (np.abs(X[:, 2]) < 16.0) & (sigma < 0.95 * along)
    assert aslant.sum() > 500
    assert 0.92 < np.sqrt(np.mean((off[aslant] / sigma[aslant]) ** 2)) < 1.1


def test_it_is_never_more_than_along_the_sheet_nor_missing_where_that_is_known(ball):
    sigma = normal_sigma(ball)
    assert np.array_equal(np.isnan(sigma), np.isnan(ball.sigma))
    assert (sigma[ball.found] <= ball.sigma[ball.found]).all()
    assert (sigma[ball.found] > 0).all()


def test_without_an_eye_or_a_sheet_it_stays_as_it_is(ball):
    assert np.array_equal(normal_sigma(replace(ball, eyes=None)), ball.sigma, equal_nan=True)
    anywhere = np.random.default_rng(0).normal(0.0, 20.0, ball.points.shape)
    loose = replace(ball, points=np.where(ball.found[..., None], anywhere, np.nan))
    assert np.array_equal(normal_sigma(loose), ball.sigma, equal_nan=True)


@pytest.mark.parametrize(("bend", "wanted"), [(0.0, 0.5), (20.0, 0.76), (60.0, 1.0)])
def test_noise_raises_no_share_and_an_edge_has_that_of_its_worse_side(bend, wanted):
    """A surface that turns by ``bend`` degrees at its middle profile, moved at 60° to its normal:
    along that of the other side."""
    steps, lines, apart = 21, 400, 1.0
    rng = np.random.default_rng(5)
    across = apart * (np.arange(steps) - 10.0)
    after = across > 0
    turn = np.deg2rad(bend)
    x = np.where(after, np.cos(turn) * across, across)
    z = np.where(after, -np.sin(turn) * across, 0.0)
    points = np.empty((steps, lines, 3))
    points[..., 0], points[..., 2] = x[:, None], z[:, None]
    points[..., 1] = 0.4 * np.arange(lines)
    points[..., 2] += rng.normal(0.0, 0.08, (steps, lines))
    moves = np.tile([np.sqrt(0.75), 0.0, 0.5], (steps, lines, 1))
    share = shares(points, moves, np.zeros(points.shape[:2]))
    middle = share[10, 20:-20]
    assert np.median(middle) == pytest.approx(wanted, abs=0.03)


def _collars(P):
    """A turned part: its radius steps by 1 mm every three lines or so."""
    r, z = np.hypot(P[..., 0], P[..., 1]), P[..., 2]
    wide = np.where(np.floor(z / 2.2) % 2 == 0, 20.0, 19.0)
    return np.maximum(r - wide, np.maximum(4.0 - z, z - 44.0))


def _off_collars(P):
    """mm from points to the profile of `_collars`: the nearer of its faces and its steps."""
    r, z = np.hypot(P[..., 0], P[..., 1]), P[..., 2]
    edges = 2.2 * np.arange(2, 21)
    part = np.floor(z / 2.2) % 2
    face = np.abs(r - np.where(part == 0, 20.0, 19.0))
    beyond = np.maximum(np.maximum(19.0 - r, r - 20.0), 0.0)
    step = np.hypot(beyond, np.abs(z[..., None] - edges).min(axis=-1))
    return np.minimum(face, step)


@pytest.mark.parametrize("steps", [24, 60])
def test_chords_across_collars_a_few_lines_wide_lower_no_sigma(steps, monkeypatch):
    rig = make_rig(lift=20.0)
    angles = full_turn(steps)
    exact = scan_shape(rig, _collars, angles)
    stripes = [replace(s, width=np.full(len(s.width), np.nan)) for s in with_noise(exact, NOISE, 3)]
    grid = build_grid(rig, "L0", stripes, range(steps), angles)
    found = grid.found & (grid.points[..., 2] > 6.0) & (grid.points[..., 2] < 42.0)
    off = _off_collars(grid.points[found])

    def sizes():
        return off / normal_sigma(grid)[found]

    z, of_noise = sizes(), 0.0027
    assert 0.93 < np.sqrt((z**2).mean()) < 1.05, "nor does it raise any"
    monkeypatch.setattr(sigmas, "_bent", lambda grid, moves, far: np.zeros_like(grid.found))
    assert (z > 3.0).mean() < of_noise < (sizes() > 3.0).mean()


def test_the_error_of_a_point_does_not_change_what_is_claimed_of_it():
    """A wall that is moved at 30° to its normal; one point lies off along that way."""
    points = np.empty((21, 200, 3))
    points[..., 0], points[..., 1] = 1.0 * np.arange(21)[:, None], 0.4 * np.arange(200)
    points[..., 2] = 0.0
    moves = np.tile([0.5, 0.0, np.sqrt(0.75)], (21, 200, 1))
    points[10, 100] += 0.05 * moves[10, 100]
    share = shares(points, moves, np.zeros((21, 200)))
    assert share[10, 100] == pytest.approx(np.sqrt(0.75), abs=1e-12)


@pytest.mark.parametrize("doubted", [0.0, 0.2, 1.0, 5.0])
def test_the_plane_through_doubted_points_may_lie_otherwise_by_as_much(doubted):
    """A veil: a plane that leads along the way of its points' errors. None of it is a surface."""
    points = np.empty((21, 200, 3))
    points[..., 0], points[..., 1] = 1.0 * np.arange(21)[:, None], 0.4 * np.arange(200)
    points[..., 2] = 0.0
    moves = np.tile([0.98, 0.0, np.sqrt(1 - 0.98**2)], (21, 200, 1))
    doubt = np.zeros((21, 200))
    doubt[8:13] = doubted
    share = shares(points, moves, doubt)
    assert share[3, 20:-20] == pytest.approx(moves[0, 0, 2], abs=1e-12), "far from what is doubted"
    # Profiles 2 mm apart, both ends off by the doubt, tilt their chord by so much.
    tilt = np.sqrt(2) * doubted / 2.0
    most = np.arctan2(moves[0, 0, 2], max(moves[0, 0, 0] - tilt, 0.0))
    assert (share[10, 20:-20] <= 1.0).all()
    assert np.median(share[10]) >= 0.97 * np.sin(most)
    assert (np.median(share[10]) > 0.99) == (doubted >= 5.0)


def folded(bend):
    """A surface that turns by ``bend`` degrees half-way between its profiles 10 and 11, and the way
    in which its points err: at 60° to its normal before that."""
    across, turn = 1.0 * np.arange(21) - 10.5, np.deg2rad(bend)
    points = np.empty((21, 40, 3))
    points[..., 0] = np.where(across > 0, np.cos(turn) * across, across)[:, None]
    points[..., 1] = 0.4 * np.arange(40)
    points[..., 2] = np.where(across > 0, -np.sin(turn) * across, 0.0)[:, None]
    return points, np.tile([np.sqrt(0.75), 0.0, 0.5], (21, 40, 1))


@pytest.mark.parametrize(
    ("told", "wanted"), [(0.5, 0.5), (0.6, 0.6), (0.75, 0.75), (1.0, "worse"), (np.nan, "worse")]
)
def test_beside_an_edge_the_width_tells_which_side_a_point_lies_on(told, wanted):
    """Its chord to the other side leads neither way; those before it go straight on."""
    points, moves = folded(60.0)
    none = np.zeros((21, 40))
    worse = shares(points, moves, none, noise=0.02)
    share = shares(points, moves, none, told=np.full((21, 40), told), noise=0.02)
    inner = slice(2, -2)
    assert np.median(worse[10]) > 0.85
    if wanted == "worse":
        assert share[10, inner] == pytest.approx(worse[10, inner])
    else:
        assert share[10, inner] == pytest.approx(wanted, abs=1e-6)
    assert share[:9] == pytest.approx(worse[:9]), "far from the edge chords tell"
    assert share[10, [0, -1]] == pytest.approx(worse[10, [0, -1]]), "the last of a run may be cut"


def test_where_chords_on_both_sides_go_straight_on_the_width_does_not_decide():
    """A crease on a profile itself: it may be of either side."""
    points, moves = folded(60.0)
    points[11] = points[10] + (points[10] - points[9]) * 0.5  # both planes go through profile 11
    points[12:] += points[11] - (points[12] - (points[13] - points[12]))
    none = np.zeros((21, 40))
    worse = shares(points, moves, none, noise=0.02)
    share = shares(points, moves, none, told=np.full((21, 40), 0.5), noise=0.02)
    assert share[11] == pytest.approx(worse[11])


def test_a_profile_by_itself_has_what_its_width_tells():
    points, moves = folded(0.0)
    points[[9, 11]] = np.nan
    none, told = np.zeros((21, 40)), np.full((21, 40), 0.7)
    alone = shares(points, moves, none, told=told)[10]
    assert alone[1:-1] == pytest.approx(0.7)
    assert (alone[[0, -1]] == 1.0).all(), "the last of a run may be cut"
    assert (shares(points, moves, none)[10] == 1.0).all(), "where nothing tells"

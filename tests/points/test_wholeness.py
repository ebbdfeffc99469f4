"""How whole a stripe was: by Gaussians that are cut, and rays that meet planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from tests.analytic import box, full_turn, make_rig, scan_shape, sphere, with_noise
from turnscan.points import Volume, build_grid, every, grid_findings, pixels_of
from turnscan.points import _wholeness_kernels as kernels
from turnscan.points._build import take_steps
from turnscan.points._creased import Widths, creased
from turnscan.points._cut import by_width
from turnscan.points._lit_points import LitPoints
from turnscan.points._wholeness import _faint_between, _narrow, _round, wholeness
from turnscan.rig import rotation_z

S, N = 14, 12


def across(*given, least=0.0):
    out = np.full((3, 2, *given[0].shape[:2]), np.nan)
    kernels.across(*given[:-1], least, given[-1], (0, len(given[0])), out)
    return out


def plane(rng):
    """Points (S, N, 3) of a plane in general position, its normal, and eyes far from it."""
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    a, b = np.meshgrid(0.5 * np.arange(S), 0.3 * np.arange(N), indexing="ij")
    points = np.array([30.0, -20.0, 40.0]) + a[..., None] * turn[0] + b[..., None] * turn[1]
    eyes = points[:, 0] + 500.0 * (turn[2] + 0.3 * rng.standard_normal((S, 3)))
    return points, turn[2], eyes


@pytest.mark.parametrize("seed", range(4))
def test_a_surface_between_profiles_lies_to_the_light_as_rays_that_meet_it(seed):
    rng = np.random.default_rng(seed)
    points, normal, eyes = plane(rng)
    moves = 0.1 * rng.standard_normal(points.shape)
    sheets = rng.standard_normal(points.shape)
    sheets /= np.linalg.norm(sheets, axis=-1, keepdims=True)
    walk, slide, side = across(points, eyes, moves, sheets, np.ones((S, N)), False)
    small = 1e-4
    ray = points + small * moves - eyes[:, None]
    met = eyes[:, None] + ray * (((points - eyes[:, None]) @ normal) / (ray @ normal))[..., None]
    way = np.abs(np.einsum("sni,sni->sn", met - points, sheets)) / small
    turned = np.stack([-points[..., 1], points[..., 0], 0 * points[..., 0]], -1)
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    towards = (points - eyes[:, None]) / np.linalg.norm(points - eyes[:, None], axis=-1)[..., None]
    for k, beyond in ((0, S - 1), (1, 0)):
        there = np.arange(S) != beyond
        assert np.isnan(walk[k, beyond]).all()
        assert walk[k][there] == pytest.approx(way[there], rel=2e-3, abs=1e-5)
        assert slide[k][there] == pytest.approx(np.abs(turned @ normal)[there], abs=1e-9)
        gap = np.roll(points, (-1, 1)[k], axis=0) - points
        seen = gap - towards * np.einsum("sni,sni->sn", gap, towards)[..., None]
        higher = np.einsum("sni,sni->sn", seen, moves) > 0
        assert np.array_equal(side[k][there], np.where(higher, 1.0, -1.0)[there])


def test_what_is_no_neighbour_says_nothing():
    points, _, eyes = plane(np.random.default_rng(1))
    points[5:] += 3.0  # a jump, further than three arcs
    points[9, 4] = np.nan
    ones = np.ones(points.shape)
    walk, _, _ = across(points, eyes, ones, ones, np.full((S, N), 0.5), False)
    known = ~np.isnan(walk)
    assert not known[0, 4].any()
    assert not known[1, 5].any()
    assert known[0, 5:8].all()
    assert not known[:, 9, 4].any()
    assert not known[0, 8, 4]
    assert not known[1, 10, 4]
    alone = points.copy()
    alone[:, np.arange(N) != 3] = np.nan
    assert np.isnan(across(alone, eyes, ones, ones, np.ones((S, N)), False)[0]).all()


def test_a_closed_turn_has_no_end():
    turn = np.linspace(0, 2 * np.pi, S, endpoint=False)[:, None] + np.zeros((S, N))
    z = 0.3 * np.arange(N) + np.zeros((S, N))
    points = np.stack([10 * np.cos(turn), 10 * np.sin(turn), z], -1)
    eyes = 50.0 * points[:, 0]
    ones = np.ones(points.shape)
    arc = np.full((S, N), 10 * 2 * np.pi / S)
    assert not np.isnan(across(points, eyes, ones, ones, arc, True)[0]).any()
    walk, slide, _ = across(points, eyes, ones, ones, arc, False)
    assert np.isnan(walk).sum() == 2 * N
    # A chord leaves the tangent by half a step.
    assert np.nanmax(slide) == pytest.approx(np.sin(np.pi / S), rel=1e-6)


def test_a_width_is_the_middle_of_five_of_its_run():
    width = np.array([[1.0, 9, 3, 4, 5, np.nan, 7, 2, 8]])
    steady = kernels.steady(width)[0]
    assert steady[[0, 1, 2, 3, 4]] == pytest.approx([3, 3.5, 4, 4.5, 4])
    assert np.isnan(steady[5])
    assert steady[[6, 7, 8]] == pytest.approx([7, 7, 7])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("reach", [2, 7, 40])
def test_the_usual_width_is_the_median_of_a_window_gaps_left_out(seed, reach):
    rng = np.random.default_rng(seed)
    width = np.round(rng.uniform(1.0, 3.0, (4, 30)), 1)
    width[rng.random(width.shape) < 0.3] = np.nan
    width[3] = np.nan
    out = kernels.usual(width, reach)
    assert np.array_equal(np.isnan(out), np.isnan(width))
    for k, j in np.argwhere(~np.isnan(width)):
        about = width[k, max(0, j - reach) : j + reach + 1]
        assert out[k, j] == pytest.approx(np.nanmedian(about), abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("reach", [1, 3, 9, 40])
def test_what_is_usual_on_both_sides_is_the_smaller_median_of_the_two(seed, reach):
    rng = np.random.default_rng(seed)
    value = rng.uniform(1, 2, (3, 30))
    value[rng.random(value.shape) < 0.3] = np.nan
    found = kernels.usual_beside(value, reach)
    for k, row in enumerate(value):
        for j in range(len(row)):
            sides = [row[max(j - reach, 0) : j], row[j + 1 : j + 1 + reach]]
            sides = [side[~np.isnan(side)] for side in sides]
            if min(map(len, sides)):
                assert found[k, j] == min(map(np.median, sides))
            else:
                assert np.isnan(found[k, j])


def test_a_cut_gaussian_is_as_far_off_as_its_width_says():
    """Of a Gaussian cut off c sigma beyond its middle, λ = φ(c)/Φ(c) off, √(1 − cλ − λ²) wide."""
    c = np.linspace(-0.2, 1.6, 30)
    off = norm.pdf(c) / norm.cdf(c)
    assert by_width(np.sqrt(1 - c * off - off**2)) == pytest.approx(off, rel=0.25, abs=0.05)
    assert by_width(np.array([1.0, 0.96, 1.05])) == pytest.approx(0.0, abs=1e-12), "that is speckle"
    wider = by_width(np.array([1.2, 1.4, 1.6]))
    assert np.all(np.diff(wider) > 0.05)


def wall(*, width=2.0, slope=0.0):
    """The light of a wall before the camera; pixels go to the right, as steps do."""
    x = 0.5 * (np.arange(S) - S / 2)[:, None] + np.zeros((S, N))
    z = 0.3 * np.arange(N) + np.zeros((S, N))
    points = np.stack([x, 40.0 + slope * np.abs(x), z], -1)
    return LitPoints(
        points,
        np.tile([0.0, -500.0, 1.5], (S, 1)),
        np.tile([0.2, 0.0, 0.0], (S, N, 1)),
        np.tile([np.cos(0.4), np.sin(0.4), 0.0], (S, N, 1)),
        np.full((S, N), width),
        np.full((S, N), 100.0),
        0.5 / 40.0 * np.arange(S),
        False,
    )


def test_whole_stripes_are_left_alone():
    told = wholeness(wall())
    assert not told.shift.any()
    assert not told.tail.any()
    assert told.doubt == pytest.approx(0.0, abs=1e-9)
    assert told.slide[:, 5] == pytest.approx(
        np.abs(wall().points[:, 5, 0]) / np.hypot(wall().points[:, 5, 0], 40.0), abs=1e-9
    ), "a wall's own turn leads off it by the sine of its place"


def alone(width: float, light: float = 1.0, stated: float = 0.4) -> LitPoints:
    """The wall, about whose step 7 nothing is seen, in a stripe of this share of its width and
    light."""
    whole = wall()
    points = whole.points.copy()
    points[5:10] = np.nan
    points[7] = whole.points[7]
    wide, bright = whole.width.copy(), whole.amplitude.copy()
    wide[7] *= width
    bright[7] *= light
    return replace(whole, points=points, width=wide, amplitude=bright, stated=stated)


@pytest.mark.parametrize(
    ("width", "light", "least", "most"),
    [
        (1.0, 1.0, 0.0, 0.0),
        (0.85, 1.0, 0.0, 0.0),
        (0.65, 1.0, 0.4, 0.9),
        (0.3, 1.0, 1.0, 1.3),
        (1.0, 0.2, 0.6, 1.2),  # as wide, but of a fifth of the light
        (1.4, 0.9, 0.0, 0.0),
    ],
)
def test_a_narrow_stripe_with_nothing_beside_is_doubted(width, light, least, most):
    """The edge of a plate that is thinner than the sheet: part of its light falls on it, far from
    its middle, and no profile beside tells that."""
    told = wholeness(alone(width, light))
    doubt = told.doubt[7] / 2.0
    assert np.all((doubt >= least) & (doubt <= most + 1e-9)), doubt
    assert not told.shift[7].any()
    assert told.doubt[12] == pytest.approx(0.0, abs=1e-9)


def test_where_no_surface_tells_how_thick_the_sheet_is_the_rig_does():
    seen = alone(0.3)
    points = np.where(np.arange(S)[:, None, None] == 7, seen.points, np.nan)
    said = [wholeness(replace(seen, points=points, stated=t)) for t in (0.0, 0.4)]
    assert not said[0].doubt[7].any(), "nothing tells how wide it is due"
    assert np.all(said[1].doubt[7] > 0.5)
    assert said[1].thickness == 0.0, "what the rig states was not seen"


def test_how_far_light_reaches_over_an_edge_the_rig_says_where_no_surface_does():
    beside = np.abs(np.arange(S) - 7)[:, None, None] <= 1
    few = replace(wall(), points=np.where(beside, wall().points, np.nan))
    none, thin, thick = (wholeness(replace(few, stated=t)) for t in (0.0, 0.02, 0.4))
    assert none.thickness == thick.thickness == 0.0, "none was seen"
    assert not none.near[7].any()
    assert not thin.near[7].any()
    assert thick.near[7].all()


def test_noise_of_points_and_widths_is_no_cut():
    """Planes through noisy points lie anyhow: whole stripes are then neither moved nor doubted."""
    rng = np.random.default_rng(3)
    light, n = wall(), 100
    points = np.tile(light.points[:, :1], (1, n, 1))
    points[..., 2] = 0.3 * np.arange(n)
    points[..., 1] += 0.05 * rng.standard_normal((S, n))
    noisy = replace(
        light,
        points=points,
        moves=np.tile(light.moves[:, :1], (1, n, 1)),
        sheets=np.tile(light.sheets[:, :1], (1, n, 1)),
        width=2.0 * (1 + 0.08 * rng.standard_normal((S, n))),
        amplitude=np.full((S, n), 100.0),
    )
    told = wholeness(noisy)
    assert (told.doubt > 0).mean() < 0.05
    assert (told.shift != 0).mean() < 0.005
    noisy.width[6] *= 1.6
    doubt = wholeness(noisy).doubt[6]
    assert (doubt > 0.3 * 2.0).mean() > 0.9, "noise does not hide an edge"
    about = np.median(np.lib.stride_tricks.sliding_window_view(doubt, 5), axis=1)
    assert np.all(doubt[2:-2] > 0.55 * about), "nor does it from one line in its midst"


def test_coarse_chords_of_a_round_part_are_no_crease():
    """In steps of 18° only the table under a tube is smooth, and its light is another."""
    n = 60
    turn = np.deg2rad(18.0) * (np.arange(8) - 3.5)[:, None] + np.zeros((8, n))
    out = np.stack([np.sin(turn), -np.cos(turn), 0 * turn], -1)
    aside = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    tube = np.arange(n) < 46
    reach = np.where(tube, 40.0, 50.0 + np.arange(n))
    points = out * reach[:, None]
    points[..., 2] = np.where(tube, 30.0 - 0.3 * np.arange(n), 0.0)
    light = LitPoints(
        points,
        500.0 * out[:, 0] + np.array([0.0, 0.0, 200.0]),
        0.2 * aside,
        np.cos(0.4) * aside + np.sin(0.4) * out,
        np.where(tube, 2.0, 5.0) + np.zeros((8, n)),
        np.full((8, n), 100.0),
        turn[:, 0],
        False,
    )
    told = wholeness(light)
    assert told.doubt[:, tube] == pytest.approx(0.0, abs=1e-9)
    assert not told.shift[:, tube].any()


def tube_on_a_table(steps: int, crease: bool = False) -> LitPoints:
    """A whole turn about a tube of 20 mm on a table, whose stripes are as wide as is due on both.

    With ``crease`` it is a hexagon, with profiles on its edges.
    """
    n = 60
    turn = (2 * np.pi / steps) * (np.arange(steps)[:, None] + 1e-9) + np.zeros((steps, n))
    out = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    aside = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], -1)
    tube = np.arange(n) < 40
    hexagon = 20.0 * np.cos(np.pi / 6) / np.cos(turn % (np.pi / 3) - np.pi / 6)
    reach = np.where(tube, hexagon if crease else 20.0, 50.0 + np.arange(n))
    points = out * reach[..., None]
    points[..., 2] = np.where(tube, 30.0 - 0.3 * np.arange(n), 0.0)
    sheets, moves = np.cos(0.9) * aside + np.sin(0.9) * out, 0.2 * aside
    eyes = 500.0 * out[:, 0] + np.array([0.0, 0.0, 200.0])
    side = turn - (turn % (np.pi / 3) - np.pi / 6) * (crease & (turn % (np.pi / 3) > 1e-6))
    normal = np.stack([np.cos(side), np.sin(side), 0 * side], -1)
    normal = np.where(tube[:, None], normal, [0.0, 0.0, 1.0])
    ray = points - eyes[:, None]
    away = np.sum(normal * moves, -1) / np.sum(normal * ray, -1)
    walk = np.abs(np.sum(sheets * (moves - ray * away[..., None]), -1))
    width = np.hypot(0.4 / walk, 0.2)
    facing = np.abs(np.sum(normal * ray, -1)) / np.linalg.norm(ray, axis=-1)
    bright = 400.0 * facing / width  # it sends as much light as it faces the camera
    return LitPoints(points, eyes, moves, sheets, width, bright, turn[:, 0], True)


@pytest.mark.parametrize("steps", [12, 18, 36])
def test_a_round_part_in_coarse_steps_is_not_doubted_for_its_chords(steps):
    """Although the table beneath it is smooth in any steps, and so tells what is due."""
    light = tube_on_a_table(steps)
    told = wholeness(light)
    assert told.doubt == pytest.approx(0.0, abs=1e-9)
    assert not told.shift.any()
    wide = replace(light, width=light.width * np.where(np.arange(steps) == 4, 1.5, 1.0)[:, None])
    assert (wholeness(wide).doubt[4] > 0.1 * light.width[4]).all(), "a wide stripe still is"


def test_a_crease_is_not_round():
    """Where one profile in three bends, a stripe as wide as on a round part lies on two."""
    light = tube_on_a_table(18, crease=True)
    arc = np.full(light.width.shape, 20.0)
    walk, _, _ = across(light.points, light.eyes, light.moves, light.sheets, arc, light.closed)
    light.width[::3, :40] = np.hypot(0.4 / np.sqrt(walk[0] * walk[1]), 0.2)[::3, :40]
    light.amplitude[::3, :40] = 400.0 * np.cos(np.pi / 6) / light.width[::3, :40]
    told = wholeness(light)
    assert (told.doubt[::3, 2:38] > 0).all()


@pytest.mark.parametrize(("arc", "bent", "told"), [(0.5, 3, False), (0.5, 9, True), (3.0, 3, True)])
def test_profiles_that_the_sheet_reaches_from_a_crease_are_no_round_surface(arc, bent, told):
    """A corner in steps finer than the sheet bends some profiles alike, by chance."""
    ratio = np.exp(np.where(np.abs(np.arange(30) - 15) <= bent // 2, 0.2, 0.0))
    walk = np.stack([ratio, np.ones(30)])[..., None]
    assert _round(walk, np.full((30, 1), arc), 0.6)[15, 0] == told


def test_what_no_turn_moves_tells_no_tilt_and_no_crease():
    """On the table's axis a wall is met at the same place in every step: noise is no neighbour."""
    rng = np.random.default_rng(4)
    points = np.zeros((12, 8, 3))
    points[..., 2] = np.arange(8) * 0.5
    points[..., :2] = 0.01 * rng.standard_normal((12, 8, 2))
    eyes = np.array([np.cos(a := np.arange(12) * 0.1), np.sin(a), 0 * a]).T * 400.0
    ones = np.ones(points.shape)
    walk, _, _ = across(points, eyes, ones, ones, np.ones((12, 8)), False, least=0.1)
    assert np.isinf(walk[0, :-1]).all()
    assert np.isinf(walk[1, 1:]).all()
    assert np.isnan(walk[0, -1]).all(), "the last step has no neighbour at all"
    width = np.linspace(1.0, 3.0, 12)[:, None] * np.ones(8)
    nothing = np.full(width.shape, np.nan)
    seen = Widths(width, np.ones(width.shape), walk, np.ones(walk.shape), np.ones(width.shape))
    told = creased(seen, 1.0, lambda far: nothing, lambda far, a, b: np.ones((5, b - a, 8)))
    assert told is not None
    assert not told.shift.any()
    assert not told.doubt.any()


@pytest.mark.parametrize(
    ("width", "bright", "doubted"), [(0.6, 0.4, True), (0.6, 1.3, False), (1.0, 0.4, False)]
)
def test_what_is_narrower_and_fainter_than_both_beside_it_is_cut_somewhere(width, bright, doubted):
    """Brighter is more square to the light; only fainter is darker paint."""
    light = wall()
    light.width[6] *= width
    light.amplitude[6] *= bright
    doubt = wholeness(light).doubt[6]
    assert (doubt >= 2.0).all() == doubted
    assert doubted or (doubt < 2.0).all()


def test_the_end_of_what_is_seen_needs_less_to_be_doubted():
    """A width 12 % short is within what chords explain, but not where something may cut it."""
    light = wall()
    light.width[[0, 6]] *= 0.88
    told = wholeness(light)
    assert (told.doubt[0] > 0.05 * 2.0).all()
    assert not told.shift.any()
    assert told.doubt[6] == pytest.approx(0.0, abs=1e-9)


def test_a_frame_claims_no_more_than_the_others_know():
    """Of few lines the scatter is not known; speckle is as strong there as elsewhere."""
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = np.deg2rad(8.0) * np.arange(20)
    whole = scan_shape(rig, sphere(20.0, (0.0, 0.0, 25.0)), angles)
    n = len(whole[0].position)
    stripes = [replace(s, sigma=np.where(s.found, 0.1, np.nan)) for s in whole]
    sure = [replace(s, sigma=s.sigma / 10) if k == 7 else s for k, s in enumerate(stripes)]
    fine = [replace(s, sigma=s.sigma / 2) if k == 7 else s for k, s in enumerate(stripes)]
    honest, told, kept = (
        build_grid(rig, "L0", some, range(20), angles).sigma for some in (stripes, sure, fine)
    )
    assert n == honest.shape[1]
    known = ~np.isnan(honest[7])
    assert known.sum() > 10
    assert told[7][known] == pytest.approx(honest[7][known], rel=0.1)
    assert np.median(kept[7][known] / honest[7][known]) < 0.7, "half of it may well be true"
    others = np.arange(20) != 7
    np.testing.assert_array_equal(told[others], honest[others])


def test_bright_points_keep_what_their_photons_know():
    """Where the electrons per grey level are known, single bright points are surer than others."""
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = np.deg2rad(8.0) * np.arange(20)
    whole = scan_shape(rig, sphere(20.0, (0.0, 0.0, 25.0)), angles)
    stripes = [replace(s, sigma=np.where(s.found, 0.1, np.nan)) for s in whole]
    spot = np.flatnonzero(stripes[7].found)[::5]
    bright = np.zeros(len(stripes[7].sigma), dtype=np.bool_)
    bright[spot] = True

    def lit(s, where):
        surer, more = np.where(where, 0.25, 1.0), np.where(where, 16.0, 1.0)
        return replace(s, sigma=surer * s.sigma, amplitude=more * s.amplitude)

    spotted = [lit(s, bright) if k == 7 else s for k, s in enumerate(stripes)]
    # A whole frame of it is as sure, too: its brightness explains what it claims.
    painted = [lit(s, s.found) if k == 7 else s for k, s in enumerate(stripes)]
    honest, some, all_of_it = (
        build_grid(rig, "L0", s, range(20), angles).sigma for s in (stripes, spotted, painted)
    )
    there = bright & ~np.isnan(honest[7])
    assert there.sum() > 3
    assert np.median(some[7][there] / honest[7][there]) < 0.5
    np.testing.assert_array_equal(some[7][~bright], honest[7][~bright])
    assert np.nanmedian(all_of_it[7] / honest[7]) < 0.5


def test_widths_that_do_not_follow_the_surface_tell_nothing_of_it():
    """Of a line with a halo, or clipped, in 30 % of scatter: it is neither moved nor doubted."""
    n = 400
    light = wall()
    rng = np.random.default_rng(5)
    # Over five lines and more a halo stays the same: medians along the stripe do not remove it.
    patches = np.repeat(np.exp(0.3 * rng.standard_normal((S, n // 10))), 10, axis=1)
    points = np.tile(light.points[:, :1], (1, n, 1))
    points[..., 2] = 0.3 * np.arange(n)
    haloed = replace(
        light,
        points=points,
        moves=np.tile(light.moves[:, :1], (1, n, 1)),
        sheets=np.tile(light.sheets[:, :1], (1, n, 1)),
        width=2.0 * patches,
        amplitude=np.full((S, n), 100.0),
    )
    haloed.amplitude[0] = 30.0
    told = wholeness(haloed)
    assert not told.doubt.any()
    assert not told.shift.any()
    assert not told.tail.any()
    # A tenth of that is speckle, which hides no edge.
    calm = replace(haloed, width=2.0 * patches**0.1)
    calm.width[6] *= 1.6
    assert (wholeness(calm).doubt[6] > 0.3 * 2.0).mean() > 0.9
    assert wholeness(calm).tail[0].all()


@pytest.mark.parametrize(("end", "sign"), [(0, 1.0), (S - 1, -1.0)])
@pytest.mark.parametrize("c", [0.3, 0.7])
def test_a_stripe_that_the_end_of_a_wall_cuts_is_put_back(end, sign, c):
    off = norm.pdf(c) / norm.cdf(c)
    light = wall()
    light.width[end] *= np.sqrt(1 - c * off - off**2)
    told = wholeness(light)
    assert told.shift[end] == pytest.approx(sign * 2.0 * off, rel=0.25)
    assert told.doubt[end] == pytest.approx(np.abs(told.shift[end]) / 2)
    inner = np.arange(S) != end
    assert not told.shift[inner].any()
    assert not told.tail.any()


def test_a_line_that_stays_beside_some_that_are_put_back_is_doubted():
    """Both cannot be right; which is, nobody knows."""
    c = 0.3
    off = norm.pdf(c) / norm.cdf(c)
    light = wall()
    light.width[0, : N // 2] *= np.sqrt(1 - c * off - off**2)
    told = wholeness(light)
    stays = np.flatnonzero(told.shift[0] == 0.0)
    assert stays[0] == N // 2
    assert np.all(told.doubt[0, stays[:2]] > 0.5 * told.shift[0, stays[0] - 1])
    assert not told.doubt[0, stays[2:]].any()


@pytest.mark.parametrize(
    ("degrees", "aside", "lifted"), [(3.0, 10.0, 1.0), (3.0, 0.0, 0.0), (17.0, 10.0, 0.0)]
)
def test_what_looks_whole_between_two_cut_stripes_is_doubted_as_they_are(degrees, aside, lifted):
    """An edge goes on from profile to profile. Over coarse steps each lies on a face of its own; of
    a ball on the axis no slopes tell how far the sheet reaches."""
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = np.deg2rad(degrees) * np.arange(20)
    middle = (aside, 0.0, 25.0)
    stripes = lit_by_a_sheet(rig, scan_shape(rig, sphere(20.0, middle), angles), angles, middle)
    whole = build_grid(rig, "L0", stripes, range(20), angles)
    before, away = whole.sigma, np.linalg.norm(whole.points[..., :2], axis=-1)
    far = (away > 6.0) & (away < 22.0)
    for k in (6, 8):
        cut = stripes[k]
        stripes[k] = replace(cut, width=0.5 * cut.width, amplitude=0.5 * cut.amplitude)
    after = build_grid(rig, "L0", stripes, range(20), angles).sigma
    some = far[5:10].all(axis=0)  # steps are short beside the axis
    assert some.sum() > 10
    beside = np.minimum(after[6], after[8])[some]
    assert (beside > 2 * before[6][some]).mean() > 0.85, "both are doubted"
    assert (after[7][some] > 1.4 * before[7][some]).mean() == pytest.approx(lifted, abs=0.1)
    assert np.median((after / before)[[5, 9]][:, some]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("error", [0.9, 0.95, 1.05])
def test_light_and_width_both_tell_how_much_of_a_stripe_is_cut(error):
    """Speckle makes the stripe narrower or wider by ``error``; its light is that of the cut."""
    c, end = 0.6, S - 1
    off = norm.pdf(c) / norm.cdf(c)
    narrow = error * np.sqrt(1 - c * off - off**2)
    light = wall()
    light.width[end] *= narrow
    light.amplitude[end] *= norm.cdf(c) / narrow
    told = wholeness(light)
    by_both, alone = -told.shift[end] / 2.0, float(by_width(np.array([narrow]), 0.09)[0])
    assert abs(alone - off) > 0.06
    assert np.abs(by_both - off).max() < 0.7 * abs(alone - off)
    # Where the two differ by more than they say, half of that is doubted.
    light.amplitude[end] *= 1 / norm.cdf(c)
    told = wholeness(light)
    assert told.shift[end] == pytest.approx(-alone, rel=1e-6), "half of what the width says"
    assert told.doubt[end] == pytest.approx(alone, rel=1e-6)


@pytest.mark.parametrize(
    ("end", "bright", "width", "tail"),
    [(0, 0.5, 1.0, True), (S - 1, 0.5, 1.0, True), (0, 0.7, 1.0, False), (0, 0.7, 0.5, True),
     (0, 0.95, 0.5, False), (4, 0.3, 1.0, False)],
)  # fmt: skip
def test_what_is_much_fainter_at_the_end_is_a_tail(end, bright, width, tail):
    light = wall()
    light.amplitude[end] *= bright
    light.width[end] *= width
    told = wholeness(light)
    assert (told.tail[end] == tail).all()
    assert not told.tail[np.arange(S) != end].any()
    assert not told.shift.any(), "what is no clean cut is not put back"


@pytest.mark.parametrize(("end", "beside"), [(0, 1), (S - 1, S - 2)])
def test_a_tail_is_faint_against_the_profile_next_to_it_and_no_other(end, beside):
    """A wall that grows darker towards its end, by 0.7 from profile to profile, has no tail."""
    light = wall()
    light.amplitude[[end, beside]] *= [[0.7 * 0.7], [0.7]]
    assert not wholeness(light).tail.any()
    light.amplitude[beside] = 100.0
    assert wholeness(light).tail[end].all()


def test_a_wide_stripe_lies_on_two_surfaces_and_is_doubted():
    light = wall()
    light.width[6] *= 1.5
    told = wholeness(light)
    assert (told.doubt[6] > 0.5 * 2.0).all()
    assert told.doubt[[3, 9]] == pytest.approx(0.0, abs=1e-9)
    assert not told.shift.any()


def test_blur_widens_what_the_sheets_thickness_does_not():
    """On a roof the sheet is seen under two angles: width² = (thickness / walk)² + blur²."""
    light = wall(slope=0.9)
    walk, _, _ = across(light.points, light.eyes, light.moves, light.sheets, np.ones((S, N)), False)
    usual = np.nanmean(walk, axis=0)
    assert usual.max() > 2 * usual.min()
    width = np.sqrt((0.3 / usual) ** 2 + 1.5**2)
    light.width[:] = width
    told = wholeness(light)
    ridge = np.abs(np.arange(S) - S // 2) <= 1
    assert told.doubt[~ridge] == pytest.approx(0.0, abs=0.05)
    light.width[2] = 1.3 * width[2]
    alone = 0.5 * width[2] * by_width(np.array(1.3))
    assert (wholeness(light).doubt[2] > 0.9 * alone).all()


def lit_by_a_sheet(rig, stripes, angles, middle, radius=20.0):
    """The stripes of a sphere, as wide as a sheet of light 0.5 mm thick (rms) makes them on it."""
    out = []
    for stripe, angle in zip(stripes, angles, strict=True):
        X = rig.sheet("L0").intersect(rig.camera.rays(stripe.pixels))
        centre = rig.T_camera_table.apply(rotation_z(float(angle)) @ np.asarray(middle))
        normal = (X - centre) / radius
        ray = rig.camera.rays(stripe.pixels + (1.0, 0.0))
        met = ray * (np.sum(X * normal, -1) / np.sum(ray * normal, -1))[:, None]
        out.append(replace(stripe, width=0.5 / np.abs(rig.sheet("L0").distance(met))))
    return out


@pytest.mark.parametrize("steps", [48, 60, 90])
def test_a_flat_face_beside_the_axis_is_doubted_for_nothing(steps):
    """Its profiles lie closer than noise leaves a plane through two of them known, and as it turns
    to the light its stripes grow wider from one to the next: no crease makes them so."""
    rig, angles, rng = make_rig(), full_turn(steps), np.random.default_rng(4)
    exact = scan_shape(rig, box((26.0, 4.0, 25.0), (0.0, 0.0, 25.0), 0.0), angles)
    stripes = [
        replace(s, width=w * rng.normal(1.0, 0.05, len(w)), amplitude=np.where(s.found, 90.0, 0.0))
        for s, w in zip(with_noise(exact, 0.1, 5), on_a_plate(rig, exact, angles), strict=True)
    ]
    grid = build_grid(rig, "L0", stripes, range(steps), angles)
    x, y, z = np.moveaxis(grid.points, -1, 0)
    face = grid.found & (np.abs(np.abs(y) - 4.0) < 0.5) & (np.abs(x) < 2.5) & (z > 4.0) & (z < 46.0)
    assert face.sum() > 500
    doubt = np.sqrt(np.maximum(grid.sigma**2 - grid.noise**2, 0.0)) / grid.noise
    assert np.median(doubt[face]) < 0.3, "0.6 to 0.9 before"
    # What something cuts on it is doubted: its centre is off by as much as it is narrow.
    k = int(np.argmax(face.sum(axis=1)))
    one = stripes[k]
    stripes[k] = replace(
        one, position=one.position + 0.5, width=0.6 * one.width, amplitude=0.6 * one.amplitude
    )
    cut = build_grid(rig, "L0", stripes, range(steps), angles)
    more = np.sqrt(np.maximum(cut.sigma**2 - cut.noise**2, 0.0)) / cut.noise
    assert np.median(more[k][face[k]]) > 2.0


def on_a_plate(rig, stripes, angles):
    """How wide a sheet 0.5 mm thick (rms) makes stripes on the faces of a plate across y, px."""
    out = []
    for stripe, angle in zip(stripes, angles, strict=True):
        normal = rig.T_camera_table.turn(rotation_z(float(angle)) @ np.array([0.0, 1.0, 0.0]))
        X = rig.sheet("L0").intersect(rig.camera.rays(stripe.pixels))
        ray = rig.camera.rays(stripe.pixels + (1.0, 0.0))
        met = ray * ((X @ normal) / (ray @ normal))[:, None]
        out.append(0.5 / np.abs(rig.sheet("L0").distance(met)))
    return out


def test_a_line_leads_on_over_long_steps_where_they_are_straight_and_grow():
    """Steps of 1, 1.5, 2.25 … usual ones along a line; each turned by 20° more; one step alone."""
    long = np.cumsum(np.append(0.0, 1.5 ** np.arange(6)))
    straight = np.stack([long, 0 * long, 0 * long], -1)
    turn = 0.35 * np.arange(6)
    steps = np.diff(long)[:, None] * np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    bent = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    jump = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.6, 0.0, 0.0], [4.6, 1.0, 0.0]])
    found = []
    for line in (straight, bent, jump):
        points = np.ascontiguousarray(line[:, None])
        out = np.zeros(points.shape[:2], dtype=np.bool_)
        kernels.straight_beyond(points, np.ones(out.shape), False, (0, len(out)), out)
        found.append(out[:, 0].tolist())
    # The step of 2.25 and that of 3.4 are too long to be linked; the last one is beyond all.
    assert found[0] == [False, False, True, True, True, False, False]
    assert not any(found[1])
    assert not any(found[2]), "what is beside it is shorter than three tenths, or leads elsewhere"


def slanted_veil(rise: float) -> tuple[LitPoints, np.ndarray]:
    """A wall before another, the edge between them slanting, and a veil that joins them along it,
    ``rise`` mm back for each mm aside; and where that is. Every stripe is as wide as is due."""
    steps, lines = 60, 90
    x = 0.5 * (np.arange(steps) - steps / 2)[:, None] + np.zeros((steps, lines))
    z = 0.3 * np.arange(lines) + np.zeros((steps, lines))
    along = x - 15.0 + z
    veil = (along > 0) & (along < 3.0)
    sheets = np.tile([np.cos(0.4), np.sin(0.4), 0.0], (steps, lines, 1))
    walk = 0.2 * (np.cos(0.4) + np.where(veil, rise, 0.0) * np.sin(0.4))
    light = LitPoints(
        np.stack([x, 40.0 + rise * np.clip(along, 0.0, 3.0), z], -1),
        np.tile([0.0, -5e5, 1.5], (steps, 1)),
        np.tile([0.2, 0.0, 0.0], (steps, lines, 1)),
        sheets,
        0.4 / walk,
        np.full((steps, lines), 100.0),
        0.5 / 40.0 * np.arange(steps),
        False,
    )
    return light, veil


def test_a_veil_between_two_walls_is_doubted_although_its_own_plane_makes_it_narrow():
    light, veil = slanted_veil(2.0)
    told = wholeness(light)
    middle = veil & np.roll(veil, 2, 1) & np.roll(veil, -2, 1)
    assert np.median(told.doubt[middle]) > 0.3 * np.median(light.width)
    walls = ~(veil | np.roll(veil, 7, 1) | np.roll(veil, -7, 1))
    walls &= ~(np.roll(veil, 5, 0) | np.roll(veil, -5, 0))
    assert not told.doubt[walls].any()
    whole = slanted_veil(0.1)[0]
    assert not wholeness(whole).doubt[middle].any(), "hardly narrower: a wall like the others"


@pytest.mark.parametrize(("bright", "doubted"), [(30.0, True), (70.0, False), (160.0, False)])
def test_a_long_run_of_narrow_stripes_is_a_veil_where_it_is_faint(bright, doubted):
    width, light = np.full((3, 300), 2.0), np.full((3, 300), 100.0)
    width[:, 100:136], light[:, 100:136] = 1.3, bright
    doubt = _narrow(width, light, (0.5, 0.5))
    assert (doubt[:, 114:122] > 0.3 * 2.0).all() == doubted
    assert doubt[:, 114:122].any() == doubted
    assert not doubt[:, :100].any()
    assert not doubt[:, 136:].any()


AIR = [
    (0.6, 0.4, 6, True),
    (0.6, 1.2, 6, False),  # more squarely to the light
    (1.0, 0.4, 6, False),  # darker
    (0.6, 0.4, 40, False),  # a face that lies so
]


@pytest.mark.parametrize(("narrow", "light", "many", "doubted"), AIR)
@pytest.mark.parametrize("first", [100, 197])
def test_profiles_that_are_narrow_and_faint_between_others_lie_in_the_air(
    narrow, light, many, doubted, first
):
    """The sheet passes an edge before something further behind; also over the end of a turn."""
    width, flux, arcs = (np.full((200, 80), v) for v in (1.3, 100.0, 0.55))
    some = np.arange(first, first + many) % 200
    width[some] *= narrow
    flux[some] *= light
    doubt = _faint_between(width, flux, arcs, 0.6, True)
    assert (doubt[some] > 0.5).all() == doubted
    assert doubt.any() == doubted
    assert not _faint_between(width, flux, arcs, 0.0, True).any(), "nobody knows how far it reaches"
    assert not _faint_between(width, flux, arcs, 0.13, True).any(), "not from one step to the next"


def test_a_face_that_ends_narrow_and_faint_has_nothing_behind_it():
    width, flux, arcs = (np.full((60, 80), v) for v in (1.3, 100.0, 0.55))
    width[54:], flux[54:] = 0.8, 40.0
    assert not _faint_between(width, flux, arcs, 0.6, False).any()
    assert _faint_between(width, flux, arcs, 0.6, True)[54:].all(), "in a closed turn it has"


@pytest.mark.parametrize("end", [0, -1])
@pytest.mark.parametrize("middle", [(0.0, 0.0, 25.0), (6.0, 2.0, 25.0)])
def test_a_cut_stripe_of_a_scan_goes_back_to_its_surface(end, middle):
    """The end of a part of a turn: what is left of the light there is pushed to the part's side."""
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = np.deg2rad(8.0) * np.arange(20)
    stripes = lit_by_a_sheet(rig, scan_shape(rig, sphere(20.0, middle), angles), angles, middle)
    whole = build_grid(rig, "L0", stripes, range(20), angles)
    found, beside = whole.found[end] & whole.found[(1, -2)[end]], (1, -2)[end]
    here = pixels_of(rig, whole.points[end][found], np.full(found.sum(), angles[end]))
    there = pixels_of(rig, whole.points[beside][found], np.full(found.sum(), angles[end]))
    sign = np.sign(there - here)[:, 0]
    c = 0.9
    off = norm.pdf(c) / norm.cdf(c)
    cut = stripes[end]
    position, width = cut.position.copy(), cut.width.copy()
    position[found] += sign * off * width[found]
    width[found] *= np.sqrt(1 - c * off - off**2)
    stripes[end] = replace(cut, position=position, width=width)
    moved = build_grid(rig, "L0", stripes, range(20), angles)
    line = np.abs(np.linalg.norm(moved.points[end][found] - middle, axis=1) - 20.0)
    pushed = build_grid(rig, "L0", [stripes[end]], [0], [angles[end]])
    before = np.abs(np.linalg.norm(pushed.points[0][found] - middle, axis=1) - 20.0)
    assert np.median(before) > 0.02, "there is something to put back"
    # How much is left hangs on whether the surface is taken to turn or to go on flat.
    assert np.median(line) < 0.5 * np.median(before)


def test_a_sheet_of_another_thickness_than_the_rig_states_is_found_by_the_widths():
    rig, middle = make_rig(elevation=0.2, lift=25.0), (6.0, 2.0, 25.0)
    angles = full_turn(45)
    stripes = lit_by_a_sheet(rig, scan_shape(rig, sphere(20.0, middle), angles), angles, middle)
    grid = every(build_grid(rig, "L0", stripes, range(45), angles), 1)
    assert grid.thickness == pytest.approx(0.5, rel=0.1)
    assert take_steps(grid, np.arange(20)).thickness == grid.thickness

    def told(stated):
        found = grid_findings(grid, grid, Volume(), "", stated)
        return [f for f in found if f.code == "points.sheet-thickness"]

    assert not told(None)
    assert not told(0.4)
    (thick,) = told(0.25)
    assert f"{grid.thickness:.2f} mm thick (rms)" in thick.message
    assert "states 0.25 mm" in thick.message
    assert "calibrate it again" in str(thick.remedy)
    (thin,) = told(1.0)
    assert "another focus" in str(thin.remedy)
    unknown = replace(grid, thickness=0.0)
    assert len(grid_findings(unknown, unknown, Volume(), "", 0.1)) == len(
        grid_findings(grid, grid, Volume())
    )


@pytest.mark.parametrize(
    ("steps", "stated", "narrowest"),
    [(180, 0.5, "2.0"), (45, 0.5, ""), (180, 0.2, ""), (180, None, "")],
)
def test_details_narrower_than_the_light_are_named_where_profiles_are_close(
    steps, stated, narrowest
):
    rig = make_rig(elevation=0.2, lift=25.0)
    angles = full_turn(steps)
    grid = build_grid(
        rig, "L0", scan_shape(rig, sphere(20.0, (0, 0, 25)), angles), range(steps), angles
    )
    found = grid_findings(grid, grid, Volume(), "", stated)
    said = [f.message for f in found if f.code == "points.detail"]
    assert bool(said) == bool(narrowest)
    assert all(f"narrower than {narrowest} mm" in text for text in said)

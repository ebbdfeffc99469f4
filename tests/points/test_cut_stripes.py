"""What a stripe's width and the table's angle do to a point: put right, taken away, or doubted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from tests.analytic import box, cylinder, full_turn, make_rig, scan_shape
from turnscan.points import _end_kernels as kernels
from turnscan.points import build_grid
from turnscan.stripes import StripeFlag

STEPS = 48


def grid_of(shape, angle_sigma=None, change=None, steps=STEPS):
    rig, angles = make_rig(lift=28.0), full_turn(steps)
    stripes = scan_shape(rig, shape, angles)
    if change is not None:
        stripes = change(stripes)
    return build_grid(rig, "L0", stripes, range(steps), angles, angle_sigma)


def test_an_uncertain_angle_counts_where_it_leads_off_the_surface() -> None:
    shaky = np.full(STEPS, 0.005)
    block = box((20.0, 6.0, 25.0), (0.0, 0.0, 26.0), 0.0)
    for shape, least, most in ((cylinder(20.0, 0.0, 60.0), 0.0, 0.02), (block, 0.05, 0.12)):
        still, moving = grid_of(shape), grid_of(shape, shaky)
        more = np.sqrt(moving.sigma**2 - still.sigma**2)[still.found]
        # 20 mm from the axis an angle of 5 mrad is 0.1 mm: along a cylinder, off a block.
        assert least <= np.nanquantile(more, 0.9) <= most


def test_an_angle_that_nobody_doubts_adds_nothing() -> None:
    shape = cylinder(20.0, 0.0, 60.0)
    known = grid_of(shape, np.full(STEPS, np.nan))
    np.testing.assert_array_equal(known.sigma, grid_of(shape).sigma)


def with_gap(width: float, light: float):
    """Steps 20 and 21 hidden; the stripe of step 19 of this share of its width and light."""

    def change(stripes):
        out = list(stripes)
        for k in (20, 21):
            s = out[k]
            gone = np.full(len(s.position), np.nan)
            dark = np.full(len(gone), StripeFlag.DARK, np.uint16)
            out[k] = replace(s, position=gone, sigma=gone, amplitude=gone, width=gone, flags=dark)
        s = out[19]
        out[19] = replace(s, width=width * s.width, amplitude=light * s.amplitude)
        return out

    return change


@pytest.mark.parametrize(("width", "off"), [(0.79, 0.29), (0.7, 0.51)])
def test_a_stripe_cut_beside_a_gap_is_put_back_by_what_is_cut(width: float, off: float) -> None:
    shape = cylinder(20.0, 0.0, 60.0)
    whole, cut = (
        grid_of(shape, change=with_gap(1.0, 1.0)),
        grid_of(shape, change=with_gap(width, 1)),
    )
    moved = np.linalg.norm(cut.points[19] - whole.points[19], axis=1)
    there = whole.found[19]
    # A truncated Gaussian: 0.29 and 0.51 of the whole stripe's width, 1.5 px; 0.1 px is one sigma.
    pixel = np.nanmedian(whole.sigma[19]) / 0.1
    assert np.median(moved[there]) / (1.5 * pixel) == pytest.approx(off, rel=0.3)
    others = np.arange(STEPS) != 19
    np.testing.assert_array_equal(cut.points[others], whole.points[others])
    assert (cut.sigma[19][there] > 1.3 * whole.sigma[19][there]).mean() > 0.9


def test_over_steps_much_longer_than_the_sheet_a_cut_moves_nothing_and_is_doubted() -> None:
    """The profiles beside may lie on other faces then: of a bracket in 24 steps points that lay
    within 0.1 mm were moved by 0.5 mm."""
    shape = cylinder(20.0, 0.0, 60.0)

    def thin(width):
        cut = with_gap(width, 1.0)
        return lambda stripes: cut([replace(s, width=0.5 * s.width) for s in stripes])

    whole, cut = (grid_of(shape, change=thin(width), steps=24) for width in (1.0, 0.7))
    there = whole.found[19]
    np.testing.assert_array_equal(cut.points[19][there], whole.points[19][there])
    assert (cut.sigma[19][there] > 1.3 * whole.sigma[19][there]).mean() > 0.9


def test_the_tail_of_a_stripe_that_passes_by_is_flagged_for_what_it_is() -> None:
    shape = cylinder(20.0, 0.0, 60.0)
    grid = grid_of(shape, change=with_gap(1.0, 0.3))
    edge = (grid.flags & StripeFlag.EDGE) != 0
    assert edge[19][grid.found[19]].all()
    assert not edge[np.arange(STEPS) != 19].any()


@pytest.mark.parametrize("left", [0.9, 0.8, 0.65])
def test_what_lacks_light_beside_a_gap_is_doubted_by_the_cut_that_takes_so_much(
    left: float,
) -> None:
    """Of a width as due: light from elsewhere makes up for what the cut takes of it."""
    rig, shape = make_rig(lift=28.0), cylinder(20.0, 0.0, 60.0)
    whole, cut = (grid_of(shape, change=with_gap(1.0, light)) for light in (1.0, left))
    there = whole.found[19]
    more = np.sqrt(np.maximum(cut.sigma**2 - whole.sigma**2, 0.0))[:, there]
    np.testing.assert_array_equal(np.nan_to_num(more)[np.arange(STEPS) != 19], 0.0)
    if left == 0.9:
        assert not more[19].any()
        return
    stripe = scan_shape(rig, shape, full_turn(STEPS))[19]
    moved = replace(stripe, position=stripe.position + stripe.width)
    a, b = (build_grid(rig, "L0", [s], [0], [0.0]).points[0, there] for s in (stripe, moved))
    c = norm.ppf(left)
    off = 0.7 * norm.pdf(c) / left * np.linalg.norm(b - a, axis=-1)
    assert np.median(more[19] / off) == pytest.approx(1.0, abs=0.15)


def thrown(width: float, light: float, lines: slice = slice(None)):
    """In the lines of step 20 nothing but light that a neighbour throws there: a place of its own,
    so much wider and fainter than the stripe."""

    def change(stripes):
        out, k = list(stripes), np.arange(len(stripes[20].position))[lines]
        s = out[20]
        values = {"position": s.position + 1.0, "width": width * s.width}
        values["amplitude"] = light * s.amplitude
        for name, new in values.items():
            old = getattr(s, name).copy()
            old[k] = new[k]
            s = replace(s, **{name: old})
        out[20] = s
        return out

    return change


@pytest.mark.parametrize(
    ("width", "light", "lines", "gone"),
    [
        (6.0, 0.05, slice(None), True),
        (6.0, 0.05, slice(90, 130), True),
        (1.0, 0.05, slice(None), False),  # a dark surface
        (6.0, 0.3, slice(None), False),  # all of the stripe's light, drawn out where it grazes
    ],
)
def test_light_that_a_neighbour_throws_into_a_gap_is_no_point(width, light, lines, gone) -> None:
    shape = cylinder(20.0, 0.0, 60.0)
    plain, grid = grid_of(shape), grid_of(shape, change=thrown(width, light, lines))
    thrown_there = np.zeros_like(plain.found)
    thrown_there[20, lines] = plain.found[20, lines]
    assert thrown_there.sum() > 30
    assert grid.found[thrown_there].any() == (not gone)
    assert grid.found[plain.found & ~thrown_there].all()
    if gone:
        assert ((grid.flags[thrown_there] & StripeFlag.DARK) != 0).all()
        assert np.isnan(grid.sigma[thrown_there]).all()


def test_few_wide_stripes_among_dim_ones_are_chance() -> None:
    """A dim profile in which every third line is wide: it stays as it is found."""

    def change(stripes):
        dim = thrown(1.0, 0.05)(stripes)
        wide = thrown(6.0, 0.05)(stripes)[20]
        third = np.arange(len(wide.position)) % 3 == 0
        width = np.where(third, wide.width, dim[20].width)
        dim[20] = replace(dim[20], position=stripes[20].position, width=width)
        return dim

    shape = cylinder(20.0, 0.0, 60.0)
    assert grid_of(shape, change=change).found.sum() == grid_of(shape).found.sum()


def test_stripes_that_narrow_towards_the_end_of_every_profile_are_doubted_by_the_whole_ones() -> (
    None
):
    """A slanted edge cuts profile after profile alike: none beside another knows."""
    shape = cylinder(20.0, 10.0, 50.0)

    def narrowed(stripes):
        out = []
        for s in stripes:
            top = np.flatnonzero(s.found)[:2]
            width = s.width.copy()
            width[top] *= (0.7, 0.8)
            out.append(replace(s, width=width))
        return out

    whole, cut = grid_of(shape), grid_of(shape, change=narrowed)
    first = whole.found.argmax(axis=1)
    ratio = (cut.sigma / whole.sigma)[np.arange(STEPS), first]
    # 0.51 of the whole width, 1.5 px, and 0.1 px of noise.
    assert 5.0 < np.median(ratio) < 10.0
    below = np.arange(whole.found.shape[1]) > first[:, None] + 4
    np.testing.assert_array_equal(cut.sigma[whole.found & below], whole.sigma[whole.found & below])


@pytest.mark.parametrize(("jump", "known"), [(0.4, True), (3.0, True), (9.0, False)])
def test_a_veil_along_the_rays_belongs_to_the_edge_as_far_as_tails_are_seen(
    jump: float, known: bool
) -> None:
    """A wall across the rays, whose last profile lies ``jump`` mm behind its edge."""
    across = 0.5 * np.arange(12.0)
    points = np.zeros((12, 9, 3))
    points[..., 0], points[..., 2] = across[:, None], 0.5 * np.arange(9)
    points[11, :, 0] = points[10, :, 0]
    points[11, :, 1] = jump
    eyes = points[:, 4].copy()
    eyes[:, 1] = -1e5
    sheets = np.tile([np.sqrt(0.75), 0.5, 0.0], (12, 9, 1))
    width = np.full((12, 9), 1.5)
    width[11] = 1.0
    out, still = np.full((2, *width.shape), np.nan), np.zeros(width.shape, np.bool_)
    places = points, eyes, sheets, np.full(width.shape, 0.5)
    kernels.whole_widths(places, (width, width), still, (0.5, 0.6), False, (0, 12), out)
    np.testing.assert_array_equal(out[:, 11, 4], (1.0, 1.5) if known else (np.nan, np.nan))
    np.testing.assert_array_equal(out[:, 0, 4], (1.5, 1.5))
    assert np.isnan(out[:, 5, 4]).all()
    # What no turn moves is one place in all profiles.
    unmoved = np.full_like(out, np.nan)
    kernels.whole_widths(places, (width, width), ~still, (0.5, 0.6), False, (0, 12), unmoved)
    assert np.isnan(unmoved[:, :, 4]).all()
    # In steps longer than the sheet reaches what is further in may be another face.
    coarse, places = np.full_like(out, np.nan), (*places[:3], np.full(width.shape, 1.3))
    kernels.whole_widths(places, (width, width), still, (0.5, 0.6), False, (0, 12), coarse)
    assert np.isnan(coarse[:, :, 4]).all()

"""What a stripe's own light says where the profiles beside it do not tell how its surface lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from tests.points.walls import DUE, STEP, THICK, N, S, notched
from turnscan.points._cut import by_light, by_width, lacking
from turnscan.points._own_light import Alone, Own, by_own_light
from turnscan.points._wholeness import _dips, wholeness


@pytest.mark.parametrize(
    ("width", "light", "least", "most"),
    [
        (1.0, 1.0, 0.0, 0.06),
        (0.8, 1.0, 0.0, 0.06),  # narrower, but nothing is missing
        (0.7, 0.5, 0.3, 0.9),
        (0.7, 0.85, 0.03, 0.09),  # as on a wall that lies like the chord to one side
        (0.6, 0.7, 0.1, 0.6),
        (0.45, 0.25, 0.8, 1.3),
    ],
)
def test_between_coarse_steps_a_stripe_is_doubted_by_its_width_and_its_light(
    width, light, least, most
):
    """A groove narrower than a step: nothing beside tells what its walls cut off."""
    told = wholeness(notched(width, light))
    doubt = told.doubt[7] / DUE
    assert np.all((doubt >= least) & (doubt <= most)), doubt
    assert not told.shift.any()
    assert told.doubt[[6, 8]] / DUE == pytest.approx(0.0, abs=0.05), "those beside are whole"


def test_over_a_long_step_a_stripe_at_an_end_is_wider_than_a_chord_says_for_less():
    """The last profile is wider than is due on the chord to the one before: two surfaces, or
    another face than the chord's. The sheet reaches 1 mm."""
    by_step = {}
    for step in (0.9, 2.0, 4.0):
        seen = notched(1.0, 1.0, deep=0.0, step=step)
        seen.width[-1] *= 1.35
        by_step[step] = float(np.median(wholeness(seen).doubt[-1] / DUE))
    assert by_step[0.9] > 0.5
    # Half of the step and a quarter of it; what both sides say of a stripe adds a little.
    assert by_step[2.0] == pytest.approx(0.65 * by_step[0.9], rel=0.1)
    assert by_step[4.0] == pytest.approx(0.45 * by_step[0.9], rel=0.1)


@pytest.mark.parametrize(("width", "light", "deep"), [(1.6, 1.0, 2.0), (1.0, 2.0, 6.0)])
def test_what_is_wider_or_brighter_than_a_whole_stripe_is_not_believed_for_its_light(
    width, light, deep
):
    """Two surfaces behind each other have all of the light; and a dark line's best stripe says
    nothing of one with twice its light."""
    assert np.all(wholeness(notched(width, light, deep=deep)).doubt[7, 3:9] > 0.15 * DUE)


@pytest.mark.parametrize(
    ("light", "before", "gone"),
    [
        (0.03, 3.0, True),
        (0.03, 1.0, False),  # no further than the sheet's light may move it
        (0.2, 3.0, False),  # a thin dark bar
        (0.03, 0.0, False),  # dark paint
        (0.03, -3.0, False),  # the bottom of a hole
    ],
)
def test_faint_light_in_front_of_the_profiles_beside_is_no_stripe(light, before, gone):
    """In one profile the wall is not lit, and two steps further on a stripe falls on it again."""
    told = wholeness(notched(1.0, light, deep=-before))
    assert told.glow[7].all() == told.glow[7].any() == gone
    assert not np.delete(told.glow, 7, axis=0).any()
    rolled = notched(1.0, light, deep=-before)
    for k in (rolled.points, rolled.width, rolled.amplitude):
        k[:] = np.roll(k, 6, axis=0)  # now it is the last
    assert not wholeness(rolled).glow.any(), "nothing is known beyond it"


@pytest.mark.parametrize(("missing", "gone"), [(0, True), (2, False)])
def test_in_a_whole_turn_the_first_profile_is_beside_the_last(missing, gone):
    """Unless frames are missing between them."""
    seen = notched(1.0, 0.03, deep=-3.0)
    arrays = {k: getattr(seen, k) for k in ("points", "eyes", "width", "amplitude")}
    moved = {k: np.roll(v, 6, axis=0) for k, v in arrays.items()}  # the dark one is the last
    angles = 2 * np.pi / (S + missing) * np.arange(S)
    told = wholeness(replace(seen, **moved, angles=angles, closed=True))
    assert told.glow[-1].all() == told.glow[-1].any() == gone
    assert not told.glow[:-1].any()


@pytest.mark.parametrize("side", [6, 8])
def test_both_profiles_beside_are_asked_whether_faint_light_stands_in_front(side):
    """Not where the wall ends, one profile is as dark, or a frame is missing on one side."""
    assert wholeness(notched(1.0, 0.03, deep=-3.0)).glow[7].all()
    step, dark, gap = (notched(1.0, 0.03, deep=-3.0) for _ in range(3))
    rows = np.s_[:7] if side < 7 else np.s_[8:]
    step.points[rows, :, 1] -= 3.0
    dark.amplitude[side] *= 0.03
    gap.angles[rows] += (side - 7) * STEP / 40.0
    for seen in (step, dark, gap):
        assert not wholeness(seen).glow[7].any()


def test_light_that_is_known_badly_says_less():
    rng = np.random.default_rng(1)
    seen = notched(0.8, 1.0)
    noisy = replace(seen, amplitude=seen.amplitude * np.exp(0.3 * rng.standard_normal((S, N))))
    assert wholeness(noisy).doubt[7].max() > 3 * wholeness(seen).doubt[7].max()


def test_a_round_part_in_coarse_steps_has_its_slopes_from_both_chords():
    """A bump as wide as two steps, whose stripes are as wide and bright as is due on its sides."""
    steep = notched(1.0, 1.0, deep=1.0)
    assert wholeness(steep).doubt[6:9] / DUE == pytest.approx(0.0, abs=0.05)


def test_a_sheet_that_slopes_say_is_another_is_the_one_that_the_rig_states():
    """Chords of coarse steps lie otherwise than their surface: widths that do not follow them say
    nothing of how thick the sheet is."""
    rng = np.random.default_rng(2)
    seen = notched(1.0, 1.0)
    lean = np.cumsum(rng.uniform(-0.25, 0.45, S)) * STEP
    points = seen.points + lean[:, None, None] * [0.0, 1.0, 0.0]
    told = wholeness(replace(seen, points=points, width=np.full((S, N), DUE)))
    assert told.thickness == 0.0


@pytest.mark.parametrize(("light", "cut"), [(1.0, False), (0.62, False), (0.42, True), (0.2, True)])
def test_a_narrow_stripe_with_less_light_than_its_slope_sends_is_cut(light, cut):
    """Where a veil runs along the rays its plane explains a narrow stripe, and its ends are far."""
    seen = notched(0.65, light)
    walk = np.full((2, S, N), 0.2 * np.cos(0.4) / 0.65)
    none = np.zeros((S, N), np.bool_)
    own, alone = Own(seen.width, seen.amplitude, walk), Alone(none, none, none, none)
    due = by_own_light(
        seen, own, np.zeros((S, N)), alone, THICK, lambda w: np.full(w.shape, np.nan)
    )
    assert np.all((due[7] > 0.2 * seen.width[7]) == cut)
    assert not np.delete(due, 7, 0).any()


@pytest.mark.parametrize(
    ("width", "light", "doubted"),
    [
        (1.0, 1.0, False),
        (0.93, 1.2, False),  # speckle, on the whole stretch
        (1.0, 0.65, True),  # so wide by chance: a third of its light is missing
        (0.85, 1.0, True),  # between what the two chords say
        (0.85, 0.8, True),
    ],
)
def test_a_stripe_as_wide_and_bright_as_on_the_chord_to_one_side_is_whole(width, light, doubted):
    """Beside an edge between coarse steps the chord to one side runs on another face. To the other
    side the surface leans by 40°: stripes there are 0.74 as wide as one that faces the camera, and
    have 0.77 of its light; what speckle does to one line says nothing."""
    facing, lean = 0.2 * np.cos(0.4), np.tan(0.4)
    turned = np.deg2rad(-40.0)
    walk = np.stack([np.full((S, N), facing * (1 - lean * np.tan(a))) for a in (turned, 0.6)])
    seen = notched(width * facing / walk[0, 0, 0], light * np.cos(turned))
    seen.width[7, 5] *= 1.4
    seen.amplitude[7, 5] *= 0.3
    blind = np.broadcast_to((np.arange(S) == 7)[:, None], (S, N))
    none = np.zeros((S, N), np.bool_)
    before = np.where(blind, 0.3 * DUE, 0.0)
    doubt = by_own_light(
        seen, Own(seen.width, seen.amplitude, walk), before, Alone(none, none, blind, none), THICK,
        lambda w: np.full(w.shape, np.nan),
    )  # fmt: skip
    # One in sixteen may be cut just so.
    least, most = (0.3, 2.0) if doubted else (0.02, 0.12)
    assert np.all((doubt[7] >= least * DUE) & (doubt[7] <= most * DUE)), doubt[7] / DUE
    assert not np.delete(doubt, 7, 0).any()


@pytest.mark.parametrize(
    ("width", "light", "few", "doubted"),
    [
        (0.78, 0.5, False, True),
        (1.0, 0.5, False, False),  # dark paint
        (0.78, 1.0, False, False),  # narrow, and nothing is missing
        (0.78, 0.5, True, False),  # one profile of them says nothing of a line
    ],
)
def test_lines_whose_stripes_are_all_cut_alike_are_held_against_others(width, light, few, doubted):
    """A gear in as many steps as it has teeth, every profile in a gap: the hub above it tells how
    wide and bright a whole stripe is."""
    rng = np.random.default_rng(5)
    seen = notched(1.0, 1.0, deep=0.0)
    gap = np.zeros((S, N), np.bool_)
    gap[:, : N // 2] = True
    points = seen.points.copy()
    if few:
        points[1:, : N // 2] = np.nan
    wide = np.where(gap, width, 1.0) * np.exp(0.03 * rng.standard_normal((S, N)))
    bright = np.where(gap, light / width, 1.0) * np.exp(0.03 * rng.standard_normal((S, N)))
    walk = np.full((2, S, N), 0.2 * np.cos(0.4))
    none = np.isnan(points[..., 0])
    lit = replace(seen, points=points, width=np.where(none, np.nan, DUE * wide),
                  amplitude=np.where(none, np.nan, 100.0 * bright))  # fmt: skip
    alone = Alone(*np.zeros((3, S, N), np.bool_), np.ones((S, N), np.bool_))
    doubt = by_own_light(
        lit, Own(lit.width, lit.amplitude, walk), np.zeros((S, N)), alone, THICK,
        lambda w: np.full(w.shape, np.nan),
    )  # fmt: skip
    there = gap & ~none
    if doubted:
        # All that a cut at the middle moves a Gaussian: 0.8 of its width, and what noise makes.
        assert np.all((doubt[there] > 0.65 * DUE) & (doubt[there] < 0.95 * DUE)), doubt[there] / DUE
    else:
        assert not doubt[there].any()
    assert not doubt[~gap].any()


@pytest.mark.parametrize(
    ("width", "light", "gone"),
    [(0.3, 0.005, True), (1.0, 0.005, False), (0.3, 0.05, False)],
)
def test_of_what_next_to_nothing_is_left_no_stripe_is_believed(width, light, gone):
    """Peaks of noise in the light that other surfaces throw; dark paint, and a stripe that is cut,
    stay."""
    glow = wholeness(notched(width, light)).glow
    assert np.all(glow[7] == gone)
    assert not np.delete(glow, 7, 0).any()


@pytest.mark.parametrize(
    ("width", "bright", "gone"),
    [
        (3.0, 0.03, True),
        (0.4, 0.03, True),
        (3.0, 0.08, False),  # bright enough for a grazed surface
        (1.0, 0.03, False),  # dark paint
        (0.6, 0.03, False),  # the same, cut
    ],
)
def test_between_coarse_steps_a_stretch_of_faint_light_is_no_surface_by_its_widths(
    width, bright, gone
):
    """In the gap between two teeth of a gear, in steps after which no other profile lies in it:
    a glow, and peaks of noise in it."""
    glow = wholeness(notched(width, bright * width)).glow
    assert np.all(glow[7] == gone)
    assert not np.delete(glow, 7, 0).any()


def test_a_stretch_of_faint_light_is_judged_by_most_of_its_stripes():
    some = notched(1.0, 0.03)
    width = some.width.copy()
    width[7, :7] *= 3.0
    assert wholeness(replace(some, width=width)).glow[7].all()
    width[7, 3:7] /= 3.0
    assert not wholeness(replace(some, width=width)).glow.any()


@pytest.mark.parametrize("lines", [1, 2, 4])
def test_a_line_that_two_surfaces_above_each_other_share_is_doubted(lines):
    """It is as wide as due, and much fainter than those on either side; four of them are more than
    an edge across the profile makes."""
    light = np.full((S, N), 100.0)
    light[:, 6 : 6 + lines] = 30.0
    off = _dips(light, np.full((S, N), 2.0))
    assert np.all((off[:, 6 : 6 + lines] > 0.3 * 2.0) == (lines < 4))
    assert not np.delete(off, range(6, 6 + lines), 1).any()
    light[:, 6 + lines :] = np.nan
    assert not _dips(light, np.full((S, N), 2.0)).any(), "an end is no dip"


@pytest.mark.parametrize("left", [0.05, 0.3, 0.5, 0.8])
def test_a_gaussian_of_which_a_part_is_left_is_as_far_off_as_its_light_says(left):
    c = norm.ppf(left)
    assert by_light(np.array([left]))[0] == pytest.approx(norm.pdf(c) / left, rel=1e-9)
    assert by_light(np.array([1.5]), 0.9) == pytest.approx(by_light(np.array([0.9])), rel=1e-9)
    assert lacking(np.array([left]))[0] == pytest.approx(0.7 * norm.pdf(c) / left, rel=1e-9)
    assert lacking(np.array([0.9, np.nan])).tolist() == [0.0, 0.0]
    assert by_width(np.array([np.sqrt(1 - c * norm.pdf(c) / left - (norm.pdf(c) / left) ** 2)])) > 0

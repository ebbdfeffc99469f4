"""What is found, chosen, flagged and refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stripes.pictures import light
from turnscan.errors import InputError
from turnscan.stripes import StripeFlag, StripeSettings, choose, detect, find_candidates
from turnscan.stripes._levels import background
from turnscan.stripes._measure import plateau


def lines(rows: list[list[int]]) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """A small picture written by hand."""
    return np.array(rows, dtype=np.uint8)


def one(row: list[int], **wanted: Any) -> float:
    """The centre found in one hand-made row."""
    return float(detect(lines([row]), None, StripeSettings(threshold=10, **wanted)).position[0])


def stripe_picture(rows: int = 60, width: int = 120, seed: int = 0, sigma: float = 1.6) -> Any:
    """Noisy lit and dark uint8 pictures of a smooth stripe, and its centres."""
    rng = np.random.default_rng(seed)
    centre = width / 2 + 10 * np.sin(np.arange(rows) / 15)
    dark = rng.normal(20, 1.5, (rows, width))
    lit = rng.normal(20, 1.5, (rows, width)) + light(centre, sigma, 150.0, width)
    return lit.round().astype(np.uint8), dark.round().astype(np.uint8), centre


def test_maximum_takes_the_middle_of_a_plateau() -> None:
    assert one([0, 0, 50, 90, 60, 0, 0, 0], strategy="maximum") == 3
    assert one([0, 0, 50, 90, 90, 40, 0, 0], strategy="maximum") == 3.5
    assert one([0, 0, 80, 200, 200, 200, 50, 0], strategy="maximum") == 4


def test_centroid_weighs_the_run_above_the_threshold_by_intensity() -> None:
    assert one([0, 5, 20, 60, 20, 5, 0, 0], strategy="centroid") == 3
    assert one([0, 0, 20, 60, 40, 0, 0, 0], strategy="centroid") == pytest.approx(
        (2 * 20 + 3 * 60 + 4 * 40) / 120
    )
    # What is below the threshold of 10 has no say.
    assert one([0, 9, 20, 60, 40, 8, 0, 0], strategy="centroid") == pytest.approx(
        (2 * 20 + 3 * 60 + 4 * 40) / 120
    )


def test_median_halves_the_energy() -> None:
    assert one([0, 0, 20, 60, 20, 0, 0, 0], strategy="median") == 3
    # 60 of 120 units lie in the first two pixels: the median is the border between 3 and 4.
    assert one([0, 0, 20, 40, 60, 0, 0, 0], strategy="median") == pytest.approx(3.5)
    assert one([0, 0, 0, 30, 90, 0, 0, 0], strategy="median") == pytest.approx(3.5 + 30 / 90)


def test_three_points_and_squares() -> None:
    a, b, c = 50.0, 90.0, 60.0
    row = [0, 0, 50, 90, 60, 0, 0, 0]
    assert one(row, strategy="parabola") == pytest.approx(3 + 0.5 * (a - c) / (a - 2 * b + c))
    la, lb, lc = np.log([a, b, c])
    assert one(row, strategy="gauss3") == pytest.approx(3 + 0.5 * (la - lc) / (la - 2 * lb + lc))
    assert one(row, strategy="squared") == pytest.approx(
        (2 * a * a + 3 * b * b + 4 * c * c) / (a * a + b * b + c * c)
    )


def test_blais_rioux_finds_the_middle_of_a_symmetric_peak() -> None:
    row = [0, 0, 0, 0, 0, 10, 40, 90, 40, 10, 0, 0, 0, 0, 0]
    assert one(row, strategy="blais-rioux") == pytest.approx(7.0)


@pytest.mark.parametrize(("how", "where"), [("first", 20.3), ("last", 80.6), ("brightest", 50.2)])
def test_the_choice_among_three_peaks(how: Any, where: float) -> None:
    row = np.zeros(100)
    for centre, peak in ((20.3, 100.0), (50.2, 200.0), (80.6, 120.0)):
        row += light(np.array([centre]), 1.5, peak, 100)[0]
    lit = np.tile(row.round().astype(np.uint8), (20, 1))
    stripe = detect(lit, None, StripeSettings(choose=how))
    np.testing.assert_allclose(stripe.position, where, atol=0.05)
    assert (stripe.flags & StripeFlag.MULTI).all()
    candidates = find_candidates(lit)
    np.testing.assert_allclose(candidates.position[0], [20.3, 50.2, 80.6], atol=0.05)


def test_only_the_brightest_candidates_are_kept_in_order() -> None:
    row = np.zeros(120)
    for k, peak in enumerate((100.0, 40.0, 200.0, 60.0, 150.0)):
        row += light(np.array([10.0 + 25 * k]), 1.5, peak, 120)[0]
    found = find_candidates(row.round().astype(np.uint8)[None], None, StripeSettings(threshold=8))
    np.testing.assert_allclose(found.position[0], [10, 60, 110], atol=0.05)


def test_the_path_follows_the_stripe_past_a_brighter_ghost() -> None:
    rows, width = 120, 200
    centre = 60 + np.arange(rows) * 0.3
    lit = light(centre, 1.5, 90.0, width)
    lit[40:70] += light(np.full(30, 150.0), 1.5, 220.0, width)
    lit[80:82] = light(np.full(2, 20.0), 1.5, 220.0, width)  # the stripe itself is hidden here
    image = lit.round().astype(np.uint8)
    by_light = detect(image)
    assert np.abs(by_light.position[40:70] - 150).max() < 0.1
    path = detect(image, None, StripeSettings(choose="nearest"))
    seen = np.r_[0:80, 82:120]
    np.testing.assert_allclose(path.position[seen], centre[seen], atol=0.06)
    assert np.isnan(path.position[80:82]).all()
    assert (path.flags[80:82] & StripeFlag.AMBIGUOUS).all()
    assert not (path.flags[seen] & StripeFlag.AMBIGUOUS).any()


def test_two_equal_stripes_are_ambiguous() -> None:
    both = light(np.full(50, 30.0), 1.5, 100.0, 100) + light(np.full(50, 70.0), 1.5, 100.0, 100)
    stripe = detect(both.round().astype(np.uint8), None, StripeSettings(choose="nearest"))
    assert (stripe.flags & StripeFlag.AMBIGUOUS).all()


def test_near_peaks_are_split_and_speckle_is_not() -> None:
    pair = light(np.full(30, 40.0), 1.5, 120.0, 100) + light(np.full(30, 50.0), 1.5, 100.0, 100)
    found = find_candidates(pair.round().astype(np.uint8))
    np.testing.assert_allclose(found.position[:, :2], np.tile([40.0, 50.0], (30, 1)), atol=0.1)
    rough = light(np.full(30, 40.0), 3.0, 150.0, 100)
    rough[:, 38] *= 0.6  # a dark speckle in the middle
    found = find_candidates(rough.round().astype(np.uint8))
    assert np.isnan(found.position[:, 1]).all()


def test_roi_and_mask_say_where_to_look() -> None:
    lit, dark, centre = stripe_picture()
    lit[:, 5] = 255
    inside = detect(lit, dark, StripeSettings(roi=(20, 10, 110, 40)))
    np.testing.assert_allclose(inside.position[10:40], centre[10:40], atol=0.2)
    assert np.isnan(inside.position[[5, 45]]).all()
    assert (inside.flags[:10] & StripeFlag.OUTSIDE).all()
    assert (inside.flags[40:] & StripeFlag.OUTSIDE).all()
    mask = np.ones(lit.shape, dtype=bool)
    mask[:, :20] = False
    mask[50:] = False
    masked = detect(lit, dark, StripeSettings(mask=mask))
    np.testing.assert_allclose(masked.position[:50], centre[:50], atol=0.2)
    assert (masked.flags[50:] & StripeFlag.OUTSIDE).all()
    nothing = detect(lit, dark, StripeSettings(mask=np.zeros(lit.shape, dtype=bool)))
    assert (nothing.flags & StripeFlag.OUTSIDE).all()
    with pytest.raises(InputError, match="roi"):
        detect(lit, dark, StripeSettings(roi=(0, 0, 121, 10)))
    with pytest.raises(InputError, match="mask"):
        detect(lit, dark, StripeSettings(mask=np.ones((3, 3), dtype=bool)))


@pytest.mark.parametrize("strategy", ["window", "maximum", "centroid", "median", "blais-rioux"])
@pytest.mark.parametrize("choice", ["brightest", "first", "last", "nearest"])
@pytest.mark.parametrize(
    "lit",
    [
        np.zeros((20, 30), np.uint8),
        np.full((20, 30), 255, np.uint8),
        np.full((20, 30), 77, np.uint16),
        np.zeros((20, 1), np.uint8),
        np.full((20, 1), 255, np.uint8),
        np.zeros((1, 30), np.uint8),
        np.array([[200]], np.uint8),
    ],
    ids=["black", "white", "grey16", "narrow", "narrow-white", "one-row", "one-pixel"],
)
def test_pictures_without_a_stripe(lit: Any, choice: Any, strategy: Any) -> None:
    stripe = detect(lit, None, StripeSettings(choose=choice, strategy=strategy))
    assert not stripe.found.any()
    assert (stripe.flags & StripeFlag.DARK).all()
    paired = detect(lit, np.zeros_like(lit), StripeSettings(choose=choice, strategy=strategy))
    assert len(paired.position) == lit.shape[0]


def test_pictures_of_few_columns_with_a_threshold() -> None:
    for width in (1, 2, 3, 4):
        lit = np.full((5, width), 200, np.uint8)
        stripe = detect(lit, None, StripeSettings(threshold=50))
        assert stripe.found.all()
        assert (np.abs(stripe.position - (width - 1) / 2) < 0.51).all()


def test_light_at_the_border_is_flagged() -> None:
    for centre in (0.0, 99.0):
        lit = light(np.full(10, centre), 2.0, 150.0, 100).round().astype(np.uint8)
        stripe = detect(lit)
        assert stripe.found.all()
        assert np.abs(stripe.position - centre).max() < 1.0
        assert (stripe.flags & StripeFlag.EDGE).all()


def test_the_ends_of_a_stripe_are_flagged() -> None:
    lit = light(np.full(40, 50.0), 1.5, 150.0, 100)
    lit[:10] = 0
    lit[25:] = np.roll(lit[25:], 20, axis=1)
    stripe = detect(lit.round().astype(np.uint8))
    ends = np.flatnonzero(stripe.flags & StripeFlag.EDGE)
    np.testing.assert_array_equal(ends, [10, 24, 25])


def test_a_grazing_stretch_is_flagged() -> None:
    lit = light(np.full(100, 60.0), 1.5, 150.0, 120)
    lit[70:80] = light(np.full(10, 60.0), 6.0, 150.0, 120)
    stripe = detect(lit.round().astype(np.uint8))
    assert (stripe.flags[70:80] & StripeFlag.GRAZING).all()
    assert not (stripe.flags[:68] & StripeFlag.GRAZING).any()


def test_saturation_is_learned_or_given() -> None:
    lit = light(np.full(10, 50.0), 2.0, 600.0, 100)
    eight = np.minimum(lit, 255).astype(np.uint8)
    assert (detect(eight).flags & StripeFlag.SATURATED).all()
    twelve = np.minimum(lit * 16, 4095).astype(np.uint16)
    assert (detect(twelve).flags & StripeFlag.SATURATED).all()
    below = (lit * 4).astype(np.uint16)
    assert not (detect(below).flags & StripeFlag.SATURATED).any()
    given = detect(below, None, StripeSettings(saturation=2000.0))
    assert (given.flags & StripeFlag.SATURATED).all()


@pytest.mark.parametrize("top", [1009, 1019, 4040, 16_100])
def test_a_peak_that_ends_near_the_top_of_some_depth_is_not_taken_for_clipped(top: int) -> None:
    lit = light(np.full(10, 50.3), 2.0, float(top), 100)
    whole = detect(lit.astype(np.uint16))
    assert not (whole.flags & StripeFlag.SATURATED).any()
    bits = int(top).bit_length()
    clipped = detect(np.minimum(4 * lit, 2**bits - 1).astype(np.uint16))
    assert (clipped.flags & StripeFlag.SATURATED).all()
    # Five times as large, when the one value decided.
    assert np.median(whole.sigma) < 0.5 * np.median(clipped.sigma)


def test_the_background_is_known_between_grey_levels_and_in_one() -> None:
    nothing, roi = np.zeros((1, 400), np.uint8), (0, 0, 400, 300)
    level, noise = background(np.full((300, 400), 20, np.uint8), nothing, roi)
    assert level == pytest.approx(20.0)
    assert noise < 0.5
    seen = np.random.default_rng(0).normal(20.3, 1.5, (300, 400))
    level, noise = background(seen.round().astype(np.uint8), nothing, roi)
    assert level == pytest.approx(20.3, abs=0.1)
    assert noise == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize(("run", "middle"), [([5, 9, 9, 9, 4], 2.0), ([9, 9, 3, 9, 9], 0.5)])
def test_the_first_run_of_the_highest_pixels_is_the_plateau(run: list[int], middle: float) -> None:
    assert plateau(np.array(run, float), 0, len(run) - 1) == (middle, 9.0)


def test_settings_are_compared_without_their_masks() -> None:
    one, two = (StripeSettings(mask=np.full((2, 2), k)) for k in (True, False))
    assert one == two
    assert hash(one) == hash(two)


@pytest.mark.parametrize(("share", "told"), [(0.02, False), (0.08, True)])
def test_a_weaker_peak_in_lines_whose_stripe_glows_is_said(share: float, told: bool) -> None:
    """It stands where the light beside the stripe has faded; the stripe's own glow decides, and
    what is less than a fiftieth of its height close by is none."""
    strong, weak = np.full(60, 60.3), np.full(60, 110.4)
    glow = 20_000 * share * np.exp(-np.abs(np.arange(321) - 60.3) / 12)
    lit = light(strong, 2.0, 20_000.0, 321) + light(weak, 2.0, 6000.0, 321) + glow
    noise = np.random.default_rng(1).normal(100.0, 5.0, lit.shape)
    found = find_candidates((lit + noise).round().astype(np.uint16))
    at = np.abs(found.position - 110.4) < 3
    assert at.sum() == 60
    assert (((found.flags[at] & StripeFlag.HALO) != 0) == told).all()


def test_a_line_that_falls_back_to_another_strategy_has_the_sigma_of_that() -> None:
    rng = np.random.default_rng(3)
    lit = light(np.full(60, 60.0), 1.5, 120.0, 120)
    lit[:, 62:] += 40.0 * np.exp(-(np.arange(58) / 12.0))
    lit = (lit + rng.normal(10.0, 1.0, lit.shape)).round().astype(np.uint8)
    fell, chosen = detect(lit), detect(lit, None, StripeSettings(strategy="blais-rioux"))
    np.testing.assert_array_equal(fell.position, chosen.position)
    np.testing.assert_allclose(fell.sigma, chosen.sigma, rtol=1e-9)


@given(seed=st.integers(0, 1000), sigma=st.floats(0.8, 4.0), sixteen=st.booleans())
@settings(max_examples=25)
def test_horizontal_is_vertical_turned(seed: int, sigma: float, sixteen: bool) -> None:
    lit, dark, _ = stripe_picture(seed=seed, sigma=sigma)
    if sixteen:
        lit, dark = lit.astype(np.uint16) * 16, dark.astype(np.uint16) * 16
    upright = detect(lit, dark, StripeSettings(threshold=12))
    lying = detect(lit.T, dark.T, StripeSettings(threshold=12, orientation="horizontal"))
    np.testing.assert_array_equal(upright.position, lying.position)
    np.testing.assert_array_equal(upright.flags, lying.flags)
    np.testing.assert_array_equal(upright.pixels, lying.pixels[:, ::-1])


@given(shift=st.integers(-25, 25), down=st.integers(0, 20), seed=st.integers(0, 100))
@settings(max_examples=25)
def test_the_stripe_moves_with_the_picture(shift: int, down: int, seed: int) -> None:
    lit, dark, _ = stripe_picture(seed=seed)
    here = detect(lit, dark)
    moved = [np.roll(p, (down, shift), axis=(0, 1)) for p in (lit, dark)]
    wanted = StripeSettings(threshold=15.0)
    there = detect(moved[0], moved[1], wanted)
    here = detect(lit, dark, wanted)
    rows = np.arange(20, 35)
    np.testing.assert_allclose(there.position[rows + down], here.position[rows] + shift, atol=0.02)


@given(gain=st.integers(2, 200), seed=st.integers(0, 100))
@settings(max_examples=25)
def test_more_light_changes_the_amplitude_only(gain: int, seed: int) -> None:
    lit, dark, _ = stripe_picture(seed=seed)
    lit, dark = lit.astype(np.uint16), dark.astype(np.uint16)
    weak = detect(lit, dark)
    strong = detect(lit * np.uint16(gain), dark * np.uint16(gain))
    assert weak.found.all()
    assert strong.found.all()
    np.testing.assert_allclose(strong.position, weak.position, atol=0.02)
    np.testing.assert_allclose(strong.amplitude, weak.amplitude * gain, rtol=0.02)


@given(
    data=st.integers(0, 2**32 - 1),
    height=st.integers(1, 40),
    width=st.integers(1, 200),
    choice=st.sampled_from(["brightest", "first", "last", "nearest"]),
    strategy=st.sampled_from(
        ["window", "maximum", "centroid", "median", "parabola", "blais-rioux"]
    ),
    paired=st.booleans(),
)
@settings(max_examples=150)
def test_any_picture_gives_a_valid_stripe(
    data: int, height: int, width: int, choice: Any, strategy: Any, paired: bool
) -> None:
    rng = np.random.default_rng(data)
    kind = np.uint8 if data % 2 else np.uint16
    top = np.iinfo(kind).max
    lit = (rng.random((height, width)) ** rng.uniform(0.2, 30) * top).astype(kind)
    dark = (rng.random((height, width)) * top).astype(kind) if paired else None
    wanted = StripeSettings(choose=choice, strategy=strategy, max_candidates=1 + data % 5)
    found = find_candidates(lit, dark, wanted)
    assert found.position.shape == (height, 1 + data % 5)
    here = ~np.isnan(found.position)
    assert ((found.position[here] > -0.6) & (found.position[here] < width - 0.4)).all()
    assert (found.sigma[here] > 0).all()
    apart = np.diff(found.position, axis=1)
    assert (apart[here[:, 1:]] >= 0).all()
    stripe = detect(lit, dark, wanted)
    again = choose(found, wanted)
    np.testing.assert_array_equal(stripe.position, again.position)
    np.testing.assert_array_equal(stripe.sigma, again.sigma)
    np.testing.assert_array_equal(stripe.flags, again.flags)
    assert ((stripe.flags & (StripeFlag.DARK | StripeFlag.OUTSIDE)) > 0)[~stripe.found].all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"strategy": "best"},
        {"choose": "left"},
        {"orientation": "diagonal"},
        {"max_candidates": 0},
        {"max_candidates": 6},
        {"threshold": float("nan")},
        {"threshold": 0.0},
        {"width": -1.0},
        {"roi": (5, 5, 5, 9)},
        {"electrons_per_dn": 0.0},
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        StripeSettings(**wrong)


def test_pictures_that_cannot_be_used_are_refused() -> None:
    good = np.zeros((4, 5), np.uint8)
    with pytest.raises(InputError, match="float64"):
        detect(np.zeros((4, 5)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="shape"):
        detect(np.zeros((4, 5, 3), np.uint8))
    with pytest.raises(InputError, match="laser off"):
        detect(good, np.zeros((4, 6), np.uint8))
    with pytest.raises(InputError, match="laser off"):
        detect(good, np.zeros((4, 5), np.uint16))

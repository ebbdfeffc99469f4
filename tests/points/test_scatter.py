"""Scatter of the centres from several pictures together: steadier than one picture's, and local."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.points._scatter import pooled_sigma
from turnscan.stripes import Stripe, StripeFlag, scattered

LINES, WIDTH, NOISE = 200, 1.5, 0.02
PATTERN = np.sqrt(20 * 0.4549) / 8 * (-1.0) ** np.arange(LINES)
"""Every third difference of neighbours is the median that a standard normal scatter gives."""


def stripe(per_width: float, flags: int = 0, lines: int = LINES) -> Stripe:
    """With this scatter, as `choose` would give it, in a pattern whose third differences are as
    large in all lines."""
    one = np.where(np.arange(LINES) < lines, 1.0, np.nan)
    sigma = np.sqrt(NOISE**2 + np.nan_to_num(per_width) * WIDTH)
    bits = np.full(LINES, flags, np.uint16)
    middle = 100 + sigma * PATTERN
    return Stripe(middle * one, sigma * one, 80 * one, WIDTH * one, bits, scatter=per_width)


def drawn(
    per_width: float, noise: np.random.Generator, flags: int = 0, grain: int = 1, gap: int = 0
) -> Stripe:
    """A stripe that scatters so, in grains so many lines high, as `choose` would find it. A gap of
    one line after each so many lines parts surfaces that lie 5 px apart."""
    of_grain = np.repeat(noise.normal(size=-(-LINES // grain) + 1), grain)[grain // 2 :][:LINES]
    middle = 100 + NOISE * noise.normal(size=LINES) + np.sqrt(per_width * WIDTH) * of_grain
    if gap:
        middle += 5.0 * (np.arange(LINES) // gap % 2)
        middle[gap::gap] = np.nan
    one = np.where(np.isnan(middle), np.nan, 1.0)
    bits = np.full(LINES, flags, np.uint16)
    plain = Stripe(middle, NOISE * one, 80 * one, WIDTH * one, bits)
    sigma = scattered(plain)
    own = float(np.nanmax(sigma**2 - NOISE**2) / WIDTH)
    return replace(plain, sigma=sigma, scatter=own)


def pooled(stripes: list[Stripe], closed: bool = True) -> Floats:
    # Noise is another one in each picture: the same pattern in all of them would be a shape.
    other = max(len(stripes) // 16, 1)
    stripes = [
        replace(s, position=200.0 - s.position) if k // other % 2 else s
        for k, s in enumerate(stripes)
    ]
    sigma, width, flags = (
        np.stack([getattr(s, name) for s in stripes]) for name in ("sigma", "width", "flags")
    )
    turns = np.arange(len(stripes)) * 2 * np.pi / len(stripes)
    return pooled_sigma(stripes, sigma, width, flags, turns, closed)[0]


@pytest.mark.parametrize("closed", [True, False])
def test_what_each_picture_finds_by_chance_is_taken_together(closed: bool) -> None:
    found = 0.01 * np.random.default_rng(2).normal(1.0, 0.16, 60)
    sigma = pooled([stripe(s) for s in found], closed)[:, 0]
    own = np.sqrt(NOISE**2 + found * WIDTH)
    assert own.std() / own.mean() > 0.06
    assert sigma.std() / sigma.mean() < 0.03
    assert np.sqrt((sigma**2).mean()) == pytest.approx(np.sqrt((own**2).mean()), rel=0.01)


def test_pictures_in_which_photons_decide_do_not_say_how_others_scatter() -> None:
    """Every second one shows the dim bottom of a gap, and claims more noise than it has."""
    noise = np.random.default_rng(6)
    bright = [drawn(0.01, noise) for _ in range(20)]
    claimed = np.full(LINES, 0.25)
    dim = [
        replace(
            Stripe(100 + 0.2 * noise.normal(size=LINES), claimed, 5 + 0 * claimed,
                   np.full(LINES, WIDTH), np.zeros(LINES, np.uint16)),
            scatter=0.0,
        )
        for _ in range(20)
    ]  # fmt: skip
    sigma = pooled([s for pair in zip(bright, dim, strict=True) for s in pair])[::2]
    usual = float(np.median(sigma))
    assert usual == pytest.approx(np.sqrt(NOISE**2 + 0.01 * WIDTH), rel=0.08)


def test_pictures_that_surely_scatter_otherwise_keep_what_is_theirs() -> None:
    found = np.full(60, 0.01)
    found[20] = 0.2
    found[40:] = 0.05
    sigma = pooled([stripe(s) for s in found])[:, 0]
    surely = (NOISE**2 + 0.2 * WIDTH) / (1 + 3 * 2.5 / np.sqrt(LINES))
    assert sigma[20] ** 2 == pytest.approx(surely, rel=1e-6), "the least that its own allows"
    inside = np.r_[0:12, 30:32]
    assert sigma[30] ** 2 < 2.5 * 0.01 * WIDTH
    assert sigma[50] ** 2 == pytest.approx(0.05 * WIDTH, rel=0.2)
    assert (sigma[inside] < sigma[50]).all()


@pytest.mark.parametrize("flags", [0, StripeFlag.EDGE, StripeFlag.SATURATED | StripeFlag.HALO])
def test_a_picture_of_few_lines_has_the_scatter_of_those_about_it(flags: int) -> None:
    stripes = [stripe(0.01) for _ in range(60)]
    few = stripe(np.nan, flags, lines=12)
    stripes[7] = replace(few, sigma=np.where(few.found, NOISE, np.nan))
    sigma = pooled(stripes)
    assert sigma[7, :12] == pytest.approx(sigma[8, :12])
    assert np.isnan(sigma[7, 12:]).all()


@pytest.mark.parametrize("lines", [4, 6, 9, 15, 22])
@pytest.mark.parametrize("count", [24, 60])
def test_pictures_none_of_which_has_lines_enough_know_it_together(lines: int, count: int) -> None:
    """A low part: each stripe is a few lines high, and lies on a surface of its own slope."""
    noise, true = np.random.default_rng(100 * lines + count), 0.01
    stripes = [low(true, noise, lines) for _ in range(count)]
    found = np.nanmean(pooled(stripes) ** 2 - NOISE**2) / WIDTH
    # Differences that share lines are not independent: 2.5 / sqrt(n) is half of what it may be off.
    unsure = 2 * 2.5 / np.sqrt(count * (lines - 3))
    assert -1.5 * unsure < found / true - 1 < 2.5 * unsure, "with its own uncertainty, once"


def test_a_surface_that_bends_within_few_lines_is_not_taken_for_scatter() -> None:
    noise, true = np.random.default_rng(8), 0.01
    stripes = [low(true, noise, 20, bend=0.3) for _ in range(60)]
    found = np.nanmean(pooled(stripes) ** 2 - NOISE**2) / WIDTH
    assert found / true < 1.5


def test_where_no_lines_tell_sigma_is_a_quarter_of_the_width() -> None:
    noise = np.random.default_rng(9)
    stripes = [low(0.01, noise, 3) for _ in range(60)]
    sigma = pooled(stripes)[:, :3]
    assert sigma == pytest.approx(np.sqrt(NOISE**2 + (0.25 * WIDTH) ** 2))


def test_one_picture_that_tells_does_not_speak_for_those_far_off() -> None:
    noise = np.random.default_rng(10)
    stripes = [low(0.01, noise, 12) for _ in range(60)]
    stripes[7] = stripe(0.04)
    sigma = pooled(stripes)[:, 0]
    assert sigma[10] ** 2 - NOISE**2 == pytest.approx(0.04 * WIDTH, rel=0.01)
    assert sigma[40] ** 2 - NOISE**2 == pytest.approx(0.01 * WIDTH, rel=0.5)


def low(per_width: float, noise: np.random.Generator, lines: int, bend: float = 0.0) -> Stripe:
    """A stripe of so many lines, too few to tell its own scatter, that bends by ``bend`` px from
    its middle to its ends."""
    whole = drawn(per_width, noise)
    one = np.where(np.arange(LINES) < lines, 1.0, np.nan)
    along = np.linspace(-1, 1, lines)
    shape = np.zeros(LINES)
    shape[:lines] = noise.normal() * along + bend * along**2
    bare = Stripe(
        whole.position + shape * one, NOISE * one, 80 * one, WIDTH * one, np.zeros(LINES, np.uint16)
    )
    sigma = scattered(bare)
    return replace(bare, sigma=sigma, scatter=np.nan)


def test_centres_of_other_origin_and_lone_pictures_stay_as_they_are() -> None:
    stripes = [stripe(0.01 + 0.002 * (k % 2)) for k in range(60)]
    for k, flag in ((4, StripeFlag.HAND), (5, StripeFlag.REFINED)):
        stripes[k] = replace(stripes[k], flags=np.full(LINES, flag, np.uint16))
    sigma = pooled(stripes)
    assert np.array_equal(sigma[4:6], np.stack([s.sigma for s in stripes[4:6]]))
    assert np.allclose(pooled(stripes[:1]), stripes[0].sigma)
    known = [stripe(0.0) for _ in range(60)]
    assert np.array_equal(pooled(known), np.stack([s.sigma for s in known])), "photons say it all"


def test_what_is_far_off_on_the_turn_is_not_asked() -> None:
    found = np.where(np.arange(16) < 8, 0.01, 0.012)
    sigma = pooled([stripe(s) for s in found])[:, 0] ** 2 - NOISE**2
    assert sigma[3] == pytest.approx(0.01 * WIDTH)
    assert sigma[11] == pytest.approx(0.012 * WIDTH)


@pytest.mark.parametrize(("grain", "gap"), [(1, 0), (2, 0), (3, 0), (1, 25), (2, 25)])
def test_chance_makes_it_no_larger_and_neither_grain_nor_edges_hide_or_feign_it(grain, gap):
    noise = np.random.default_rng(31 * grain + gap)
    true = 0.01
    stripes = [drawn(true, noise, grain=grain, gap=gap) for _ in range(120)]
    sigma = pooled(stripes)
    found = np.nanmean(sigma**2 - NOISE**2) / WIDTH
    # A median of squares knows a variance to 2.5 / sqrt(n); neighbours in a grain are one.
    unsure = 2.5 / np.sqrt(120 * LINES / grain)
    assert abs(found / true - 1) < 3 * unsure + 0.02
    if grain == 1:
        alone = np.mean([s.scatter for s in stripes])
        assert found < alone, "each alone takes the largest of three"


@pytest.mark.parametrize(("grain", "least", "most"), [(1, 0.0, 0.1), (2, 0.2, 0.5), (4, 0.4, 0.9)])
def test_lines_that_share_a_grain_are_known_to_err_alike(grain, least, most):
    noise = np.random.default_rng(grain)
    stripes = [drawn(0.01, noise, grain=grain) for _ in range(60)]
    sigma, width, flags = (
        np.stack([getattr(s, name) for s in stripes]) for name in ("sigma", "width", "flags")
    )
    turns = np.arange(60) * 2 * np.pi / 60
    alike = pooled_sigma(stripes, sigma, width, flags, turns, True)[1]
    assert least <= alike <= most


def test_where_photons_explain_all_chance_adds_nothing():
    noise = np.random.default_rng(5)
    known = [drawn(0.0, noise) for _ in range(60)]
    assert sum(s.scatter > 0 for s in known) > 10, "alone, many find some by chance"
    found = np.nanmean(pooled(known) ** 2) / NOISE**2
    assert found == pytest.approx(1.0, abs=3 * 2.5 / np.sqrt(60 * LINES)), "photons say it all"


def turned(
    shape: Floats, noise: np.random.Generator, steps: int, shift: float = 0.0
) -> list[Stripe]:
    """Stripes of a part that is turned, ``shape`` (LINES,) px, or a thread that is ``shift`` lines
    higher after a turn."""
    lines = np.arange(LINES)
    out = list[Stripe]()
    for k in range(steps):
        plain = drawn(0.01, noise)
        more = np.interp((lines - shift * k / steps) % LINES, lines, shape, period=LINES)
        bare = replace(plain, position=plain.position + more, sigma=np.full(LINES, NOISE))
        sigma = scattered(bare)
        own = float(np.nanmax(sigma**2 - NOISE**2) / WIDTH)
        out.append(replace(bare, sigma=sigma, scatter=own))
    return out


def scatter_of(stripes: list[Stripe]) -> float:
    sigma, width, flags = (
        np.stack([getattr(s, name) for s in stripes]) for name in ("sigma", "width", "flags")
    )
    turns = np.arange(len(stripes)) * 2 * np.pi / len(stripes)
    found = pooled_sigma(stripes, sigma, width, flags, turns, True)[0]
    return float(np.mean(found**2 - NOISE**2) / WIDTH)


@pytest.mark.parametrize("steps", [24, 60, 160])
@pytest.mark.parametrize(("high", "shift"), [(1.0, 0.0), (4.0, 0.0), (1.5, 8.0)])
def test_collars_and_a_thread_are_the_parts_shape_and_no_scatter(steps, high, shift):
    shape = high * np.where(np.arange(LINES) // 4 % 2, 0.5, -0.5)
    if shift:
        shape = high * (np.abs(np.arange(LINES) % 8 - 4) / 4 - 0.5)
    stripes = turned(shape, np.random.default_rng(steps), steps, shift)
    alone = np.mean([s.scatter for s in stripes])
    assert alone > 4 * 0.01, "each picture takes it for scatter"
    assert 0.8 < scatter_of(stripes) / 0.01 < (1.25 if not shift else 3.0)


def test_what_only_adjacent_profiles_share_is_scatter() -> None:
    """A print on the part, or the light of one grain in two of them."""
    noise = np.random.default_rng(3)
    grain = [noise.normal(size=LINES) for _ in range(60)]
    stripes = []
    for k in range(60):
        own = (grain[k] + grain[k - 1] + grain[k - 2]) / np.sqrt(3.0)
        bare = Stripe(
            100 + NOISE * noise.normal(size=LINES) + np.sqrt(0.01 * WIDTH) * own,
            np.full(LINES, NOISE), np.full(LINES, 80.0), np.full(LINES, WIDTH),
            np.zeros(LINES, np.uint16),
        )  # fmt: skip
        sigma = scattered(bare)
        per_width = float(np.nanmax(sigma**2 - NOISE**2) / WIDTH)
        stripes.append(replace(bare, sigma=sigma, scatter=per_width))
    assert 0.85 < scatter_of(stripes) / 0.01 < 1.2


def test_pictures_in_which_the_light_leaps_do_not_make_the_others_sure() -> None:
    """They scatter like nothing else, and hardly overlap with those beside them."""
    noise = np.random.default_rng(12)
    stripes = [drawn(0.01, noise) for _ in range(60)]
    wild = [5, 6, 20, 41]
    for k in wild:
        there = noise.random(LINES) < 0.4
        there[:40] = True
        bare = replace(
            stripes[k],
            position=np.where(there, 100 + 30 * noise.normal(size=LINES), np.nan),
            sigma=np.where(there, NOISE, np.nan),
            amplitude=np.where(there, 80.0, np.nan), width=np.where(there, WIDTH, np.nan),
        )  # fmt: skip
        sigma = scattered(bare)
        per_width = float(np.nanmax(sigma**2 - NOISE**2) / WIDTH)
        stripes[k] = replace(bare, sigma=sigma, scatter=per_width)
    found = np.nanmean(pooled(stripes) ** 2 - NOISE**2, axis=1) / WIDTH
    assert found.min() > 0.7 * 0.01
    assert (found[wild] > 10.0).all()


def test_a_picture_that_nothing_can_be_held_against_keeps_what_it_says() -> None:
    """Light leaps in one whose lines are not among those of the pictures beside it."""
    shape = np.where(np.arange(LINES) // 4 % 2, 1.0, -1.0)
    stripes = turned(shape, np.random.default_rng(7), 60)
    leaps = 10.0 * np.random.default_rng(8).normal(size=LINES)
    low = np.arange(LINES) < 90
    for k in (16, 18, 19, 20, 21, 22, 24):
        s, there, more = stripes[k], low == (k == 20), leaps * (k == 20)
        names = ("position", "sigma", "amplitude", "width")
        kept = {name: np.where(there, getattr(s, name), np.nan) for name in names}
        bare = replace(s, **{**kept, "position": kept["position"] + more})
        bare = replace(bare, sigma=np.where(there, NOISE, np.nan))
        per_width = float(np.nanmax(scattered(bare) ** 2 - NOISE**2) / WIDTH)
        stripes[k] = replace(bare, sigma=scattered(bare), scatter=per_width)
    turns = np.arange(60) * 2 * np.pi / 60
    sigma, width, flags = (
        np.stack([getattr(s, name) for s in stripes]) for name in ("sigma", "width", "flags")
    )
    found = pooled_sigma(stripes, sigma, width, flags, turns, True)[0] ** 2 - NOISE**2
    assert np.nanmedian(found[20]) / WIDTH > 10.0
    assert np.nanmedian(found[50]) / WIDTH == pytest.approx(0.01, rel=0.25)


def test_in_pictures_that_blur_along_the_stripe_what_is_common_may_be_the_blurs() -> None:
    from scipy.ndimage import gaussian_filter1d

    noise = np.random.default_rng(5)
    shape = np.where(np.arange(LINES) // 9 % 2, 1.0, -1.0)
    stripes = [
        replace(s, position=gaussian_filter1d(s.position, 1.5))
        for s in turned(shape, noise, 60)
    ]  # fmt: skip
    sharp = scatter_of(turned(shape, noise, 60))
    assert scatter_of(stripes) > 3 * sharp

"""Colour pictures give the stripe, and the numbers about it, that grey ones give."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from turnscan.stripes import Signal, StripeFlag, StripeSettings, detect


def pictures(dtype, gain=1.0):
    rng = np.random.default_rng(0)
    u = np.arange(200)
    lit = rng.normal(20, 1.5, (120, 200, 3))
    dark = rng.normal(20, 1.5, (120, 200, 3))
    lit[..., 1] += 150 * np.exp(-0.5 * ((u - 90.3) / 1.7) ** 2)
    return [np.clip(p * gain, 0, np.iinfo(dtype).max).astype(dtype) for p in (lit, dark)]


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("with_dark", [False, True])
@pytest.mark.parametrize("weights", [(0.0, 1.0, 0.0), (-0.3, 1.0, -0.3), (0.2, 0.6, 0.2)])
@pytest.mark.parametrize(("dtype", "scale"), [("uint8", 1.0), ("uint16", 100.0)])
def test_a_colour_stripe_is_as_good_as_a_grey_one(dtype, scale, weights, with_dark, known):
    lit, dark = pictures(dtype, scale)
    off = dark if with_dark else None
    signal = Signal(weights, dtype)
    w = np.array(weights)
    level = 0.0 if with_dark else 20.0 * w.sum() * scale
    noise = 1.5 * np.linalg.norm(w) * scale * (2**0.5 if with_dark else 1.0)
    got = signal.detect(
        signal.project(lit),
        None if off is None else signal.project(off),
        StripeSettings(),
        *((level * signal.gain, noise * signal.gain) if known else ()),
    )
    assert got.found.all()
    assert np.median(got.amplitude) == pytest.approx(150 * w[1] * scale, rel=0.05)
    error = got.position - 90.3
    rms = float(np.sqrt(np.mean(error**2)))
    assert 0.005 < rms < 0.06
    assert 0.5 * rms < np.median(got.sigma) < 2.0 * rms


def test_a_threshold_is_in_grey_levels():
    lit, dark = pictures("uint8")
    signal = Signal((0.0, 1.0, 0.0))
    seen = [
        signal.detect(
            signal.project(lit), signal.project(dark), StripeSettings(threshold=t)
        ).found.all()
        for t in (100.0, 170.0)
    ]
    assert seen == [True, False]


def test_grey_pictures_pass_through():
    lit, dark = (p[..., 1].copy() for p in pictures("uint8"))
    a, b = Signal(None).detect(lit, dark, StripeSettings()), detect(lit, dark)
    assert np.array_equal(a.position, b.position, equal_nan=True)
    assert np.array_equal(a.sigma, b.sigma, equal_nan=True)


def broken_off(line: int, away: int = 0):
    """A picture of a stripe, from ``line`` on ``away`` px further (0: it goes on)."""
    lit, dark = (p[..., 1].copy() for p in pictures("uint8"))
    lit[line:] = np.roll(lit[line:], away, axis=1)
    return lit, dark


def ends_of(lit, dark, inside):
    mask = maximum_filter(inside, 49)
    stripe = Signal(None).detect(lit, dark, StripeSettings(mask=mask), inside=inside)
    assert not stripe.found[~inside.any(axis=1)].any()
    return np.flatnonzero(stripe.found & ((stripe.flags & StripeFlag.EDGE) != 0)).tolist()


def test_a_stripe_goes_on_beyond_what_counts():
    inside = np.zeros((120, 200), bool)
    inside[30:80] = True
    whole = broken_off(80)
    assert ends_of(*whole, inside) == []
    assert ends_of(*whole, np.ones_like(inside)) == []
    # By columns too: below line 80 the stripe is seen where it does not count.
    inside[80:, 120:] = True
    assert ends_of(*broken_off(80, 3), inside) == []


def test_a_stripe_that_ends_where_the_volume_ends_has_an_edge():
    inside = np.zeros((120, 200), bool)
    inside[:80] = True
    lit, dark = broken_off(80, 20)
    assert ends_of(lit, dark, inside) == [79], "what goes on is another surface"
    lit[80:] = dark[80:]
    assert ends_of(lit, dark, inside) == [79], "nothing goes on"


@pytest.mark.parametrize(
    ("away", "pedestal", "kept"), [(12, 60.0, False), (12, 0.0, True), (60, 60.0, True)]
)
def test_the_glow_of_what_does_not_count_is_no_stripe(away, pedestal, kept):
    """Beside a stripe that left the region: a weaker one counts where it is not haloed, or far."""
    u = np.arange(200)
    lit = 150 * np.exp(-0.5 * ((u - 60.3) / 1.7) ** 2) + 60 * np.exp(
        -0.5 * ((u - 60 - away) / 3.0) ** 2
    )
    lit += pedestal * np.exp(-0.5 * ((u - 60 - away) / 9.0) ** 2)
    lit = np.tile(lit.round().astype(np.uint8), (60, 1))
    inside = np.zeros_like(lit, bool)
    inside[:, 66:] = True
    look = StripeSettings(mask=maximum_filter(inside, 49), threshold=20.0)
    stripe = Signal(None).detect(lit, None, look, inside=inside)
    assert stripe.found.all() == kept
    assert stripe.found.any() == kept
    assert kept or (stripe.flags == StripeFlag.OUTSIDE).all()
    # Seen whole, it is the weaker of two.
    both = Signal(None).detect(lit, None, look)
    assert np.abs(both.position - 60.3).max() < 1.0

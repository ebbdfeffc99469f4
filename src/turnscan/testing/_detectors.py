"""What every stripe detector must do, as checks that its author can run."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image
from turnscan.stripes import Detector, Signal, Stripe, StripeFlag, StripeSettings

_ROWS, _COLUMNS = 96, 200
_LEVEL, _NOISE, _PEAK, _WIDTH = 20.0, 1.5, 120.0, 2.5
_OUTLIER = 2.0
"""px from the truth at which a centre is on something else."""
_FEW = 0.02
"""Part of the rows that may be missed or wrong in an easy picture."""
_FAR = 1.0
"""px rms in an easy picture, in which the maximum alone is within 0.5."""
_HONEST = (0.1, 5.0)
"""Of the error's rms and the median of sigma, between which a claim has some worth."""


@dataclass(frozen=True)
class CheckedDetector:
    """How well a detector did in the pictures of `check_detector`; its limits are far wider."""

    rms: float
    """px: error of the centres on a stripe of 2.5 px (rms) and 80 times the noise."""
    found: float
    """Part of the rows of that picture with a centre."""
    claimed: float
    """px: median of sigma there."""


def check_detector(detector: str | Detector) -> CheckedDetector:
    """Run a stripe detector through all that turnscan relies on.

    ``detector`` is the function, or the name it is installed by (entry point
    ``turnscan.detectors``). The pictures are drawn here: nothing but turnscan is needed.

    Checked are: one value a row, of 8 and 16 bits, with and without a picture of the background,
    standing and lying; centres follow a stripe that moves by whole pixels; sigma has some worth; no
    centre where there is no light or where none may be; the pictures stay as they are; the same
    picture gives the same stripe, from several threads at once, too.

    Returns how well it did. Raises AssertionError, saying what is not as it must be, and
    PluginError where the detector fails.
    """
    settings = StripeSettings(strategy=detector)
    truth = _truth()
    lit, dark = _pictures(truth, np.uint8)
    first = _sought(lit, dark, settings)
    done = _check_accuracy(first, truth)
    with ThreadPoolExecutor(4) as pool:
        again = list(pool.map(lambda _: _sought(lit, dark, settings), range(8)))
    assert all(_same(s, first) for s in again), "the same picture gives another stripe each time"
    for other in (_sought(lit, None, settings), _sought(*_pictures(truth, np.uint16), settings)):
        _check_accuracy(other, truth)
    lying = StripeSettings(strategy=detector, orientation="horizontal")
    turned = _sought(lit.T.copy(), dark.T.copy(), lying)
    assert turned.orientation == "horizontal", f"a lying stripe is called {turned.orientation}"
    assert _same(turned, first), "the same picture lying on its side gives another stripe"
    _check_shift(settings, lit, dark, first)
    _check_darkness(settings, dark)
    _check_region(detector, lit, dark)
    return done


def _truth() -> Floats:
    """(n,) px: a stripe that leans, bends and wanders through all phases of the pixels."""
    v = np.arange(_ROWS)
    bent: Floats = 70.0 + 0.31 * v + 8.0 * np.sin(v / 17.0)
    return bent


def _pictures(truth: Floats, dtype: type[np.uint8] | type[np.uint16]) -> tuple[Image, Image]:
    """A stripe with noise, and the same without the laser; read-only."""
    rng = np.random.default_rng(8)
    scale = 1.0 if dtype is np.uint8 else 257.0
    light = _PEAK * np.exp(-0.5 * ((np.arange(_COLUMNS) - truth[:, None]) / _WIDTH) ** 2)

    def seen(signal: Floats) -> Image:
        levels = scale * (_LEVEL + signal + rng.normal(0.0, _NOISE, light.shape))
        whole = np.clip(np.rint(levels), 0, np.iinfo(dtype).max)
        picture = whole.astype(np.uint8) if dtype is np.uint8 else whole.astype(np.uint16)
        picture.flags.writeable = False
        return picture

    return seen(light), seen(np.zeros_like(light))


def _sought(lit: Image, dark: Image | None, settings: StripeSettings) -> Stripe:
    """The stripe as a scan would get it; the pictures must not change."""
    before = lit.copy()
    name = "uint8" if lit.dtype == np.uint8 else "uint16"
    stripe = Signal(None, name).detect(lit, dark, settings)  # type: ignore[arg-type]
    assert np.array_equal(lit, before), "it wrote into the picture"
    return stripe


def _same(a: Stripe, b: Stripe) -> bool:
    pairs = ((a.position, b.position), (a.sigma, b.sigma), (a.amplitude, b.amplitude))
    return all(np.array_equal(x, y, equal_nan=True) for x, y in pairs)


def _check_accuracy(stripe: Stripe, truth: Floats) -> CheckedDetector:
    error: npt.NDArray[np.float64] = stripe.position - truth
    found = stripe.found
    missed = 1.0 - float(found.mean())
    assert missed <= _FEW, f"in {missed:.0%} of the rows of an easy picture it found nothing"
    wild = float((np.abs(error[found]) > _OUTLIER).mean())
    assert wild <= _FEW, f"{wild:.0%} of the centres lie more than {_OUTLIER:g} px off the stripe"
    good = error[found & (np.abs(error) <= _OUTLIER)]
    rms = float(np.sqrt(np.mean(good**2)))
    assert rms <= _FAR, f"centres are {rms:.2f} px (rms) off in an easy picture"
    claimed = float(np.median(stripe.sigma[found]))
    low, high = _HONEST
    assert low <= rms / claimed <= high, (
        f"sigma is {claimed:.2g} px where centres are {rms:.2g} px off: between {low:g} and "
        f"{high:g} times it would be honest"
    )
    return CheckedDetector(rms, float(found.mean()), claimed)


def _check_shift(settings: StripeSettings, lit: Image, dark: Image, first: Stripe) -> None:
    by = 40
    moved = _sought(np.roll(lit, by, axis=1), np.roll(dark, by, axis=1), settings)
    both = moved.found & first.found
    off = np.abs(moved.position - first.position - by)[both]
    assert (off < 0.05).mean() > 1 - _FEW, (
        f"a picture moved by {by} px moves the centres by up to {off.max():.2g} px more or less"
    )


def _check_darkness(settings: StripeSettings, dark: Image) -> None:
    rng = np.random.default_rng(9)
    noise = np.rint(rng.normal(_LEVEL, _NOISE, dark.shape)).astype(np.uint8)
    stripe = _sought(noise, dark, settings)
    seen = float(stripe.found.mean())
    assert seen <= _FEW, f"without any light it found centres in {seen:.0%} of the rows"
    flags = stripe.flags[~stripe.found]
    assert (flags & StripeFlag.DARK).all(), "rows without light are not flagged DARK"
    same = _sought(dark, dark, settings)
    assert not same.found.any(), "it found centres where both pictures are equal"


def _check_region(detector: str | Detector, lit: Image, dark: Image) -> None:
    mask = np.zeros(lit.shape, np.bool_)
    mask[30:60] = True
    stripe = _sought(lit, dark, StripeSettings(strategy=detector, mask=mask))
    assert stripe.found[30:60].mean() > 1 - _FEW, "it lost the stripe where the picture was masked"
    assert not stripe.found[:30].any(), "it found centres where none may be"
    assert not stripe.found[60:].any(), "it found centres where none may be"

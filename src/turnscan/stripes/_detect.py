"""Pictures → Candidates → Stripe: the doors to the kernels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image, Region
from turnscan.errors import InputError
from turnscan.stripes._detector import centres_of, told
from turnscan.stripes._light import Light
from turnscan.stripes._settings import Choice, Strategy, StripeSettings
from turnscan.stripes._stripe import MEASURES, Candidates, Orientation, Stripe, StripeFlag

if TYPE_CHECKING:
    from turnscan.stripes._scan import Terms

Table = npt.NDArray[np.float64]
Bits = npt.NDArray[np.uint16]

MIN_THRESHOLD = 4.0
"""Quantisation steps: below this the automatic threshold would follow rounding."""
MIN_PICTURE = 128
"""px: narrower pictures get black columns, so that the kernel need not know such."""
HYSTERESIS = 0.5
"""A run above the threshold goes on down to this part of it."""
WINDOW_LOSS = 1.3
"""Excess speckle variance of the ±2.5 sigma window (docs/explain/stripes.md)."""


def find_candidates(
    lit: Image, dark: Image | None = None, settings: StripeSettings | None = None
) -> Candidates:
    """Find up to K possible centres in every line of a picture.

    ``lit`` and ``dark`` are (H, W) pictures with the laser on and off, uint8 or uint16, of the
    same shape and type. Raises InputError where they are not, or where the region of interest
    lies outside.
    """
    settings = settings or StripeSettings()
    table, bits = _tables(lit, dark, settings)
    return Candidates.made_of(table, bits, settings.orientation)


def choose(candidates: Candidates, settings: StripeSettings | None = None) -> Stripe:
    """Choose one candidate in every line.

    A line where none was found or chosen is NaN with the flag DARK, and AMBIGUOUS too where the
    path left out what was there. Where the electrons per grey level are unknown, the sigmas are
    raised to the scatter of the centres along the stripe, which holds the speckle.
    """
    settings = settings or StripeSettings()
    c = candidates
    return chosen(c.table(), c.flags.copy(), c.orientation, settings, c.beyond)


def detect(lit: Image, dark: Image | None = None, settings: StripeSettings | None = None) -> Stripe:
    """Find the stripe in a picture: `find_candidates`, then `choose`, in one go.

    Lines outside the region of interest are NaN with the flag OUTSIDE, lines without light NaN
    with the flag DARK.
    """
    settings = settings or StripeSettings()
    table, bits = _tables(lit, dark, settings)
    return chosen(table, bits, settings.orientation, settings)


def light(lit: Image, dark: Image | None, settings: StripeSettings) -> Light:
    """The laser's light in a picture, for those who look at more than the stripe's centre.

    Background, noise and shot noise are those that `detect` takes. Raises InputError like it.
    """
    lit, off, roi = _prepare(lit, dark, settings)
    terms = _terms(lit, off, roi, settings)
    return Light(lit, off, terms.base, math.sqrt(terms.variance), terms.per_level)


def scattered(stripe: Stripe) -> Floats:
    """The sigmas (n,) px of a stripe, raised to the scatter of its centres along it.

    As `choose` does where the electrons per grey level are unknown.
    """
    from turnscan.stripes._choice import scatter

    per_width = scatter(stripe.table(), np.array(stripe.flags))
    raised: Floats = np.sqrt(stripe.sigma**2 + np.nan_to_num(per_width) * stripe.width)
    return raised


def _tables(lit: Image, dark: Image | None, settings: StripeSettings) -> tuple[Table, Bits]:
    """Run the kernel: (5, lines, K) position, sigma, amplitude, width, halo; (lines, K) flags."""
    columns = lit.shape[1 if settings.orientation == "vertical" else 0]
    lit, off, roi = _prepare(lit, dark, settings)
    lines = lit.shape[0]
    table = np.full((MEASURES, lines, settings.max_candidates), np.nan)
    bits = np.zeros((lines, settings.max_candidates), np.uint16)
    if roi[0] < roi[2] and roi[1] < roi[3]:
        terms = _terms(lit, off, roi, settings)
        if isinstance(settings.strategy, str):
            from turnscan.stripes._kernels import detect_lines

            detect_lines(lit, off, roi, terms, table, bits)
        else:
            table, bits = _by_another(lit[:, :columns], off[:, :columns], roi, terms, settings)
    bits[: roi[1], 0] |= np.uint16(StripeFlag.OUTSIDE)
    bits[roi[3] :, 0] |= np.uint16(StripeFlag.OUTSIDE)
    return table, bits


def _by_another(
    lit: Image, off: Image, roi: tuple[int, int, int, int], terms: Terms, s: StripeSettings
) -> tuple[Table, Bits]:
    """What a detector of others finds in the region, as the kernel would give it."""
    assert not isinstance(s.strategy, str)
    u0, v0, u1, v1 = roi
    dark = np.ascontiguousarray(np.broadcast_to(off, lit.shape))
    seen = dark.copy()
    seen[v0:v1, u0:u1] = lit[v0:v1, u0:u1]
    known = told(s, terms.base, terms.noise, terms.level)
    table, bits = centres_of(s.strategy, readable(seen), readable(dark), known, s.max_candidates)
    lost = np.ones(len(bits), np.bool_)
    lost[v0:v1] = False
    table[:, lost], bits[lost] = np.nan, 0
    return table, bits


def _prepare(
    lit: Image, dark: Image | None, settings: StripeSettings
) -> tuple[Image, Image, Region]:
    """Check the pictures and lay them so that lines are rows; no laser-off picture is zeros."""
    for name, image in (("lit", lit), ("dark", dark)):
        if image is None:
            continue
        if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16) or not image.size:
            raise InputError(
                f"{name} is a {image.dtype} array of shape {image.shape}",
                hint="give (H, W) uint8 or uint16; project_colour makes one of a colour picture",
            )
    if dark is not None and (dark.shape != lit.shape or dark.dtype != lit.dtype):
        raise InputError(
            f"laser on is {lit.dtype} {lit.shape}, laser off {dark.dtype} {dark.shape}",
            hint="both pictures must come from the same camera",
        )
    height, width = lit.shape
    roi = region_of(settings, (height, width))
    if settings.mask is not None:
        # The light outside the mask is put out.
        lit = np.where(settings.mask, lit, lit.dtype.type(0) if dark is None else dark)
    if settings.orientation == "horizontal":
        lit = lit.T
        dark = None if dark is None else dark.T
    off = np.zeros((1, lit.shape[1]), lit.dtype) if dark is None else dark
    lack = MIN_PICTURE - lit.shape[1]
    if lack > 0:
        lit, off = (np.pad(image, ((0, 0), (0, lack))) for image in (lit, off))
    return readable(lit), readable(off), roi


def region_of(settings: StripeSettings, shape: tuple[int, int]) -> Region:
    """The region of interest, no larger than the mask, in pictures (H, W) laid so that lines are
    rows. Raises InputError where it or the mask does not fit the pictures.
    """
    height, width = shape
    u0, v0, u1, v1 = settings.roi or (0, 0, width, height)
    if u1 > width or v1 > height:
        raise InputError(
            f"roi {settings.roi} reaches beyond the picture of {width} × {height}",
            hint="give (u0, v0, u1, v1) with u1 ≤ width and v1 ≤ height",
        )
    mask = settings.mask
    if mask is not None:
        if mask.shape != shape:
            raise InputError(
                f"mask of shape {mask.shape} for a picture of shape {shape}",
                hint="give a mask of the picture's shape",
            )
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if not len(rows):
            return 0, 0, 0, 0
        u0, v0 = max(u0, int(columns[0])), max(v0, int(rows[0]))
        u1, v1 = min(u1, int(columns[-1]) + 1), min(v1, int(rows[-1]) + 1)
        u1, v1 = max(u0, u1), max(v0, v1)
    return (u0, v0, u1, v1) if settings.orientation == "vertical" else (v0, u0, v1, u1)


def readable(image: Any) -> Any:
    """A contiguous read-only view: one type for the compiler, whoever owns the picture."""
    view = np.ascontiguousarray(image).view()
    view.flags.writeable = False
    return view


def _terms(lit: Image, off: Image, roi: Region, s: StripeSettings) -> Terms:
    from turnscan.stripes import _levels

    known = s.background or _levels.background(lit, off, roi)
    return terms_of(s, known, paired=off.shape[0] > 1)


def terms_of(s: StripeSettings, background: tuple[float, float], *, paired: bool) -> Terms:
    """The threshold, the noise and the rest of what the kernel needs to know.

    ``background`` is its level and noise; ``paired`` tells that there is a laser-off picture.
    """
    from turnscan.stripes import _scan

    level, noise = background
    step = s.quantisation
    noise = max(noise, step / math.sqrt(12.0))
    base = level if s.threshold is None else 0.0
    threshold = s.threshold
    if threshold is None:
        threshold = max(s.noise_factor * noise, MIN_THRESHOLD * step)
    variance = noise**2
    if s.read_noise is not None:
        variance = (2.0 if paired else 1.0) * (s.read_noise**2 + step**2 / 12.0)
    grain = s.speckle_grain
    speckle = 0.0
    if grain > 0.0:
        area = 4.0 / math.pi * grain**2
        looks = area / math.hypot(1.0, 1.18 * grain)
        speckle = WINDOW_LOSS * s.speckle_contrast**2 * looks / (4.0 * math.sqrt(math.pi))
    return _scan.Terms(
        base=float(base),
        level=float(threshold),
        low=float(max(HYSTERESIS * threshold, min(2.0 * noise, threshold))),
        noise=float(noise),
        variance=float(variance),
        per_level=1.0 / s.electrons_per_dn if s.electrons_per_dn else 0.0,
        with_background=s.read_noise is not None,
        speckle=float(speckle),
        width=float(s.width or 0.0),
        saturation=float(s.saturation or 0.0),
        strategy=get_args(Strategy).index(s.strategy) if isinstance(s.strategy, str) else 0,
    )


def chosen(
    table: Table,
    bits: Bits,
    orientation: Orientation,
    settings: StripeSettings,
    beyond: Floats | None = None,
) -> Stripe:
    """Choose, gather, and let the scatter along the stripe have its say about sigma."""
    from turnscan.stripes._choice import choose_lines

    lines = table.shape[1]
    outside = np.empty((lines, 0)) if beyond is None else np.array(beyond)
    out = np.empty((MEASURES, lines))
    flags = np.empty(lines, np.uint16)
    how = get_args(Choice).index(settings.choose)
    alone = settings.electrons_per_dn is None
    scatter = choose_lines(table, bits, how, alone, outside, out, flags)
    return Stripe.made_of(out, flags, orientation, scatter)

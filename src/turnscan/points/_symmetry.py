"""Symmetric stripes: what cuts a stripe off makes it lean, so one that does not lean is whole."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.threads import in_parts

_BLUR = 0.5
"""px rms: what lens and pixel add to every stripe. It widens, and leaves the third moment alone."""
_LEANS = 0.2
"""Skewness, in the detector's window, of a Gaussian of which a cut has moved the centre by a
ninth of its width; stripes that lean more keep all of their doubt."""
_UNSURE = 0.02
"""Skewness that is left of what is none, after the lines about it are averaged."""
_ALONG = 8
"""Lines to either side that lean alike where an edge cuts them."""
_STANDS_OUT = 2.0
"""Times the usual skewness of five lines by which some must lean more than most to count by
themselves: an edge may be short."""
_SYMMETRIC = 0.25
"""rms of how far the centre of a symmetric stripe is off, in its widths, whatever doubts it: two
lights that still look like one lie no further than 0.6 from their middle."""


def as_it_leans(doubt: Floats, width: Floats, skewness: Floats | None) -> Floats:
    """(s, n) px: a ``doubt`` (s, n) px of stripes ``width`` (s, n) px wide, NaN where there is
    none, no larger than their ``skewness`` (s, n) allows; as it is where that is None or NaN.

    A stripe is doubted for being narrower, wider or fainter than is due. But a surface that lies
    otherwise to the light than chords of coarse steps say makes it so as well, and leaves it
    symmetric. What cuts it, or is lit beside it, does not: a Gaussian cut at its middle has, in the
    window of ± 2.5 widths, a skewness of 0.67, and one of which 2 % are gone has 0.08. Stripes that
    the blur alone makes so wide say nothing.
    """
    if skewness is None:
        return doubt
    with np.errstate(invalid="ignore", divide="ignore"):
        own = np.maximum(1.0 - (_BLUR / width) ** 2, 0.0) ** 1.5
        lean = (_lean(np.where(np.isnan(width), np.nan, skewness)) + _UNSURE) / own / _LEANS
        most = _SYMMETRIC * width / np.maximum(1.0 - lean, 0.0)
    return np.where(np.isnan(lean), doubt, np.fmin(doubt, most))


def steady(values: Floats) -> Floats:
    """The kernel of that name, in parts."""
    from turnscan.points import _wholeness_kernels as kernels

    return np.concatenate(in_parts(lambda a, b: kernels.steady(values[a:b]), len(values)))


def _lean(skewness: Floats) -> Floats:
    """(s, n) how far stripes lean, beyond what speckle makes of it line by line: the mean of a
    stretch of lines, or the median of a few that stand out of what is usual."""
    near = np.abs(steady(skewness))
    there = ~np.isnan(skewness)
    if not there.any():
        return near
    usual = float(np.median(near[there])) / 0.6745
    total, count = (_windows(v) for v in (np.nan_to_num(skewness), there.astype(np.float64)))
    mean = np.abs(total) / np.maximum(count, 1.0)
    return np.where(there, np.maximum(mean, near - _STANDS_OUT * usual), np.nan)


def _windows(values: Floats) -> Floats:
    """(s, n) sums of values (s, n) over the lines about each."""
    sums = np.cumsum(np.pad(values, ((0, 0), (_ALONG + 1, _ALONG))), axis=1)
    return np.asarray(sums[:, 2 * _ALONG + 1 :] - sums[:, : -2 * _ALONG - 1])

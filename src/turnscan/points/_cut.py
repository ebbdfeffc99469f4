"""How far the centre of a stripe is off of which something is cut away.

Of a Gaussian cut off c of its widths beyond its middle the part f = Φ(c) is left. Its centre is
λ = φ(c)/Φ(c) off, and it is √(1 − cλ − λ²) wide, in widths of the whole.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats

NOISE = 0.06
"""Speckle makes the median of five widths this much narrower or wider."""
_MOST = 0.5
"""What is missing of a width tells no more beyond this."""
_WIDER = 0.8
"""Width that a second surface adds, as width that a cut takes away: the two parts of a stripe lie
that far apart where both are alike."""
_WHOLE, _FAINTEST = 0.85, 0.02
"""Part of the light from which on a stripe lacks none, and of which the second at least is
believed."""
_LACKING = 0.7
"""Part that is doubted of how far the cut that takes so much moves a centre."""


def by_width(ratio: Floats, sure: Floats | float = 0.0) -> Floats:
    """How far a stripe's centre is off, in widths of the whole one, by the part of its due width.

    Nothing where that part is within ``sure`` of the whole. What is too wide lies on two surfaces;
    its centre is off alike.
    """
    x = np.where(ratio < 1, 1.0 - ratio, _WIDER * (ratio - 1.0))
    x = np.sqrt(np.maximum(np.minimum(x, _MOST) ** 2 - NOISE**2, 0.0)) * ~(x < sure)
    return np.asarray(0.9 * x + 2.75 * x * x)


def by_light(left: Floats, whole: float = 1.0) -> Floats:
    """The same by the part of its light that is ``left``: of no more than the part ``whole``."""
    from scipy.special import ndtri

    f = np.clip(np.nan_to_num(left, nan=1.0), _FAINTEST, whole)
    return np.asarray(np.exp(-0.5 * ndtri(f) ** 2) / (np.sqrt(2 * np.pi) * f))


def lacking(left: Floats, part: float = _LACKING) -> Floats:
    """How far, in widths of the whole one, it is doubted for the light that it lacks: this ``part``
    of how far the cut that takes so much moves a centre."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(left < _WHOLE, part * by_light(left, _WHOLE), 0.0))

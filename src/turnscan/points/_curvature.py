"""What a thick sheet of light does on a curved surface, and how much of it each point has.

The sides of a sheet lie lower on a round surface than its middle, and more of the camera's pixels
see the side that is turned to it: the centre of the light is not that of the sheet. Square to a
cylinder of radius R the point lies 3/2 σ²/R too deep, σ the sheet's rms thickness
(docs/explain/accuracy.md).
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.points._lit_points import LitPoints

_SPAN = 4.0
"""Thicknesses of the sheet over which the curvature is taken, to either side: as far as its light
lies. At least a step."""
_THIN = 0.7
"""Part of what the whole shift would be at a radius that is doubted where a part is thin."""
_BESIDE = 8
"""Lines to either side that tell how thin it is."""
_WIDEST = 0.5
"""Widths of the stripe beyond which no shift is believed."""


def curvature_shift(light: LitPoints, thickness: float) -> Floats:
    """(s, n) px by which the centre of each stripe lies beside the sheet's middle; 0 where the
    surface about it is not known.

    A line of the picture sees the sheet's light on a curve across the profiles, X(s) ≈ X₀ + t s +
    K s²/2: the surface's section by the plane in which that line looks, by Meusnier's theorem from
    the curve through the same line of the neighbouring profiles. With d the distance from the
    sheet, c = t·n its slope there, a the picture's direction, v the one to the camera and r the way
    to it, a Gaussian sheet of rms ``thickness`` σ mm has its centre of light at

        ū = σ²/c² [ K·a/2 − (q − 2)(t·a)(K·n)/2c − (q − 1)(t·a)(v·t)(K·m)/2(v·m) + q (t·a)(v·t)/r ],

    m the curve's normal towards the camera: what the surface sinks, what the sheet meets beside,
    and the pixels that see each side, for it is turned away or nearer to the camera. The last does
    not need a curve: planes have it, too. q is 3 for all of the light. The detector's window of
    ± 2.5 widths leaves out 0.609 of the profile's skewness, as much of it as is the sheet's and not
    a blur's: q = 3 − 0.609 (σ t·a / c w)², w the stripe's width.

    Curvature is taken over ± `_SPAN` σ, and not where the points reach over less than half of that:
    beside the axis, where no turn carries them that far, it would be their noise (`thin_doubt`). It
    is steadied along the profile and over the neighbours over and beyond, and counts as far as they
    have the same: an edge is none.
    """
    from turnscan.points import _curvature_kernels as kernels

    width = np.nan_to_num(light.width)
    curve, slant, steps = kernels.shifts(
        light.points, light.eyes, light.moves, light.sheets, width, thickness, _SPAN * thickness,
        light.closed,
    )  # fmt: skip
    common = kernels.agreed(kernels.evened(curve), steps, light.closed)
    most = _WIDEST * width
    return np.asarray(np.clip(np.nan_to_num(common) + np.nan_to_num(slant), -most, most))


def thin_doubt(light: LitPoints, thickness: float) -> Floats:
    """(s, n) mm: how far points may lie too deep where a part round the axis is thinner than light
    of this rms ``thickness`` mm; 0 elsewhere.

    There all sides lie within the light, and no curve is long enough to say how they bend. Their
    usual distance from the axis says that they do: 3/2 σ²/R, but no more than R itself. Faces that
    pass beside the axis are further off it elsewhere; in a part of a turn that may not be seen.
    """
    from scipy import ndimage

    away = np.hypot(light.points[..., 0], light.points[..., 1])
    out = np.zeros(away.shape)
    if np.isnan(away).all():
        return out
    lines = np.flatnonzero(~np.isnan(away).all(axis=0))
    usual = np.nanmedian(away[:, lines], axis=0)
    usual = ndimage.median_filter(usual, 2 * _BESIDE + 1, mode="nearest")
    thin = usual < _SPAN * thickness
    if thin.any():
        radius = np.maximum(usual[thin], 1e-9)
        depth = np.minimum(radius, 1.5 * thickness**2 / radius)
        out[:, lines[thin]] = np.where(away[:, lines[thin]] < _SPAN * thickness, _THIN * depth, 0.0)
    return out

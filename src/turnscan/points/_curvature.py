"""What a thick sheet of light does on a curved surface, and how much of it each point has.

The sides of a sheet lie lower on a round surface than its middle, and more of the camera's pixels
see the side that is turned to it: the centre of the light is not that of the sheet. Square to a
cylinder of radius R the point lies 3/2 σ²/R too deep, σ the sheet's rms thickness
(docs/explain/accuracy.md).
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.points._wholeness import LitPoints

_SPAN = 4.0
"""Thicknesses of the sheet over which the curvature is taken, to either side: as far as its light
lies. At least a step."""
_WIDEST = 0.5
"""Widths of the stripe beyond which no shift is believed."""


def curvature_shift(light: LitPoints, thickness: float) -> Floats:
    """(s, n) px by which the centre of each stripe lies beside the sheet's middle; 0 where no
    curvature is known.

    The curve that the sheet's light lies on runs across the profiles, X(s) ≈ X₀ + t s + K s²/2.
    With d the distance from the sheet, c = t·n its slope there, a the picture's direction and v the
    one to the camera, a Gaussian sheet of rms ``thickness`` σ mm has its centre of light at

        ū = σ²/c² [ K·a/2 − (t·a)(K·n)/2c − (t·a)(v·t)(K·m)/(v·m) ],

    m the curve's normal towards the camera: what the surface sinks, what the sheet meets beside,
    and the pixels that see each side. Curvature is taken over ± `_SPAN` σ, steadied along the
    profile, and counts as far as the neighbours over and beyond have the same: an edge is none.
    """
    from turnscan.points import _curvature_kernels as kernels

    per_square, steps = kernels.shifts(
        light.points, light.eyes, light.moves, light.sheets, _SPAN * thickness, light.closed
    )
    common = kernels.agreed(kernels.evened(per_square), steps, light.closed)
    most = _WIDEST * np.nan_to_num(light.width)
    return np.asarray(np.clip(np.nan_to_num(common) * thickness**2, -most, most))

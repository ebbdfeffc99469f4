"""Whether a tolerance says something about a part."""

from __future__ import annotations

import math

import numpy as np

from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.remedy import Option

_MOST = 0.1
"""Of the part's diagonal: a fit within more than that says nothing, as anything fits."""


def check_tolerance(tolerance: float | None, mesh: Mesh, option: str = "tolerance") -> None:
    """Raise InputError for a tolerance (mm; None is the usual one) that is no length, or within
    which most of the part lies."""
    if tolerance is None:
        return
    if not (tolerance > 0 and math.isfinite(tolerance)):
        raise InputError(f"tolerance {tolerance:g} mm", hint="give a positive length in mm")
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))) if len(mesh.vertices) else 0.0
    if size and tolerance > _MOST * size:
        raise InputError(
            f"more than a tenth of the part, whose diagonal is {size:.4g} mm: anything would fit",
            hint="give a length in mm that is small beside the part",
            option=Option(option, tolerance),
        )

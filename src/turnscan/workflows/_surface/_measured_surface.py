"""A surface that is to be measured, with what there is to say of its unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._surface._loading import Source, load

_SMALLEST, _LARGEST = 8.0, 3000.0
"""mm: diagonals that a part on a turntable has."""


def measured_surface(source: Source, why: str, progress: Progress) -> Loaded:
    """The surface: of a scan as its own settings make it. ``why`` it is needed is the hint of the
    error.

    Raises InputError where it has no face; else as `load`.
    """
    loaded = load(source, progress=progress)
    if not len(loaded.mesh.faces):
        raise InputError(f"{loaded.name}: no faces", hint=why)
    return replace(loaded, findings=(*loaded.findings, *_unit(loaded)))


def _unit(loaded: Loaded) -> list[Finding]:
    """What there is to say where a file is more likely in inches or metres than in mm."""
    size = float(np.linalg.norm(np.ptp(loaded.mesh.vertices, axis=0)))
    if _SMALLEST <= size <= _LARGEST or loaded.reconstructed:
        return []
    return [
        Finding(
            "surface.unit", "warning",
            f"the part has a diagonal of {size:.4g} mm: the file may be in another unit, such as "
            "inches or metres; its numbers are taken as mm",
            "export the part in mm",
        )
    ]  # fmt: skip

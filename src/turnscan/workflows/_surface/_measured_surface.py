"""A surface that is to be measured, and how its calibration's doubt moves it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.meshing import source_of
from turnscan.progress import Progress
from turnscan.shapes import calibration_moves
from turnscan.workflows._surface._loading import Loaded, Source, load
from turnscan.workflows._surface._reconstruct import reconstruct
from turnscan.workflows._surface._result import ReconstructResult

_SMALLEST, _LARGEST = 8.0, 3000.0
"""mm: diagonals that a part on a turntable has."""


def measured_surface(source: Source, why: str, progress: Progress) -> tuple[Loaded, list[Floats]]:
    """The surface, and how its vertices (v, 3) mm move with one standard deviation of each cause.

    A scan is reconstructed with its own settings; of a mesh no common cause is known. ``why`` a
    surface is needed is the hint of the error.

    Raises InputError where it has no face; else as `load` and `reconstruct`.
    """
    if isinstance(source, str | Path) and Path(source).suffix.lower() == ".turnscan":
        source = reconstruct(source, progress=progress)
    loaded = load(source, progress=progress)
    if not len(loaded.mesh.faces):
        raise InputError(f"{loaded.name}: no faces", hint=why)
    if not isinstance(source, ReconstructResult):
        return replace(loaded, findings=(*loaded.findings, *_unit(loaded))), []
    done = source.reconstruction
    known = done.source or source_of(done.grids, source.rig)
    moves = [*calibration_moves(loaded.mesh, known), *known.moves]
    return replace(loaded, made_from=known), moves


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

"""How far an open scan lies from a reference, for showing it on the surface as it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan import edit
from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.progress import Progress
from turnscan.workflows._compare import Comparison, compare
from turnscan.workflows._compare_options import CompareOptions


@dataclass(frozen=True, eq=False)
class ShownDeviation:
    """Deviations of the vertices of an open scan."""

    distance: Floats
    """(v,) mm of each vertex of the body, positive outside; NaN where nothing was measured, and
    where the reference says nothing."""
    comparison: Comparison


def shown_deviation(
    body: edit.Body, reference: Path, options: CompareOptions, progress: Progress
) -> ShownDeviation:
    """Compare what was measured of a body with a reference in the same frame.

    Raises InputError where there is nothing to compare, and as `compare`.
    """
    part = edit.Compact.of(body, body.measured)
    if not len(part.mesh.faces):
        raise InputError("nothing of this surface was measured")
    found = compare(part.mesh, reference, options, progress=progress)
    if not len(found.deviation.distance):
        raise InputError(
            "the reference says nothing about this surface",
            hint="check that both are in one frame: compare with alignment first",
        )
    distance = np.full(len(body.mesh.vertices), np.nan)
    distance[part.vertex_ids] = np.where(found.every.beyond, np.nan, found.every.distance)
    return ShownDeviation(distance, found)

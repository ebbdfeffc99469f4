"""How far an open scan lies from a reference, for showing it on the surface as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan import edit
from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.progress import Progress
from turnscan.shapes import deviation
from turnscan.workflows._inspection._compare import Comparison, compare
from turnscan.workflows._options._compare import CompareOptions
from turnscan.workflows._surface._result import ReconstructResult


@dataclass(frozen=True, eq=False)
class ShownDeviation:
    """Deviations of the vertices of an open scan."""

    distance: Floats
    """(v,) mm of each vertex of the body, positive outside; NaN where nothing was measured, and
    where the reference says nothing."""
    comparison: Comparison


def shown_deviation(
    body: edit.Body,
    result: Callable[[], ReconstructResult],
    reference: Path,
    options: CompareOptions,
    tolerance_table: Path | None,
    progress: Progress,
) -> ShownDeviation:
    """Compare what was measured of a body with a reference.

    Features and their sizes are those of the ``result``, which knows what its calibration leaves
    open. Raises InputError where there is nothing to compare, and as `compare`.
    """
    part = edit.Compact.of(body, body.measured)
    if not len(part.mesh.faces):
        raise InputError("nothing of this surface was measured")
    by_feature = options.features or tolerance_table is not None
    found = compare(
        result() if by_feature else part.mesh, reference, options,
        tolerance_table=tolerance_table, progress=progress,
    )  # fmt: skip
    every = found.every
    if by_feature:  # vertices of the result are others
        every = deviation(found.placement.pose.apply(part.mesh.vertices), found.drawn)
    if every.beyond.all():
        raise InputError(
            "the reference says nothing about this surface",
            hint="bring them together: align by shape",
        )
    distance = np.full(len(body.mesh.vertices), np.nan)
    distance[part.vertex_ids] = np.where(every.beyond, np.nan, every.distance)
    return ShownDeviation(distance, found)

"""Two settings of an open scan side by side, with how far their surfaces lie apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.progress import Progress
from turnscan.shapes import Deviation, deviation
from turnscan.workflows._inspection._compare import Areas, Comparison, areas_of, compare
from turnscan.workflows._session._mesh import Arrays
from turnscan.workflows._surface._result import ReconstructResult


@dataclass(frozen=True, eq=False)
class ShownSettings:
    """The surfaces of two settings, and how far each vertex lies from the other surface."""

    first: Mesh
    second: Mesh
    first_distance: Floats
    """(v,) mm, positive outside of the second; NaN where that has nothing."""
    second_distance: Floats
    """(v,) mm, positive outside of the first; NaN where that has nothing."""
    areas: Areas
    comparison: Comparison

    @property
    def arrays(self) -> Arrays:
        """``first.positions``, ``first.faces``, ``first.distance``, and the same of ``second``."""
        return {
            "first.positions": self.first.vertices, "first.faces": self.first.faces,
            "first.distance": self.first_distance, "second.positions": self.second.vertices,
            "second.faces": self.second.faces, "second.distance": self.second_distance,
        }  # fmt: skip


def shown_settings(
    first: ReconstructResult, second: ReconstructResult, gap: float, progress: Progress
) -> ShownSettings:
    """Compare two results of one scan; ``gap`` in mm as in `Areas`.

    Raises InputError where one of them has no surface.
    """
    found = compare(second, first, tolerances=(gap,), progress=progress)
    progress(0.7)
    a, b = found.drawn, found.mesh
    return ShownSettings(
        a, b, _known(deviation(a.vertices, b)), _known(found.every), areas_of(found, gap), found
    )


def _known(off: Deviation) -> Floats:
    return np.where(off.beyond, np.nan, off.distance)

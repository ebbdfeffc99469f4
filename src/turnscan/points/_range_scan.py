"""Range scans of other scanners: Cyberware-style PLY and generic PLY."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, Ints, frozen
from turnscan.errors import FormatError
from turnscan.formats import read_range_ply
from turnscan.points._grid import RangeGrid
from turnscan.rig import Pose

_FAR = 1e5
"""mm: where the eye of a scanner with parallel rays is put, along its viewing direction."""


@dataclass(frozen=True)
class RangeScan:
    """Points of one view of another scanner, in that scan's own frame, mm."""

    name: str
    points: Floats
    """(v, 3) mm."""
    grid: Ints | None
    """(rows, columns) index into ``points``, −1 where nothing was measured; None for loose points
    or a mesh."""
    faces: Ints | None = None
    """(f, 3) triangles where the file has them, else None."""

    def __post_init__(self) -> None:
        v = len(self.points)
        put = object.__setattr__
        put(self, "points", frozen(self.points, (v, 3), "RangeScan.points"))
        for name, shape in (("grid", (None, None)), ("faces", (None, 3))):
            index = getattr(self, name)
            if index is not None:
                index = frozen(index, shape, f"RangeScan.{name}", np.int32)
                if index.size and (index.min() < -1 or index.max() >= v):
                    raise ValueError(f"RangeScan.{name}: index outside 0 to {v - 1}")
                put(self, name, index)

    def range_grid(self, placement: Pose | None = None) -> RangeGrid:
        """The scan as a range grid, placed in the common frame: columns are steps, rows lines.

        The rays of these scanners are taken as parallel to the scan's z axis, from +z. Raises
        FormatError for a scan without a grid.
        """
        if self.grid is None:
            raise FormatError(f"{self.name}: the points of this file are not ordered in a grid")
        place = placement or Pose()
        index = self.grid.T
        there = index >= 0
        points = np.full((*index.shape, 3), np.nan)
        points[there] = place.apply(self.points)[index[there]]
        s, n = index.shape
        nothing = np.full((s, n), np.nan)
        return RangeGrid(
            laser=self.name,
            steps=np.arange(s, dtype=np.int32),
            angles=np.zeros(s),
            points=points,
            sigma=nothing,
            amplitude=nothing,
            flags=np.where(there, 0, 1).astype(np.uint16),
            closed=False,
            eyes=np.broadcast_to(place.apply([0.0, 0.0, _FAR]), (s, 3)),
        )


def range_scan_from_ply(data: bytes, name: str = "scan", *, scale: float = 1.0) -> RangeScan:
    """Read one range scan from the bytes of a PLY file, ascii or binary.

    Understood are Cyberware scans (``obj_info num_cols`` / ``num_rows`` and a ``range_grid``
    element) and plain vertices with or without faces. ``scale`` turns the file's unit into mm
    (1000 for metres). Raises FormatError for anything else, InputError for triangle strips,
    LimitExceeded for sizes beyond reason.
    """
    read = read_range_ply(data, name)
    faces = read.faces if len(read.faces) else None
    return RangeScan(name, read.points * scale, read.grid, faces)

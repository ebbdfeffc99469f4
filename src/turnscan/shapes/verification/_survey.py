"""Survey: the points that a scanner measured on an artefact, with all that is known of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Longs, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.points import RangeGrid, pixels_of, rig_moves
from turnscan.rig import Rig
from turnscan.shapes._measure import measured_points

Index = npt.NDArray[np.intp]
Moves = Callable[[Index], Floats]

_AT_ONCE = 20_000
"""Points whose moves are computed at once."""
_APART = 1 << 20
"""Lines from those of one laser to those of the next."""


@dataclass(frozen=True)
class Survey:
    """Points of one scan, in one frame."""

    points: Floats
    """(n, 3) mm."""
    eyes: Floats | None = None
    """(n, 3) mm: where the camera stood that saw each; None when not known."""
    moves: Moves | None = None
    """Indices (k,) → (m, k, 3) mm: how these points move, all at once, with one standard deviation
    of each of m independent directions of the rig's calibration, and of what is not known of its
    thick sheet of light (`RangeGrid.light_doubt`); None when not known."""
    lines: Longs | None = None
    """(n,) the line of the picture in which each was seen, those of another laser far behind; None
    when not known."""

    def __post_init__(self) -> None:
        n = len(self.points)
        object.__setattr__(self, "points", frozen(self.points, (n, 3), "Survey.points"))
        if self.eyes is not None:
            object.__setattr__(self, "eyes", frozen(self.eyes, (n, 3), "Survey.eyes"))
        if self.lines is not None:
            lines = frozen(self.lines, (n,), "Survey.lines", np.int64)
            object.__setattr__(self, "lines", lines)

    def pushed(self, index: Index, ways: Floats) -> Floats:
        """(m, k) mm: how far points (k,) move along ``ways`` (k, 3) or (3,) with one standard
        deviation of each direction of `moves`; (0, k) where that is not known."""
        if self.moves is None:
            return np.zeros((0, len(index)))
        parts = []
        for first in range(0, len(index), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            way = ways if ways.ndim == 1 else ways[some]
            parts.append(np.sum(self.moves(index[some]) * way, axis=-1))
        return np.concatenate(parts, axis=1) if parts else np.zeros((0, 0))


def survey_of_mesh(mesh: Mesh) -> Survey:
    """The measured vertices of a mesh, whose rig is unknown. Raises InputError for none."""
    if not len(mesh.faces):
        raise InputError("no faces", hint="give a mesh, or the scan file itself")
    return Survey(measured_points(mesh)[0])


def survey_of_grids(grids: Sequence[RangeGrid], rig: Rig) -> Survey:
    """All points of the grids of one scan, in the object's frame, with what the rig does to them.

    Raises InputError where there are none.
    """
    points, eyes, angles, laser, lines, doubts = [], [], [], [], [], []
    for k, g in enumerate(grids):
        step, line = np.nonzero(g.found)
        points.append(g.points[step, line])
        angles.append(g.angles[step])
        laser.append(np.full(len(step), k))
        lines.append(line + k * _APART)
        thick = g.light_doubt
        doubts.append(np.zeros((len(step), 3)) if thick is None else thick[step, line])
        seen = np.full((len(step), 3), np.nan) if g.eyes is None else g.eyes[step]
        eyes.append(seen)
    if not sum(map(len, points)):
        raise InputError("no points", hint="reconstruct the scan with a report, and look at it")
    X, turn, of, eye, doubt = (np.concatenate(a) for a in (points, angles, laser, eyes, doubts))

    def moves(index: Index) -> Floats:
        fields = list[Floats]()
        for k, g in enumerate(grids):
            mine = np.flatnonzero(of[index] == k)
            if not len(mine):
                continue
            at, by = X[index[mine]], turn[index[mine]]
            each = list(rig_moves(rig, g.laser, pixels_of(rig, at, by), by))
            each.append(doubt[index[mine]])
            fields = fields or [np.zeros((len(index), 3)) for _ in each]
            for whole, part in zip(fields, each, strict=True):
                whole[mine] = np.nan_to_num(part)
        return np.stack(fields) if fields else np.zeros((0, len(index), 3))

    known = bool(np.isfinite(eye).all())
    seen_in = np.concatenate(lines)
    return Survey(X, eye if known else None, None if rig.covariance is None else moves, seen_in)

"""Grids, profiles and pictures of an open scan as plain arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan import edit, points
from turnscan.arrays import Floats, Longs
from turnscan.detection import View
from turnscan.errors import InputError
from turnscan.points import RangeGrid
from turnscan.rig import Rig
from turnscan.stripes import Candidates, Stripe, StripeFlag
from turnscan.surface.holes import CAUSE_WORDS, Cause
from turnscan.workflows._session._mesh import Arrays

CAUSE_TEXTS = ("", *CAUSE_WORDS.values())
"""Words by the numbers in the array ``cause``; 0: nothing is missing."""
_NUMBER = {name: k for k, name in enumerate(CAUSE_WORDS, start=1)}
_FLAG_CAUSES: tuple[tuple[StripeFlag, Cause], ...] = (
    (StripeFlag.AMBIGUOUS, "ambiguous"),
    (StripeFlag.OUTSIDE, "outside"),
    (StripeFlag.SATURATED, "saturated"),
    (StripeFlag.DARK, "dark"),
)
"""Which flag of a missing point tells its cause, the most telling last."""
BY_GRID = 4
"""Of a vertex whose point in the scan grid was moved, added or picked by hand."""
_SAME = 0.5
"""px within which a point is one of the candidates."""


@dataclass(frozen=True, eq=False)
class ShownProfile:
    """One step of a grid: the stripe as it is used now, and everything it could be instead."""

    laser: str
    angle_deg: float
    arrays: Arrays
    """``position`` (n,) px, ``candidates`` and ``candidate_amplitude`` (n, k),
    ``candidate_points`` (n, k, 3) mm, ``chosen`` (n,): which candidate it is, -1 none is there,
    -2 a place of its own."""

    @property
    def edited(self) -> bool:
        """Whether a point stands where no candidate is."""
        return bool((self.arrays["chosen"] == -2).any())


def grid_arrays(grid: RangeGrid, document: edit.Document, step: int | None) -> Arrays:
    """A whole grid, or one step of it, with the causes of its gaps and what was edited.

    Places whose point was removed from the surface count as deleted. Raises InputError for a
    step there is not.
    """
    rows: npt.NDArray[np.intp] = np.arange(len(grid.steps))
    if step is not None:
        rows = np.flatnonzero(grid.steps == step)
        if not len(rows):
            raise InputError(f"there is no step {step} in this grid")
    edited, off = _edited(grid, document.history.enabled)
    at, line = _taken_away(grid, document)
    edited[at, line] = 2
    return {
        "steps": grid.steps[rows],
        "angles": grid.angles[rows],
        "points": grid.points[rows],
        "sigma": grid.sigma[rows],
        "amplitude": grid.amplitude[rows],
        "flags": grid.flags[rows],
        "cause": _causes(grid)[rows],
        "edited": edited[rows],
        "off": off[rows],
    }


def touched(document: edit.Document, grids: Sequence[RangeGrid]) -> npt.NDArray[np.uint8]:
    """(v,) what was last done by hand at each vertex: a number of `edit.Touch`, or `BY_GRID`."""
    out = document.touched()
    known = document.body.mesh.provenance
    for grid in grids:
        if known is None or grid.laser not in known.lasers:
            continue
        edited, _ = _edited(grid, document.history.enabled)
        there = (known.laser == known.lasers.index(grid.laser)) & (known.line >= 0)
        there &= (known.line < edited.shape[1]) & np.isin(known.step, grid.steps) & (out == 0)
        order = np.argsort(grid.steps)
        row = order[np.searchsorted(grid.steps, known.step[there], sorter=order)]
        out[there] = np.where(edited[row, known.line[there]] == 1, BY_GRID, 0)
    return out


def shown_profile(view: View, grid: RangeGrid, step: int) -> ShownProfile:
    """The stripe of one step. Raises InputError for a step there is not, ScanCorrupt."""
    rig = view.rig
    k = int(np.flatnonzero(grid.steps == step)[0]) if step in grid.steps else -1
    if k < 0:
        raise InputError(f"there is no step {step} in this grid")
    angle = float(grid.angles[k])
    position = _seen_at(rig, grid.points[k], angle, view.scan.plan.orientation)
    found = view.candidates(step)
    places = np.stack(
        [
            points.build_grid(rig, grid.laser, [one], [step], [angle]).points[0]
            for one in _each(found)
        ],
        axis=1,
    )
    arrays: dict[str, npt.NDArray[Any]] = {
        "position": position,
        "candidates": found.position,
        "candidate_amplitude": found.amplitude,
        "candidate_points": places,
        "chosen": _chosen(position, found.position),
    }
    return ShownProfile(grid.laser, math.degrees(angle), arrays)


def _taken_away(grid: RangeGrid, document: edit.Document) -> tuple[Longs, Longs]:
    """Rows and lines of a grid whose points were removed from the surface."""
    rows, lines = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    order = np.argsort(grid.steps)
    for mesh, gone in document.taken_away():
        known = mesh.provenance
        if known is None or grid.laser not in known.lasers or not gone.any():
            continue
        here = gone & (known.laser == known.lasers.index(grid.laser)) & (known.line >= 0)
        here &= (known.line < grid.flags.shape[1]) & np.isin(known.step, grid.steps)
        rows.append(order[np.searchsorted(grid.steps, known.step[here], sorter=order)])
        lines.append(known.line[here].astype(np.int64))
    return np.concatenate(rows), np.concatenate(lines)


def steps_taken_away(
    grid: RangeGrid, before: edit.Document, after: edit.Document
) -> npt.NDArray[np.integer]:
    """The steps of a grid of whose points others are away from the surface now."""
    a, b = (
        np.unique(np.stack(_taken_away(grid, document), axis=-1), axis=0)
        for document in (before, after)
    )
    both, many = np.unique(np.concatenate([a, b]), axis=0, return_counts=True)
    return np.unique(grid.steps[both[many == 1, 0]])


def changed_steps(before: RangeGrid | None, after: RangeGrid | None) -> list[int]:
    """The steps of a grid that are others now; all of them where its steps are others."""
    if before is after or after is None:
        return []
    if before is None or not np.array_equal(before.steps, after.steps):
        return list(map(int, after.steps))
    a, b = before, after
    same = ((a.points == b.points) | (np.isnan(a.points) & np.isnan(b.points))).all(axis=(1, 2))
    same &= (a.flags == b.flags).all(axis=1)
    return list(map(int, b.steps[~same]))


def _causes(grid: RangeGrid) -> npt.NDArray[np.uint8]:
    cause: npt.NDArray[np.uint8] = np.full(grid.flags.shape, _NUMBER["removed"], np.uint8)
    for flag, name in _FLAG_CAUSES:
        cause[(grid.flags & int(flag)) != 0] = _NUMBER[name]
    cause[grid.flags == StripeFlag.HAND] = _NUMBER["deleted"]
    cause[grid.found] = 0
    return cause


def _edited(
    grid: RangeGrid, entries: Sequence[edit.Entry]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """What people did to the grid: (s, n) 1 moved or picked, 2 deleted; (s,) 1 switched off."""
    edited: npt.NDArray[np.uint8] = np.zeros(grid.flags.shape, np.uint8)
    off: npt.NDArray[np.uint8] = np.zeros(len(grid.steps), np.uint8)
    for entry in entries:
        what = entry.edit
        if getattr(what, "laser", None) != grid.laser:
            continue
        match what:
            case edit.DeletePoints():
                lines = [n for n in what.lines if n < edited.shape[1]]
                edited[np.ix_(grid.steps == what.step, lines)] = 2
            case edit.SetPoint():
                if what.line < edited.shape[1]:
                    edited[grid.steps == what.step, what.line] = 1
            case edit.PickCandidate():
                edited[grid.steps == what.step, what.lines[0] : what.lines[1] + 1] = 1
            case edit.ProfileOff():
                off[(grid.steps >= what.steps[0]) & (grid.steps <= what.steps[1])] = 1
    return edited, off


def _seen_at(rig: Rig, profile: Floats, angle: float, orientation: str) -> Floats:
    """(n,) px across the stripe at which the camera sees each point (n, 3) of a profile."""
    there = ~np.isnan(profile[:, 0])
    out = np.full(len(profile), np.nan)
    turn, shift = rig.turning(angle)
    table = profile[there] @ turn.T + shift
    pixels = rig.camera.project(rig.T_camera_table.apply(table))
    out[there] = pixels[:, 0 if orientation == "vertical" else 1]
    return out


def _chosen(position: Floats, candidates: Floats) -> npt.NDArray[np.int8]:
    """(n,) which candidate a point is; −1 none there, −2 a place of its own."""
    apart = np.abs(candidates - position[:, None])
    apart = np.where(np.isnan(apart), np.inf, apart)
    best = apart.argmin(axis=1)
    out = np.where(apart[np.arange(len(best)), best] <= _SAME, best, -2)
    return np.where(np.isnan(position), -1, out).astype(np.int8)


def _each(found: Candidates) -> list[Stripe]:
    """The k-th candidates of all lines, as a stripe each."""
    return [
        Stripe(
            found.position[:, k],
            found.sigma[:, k],
            found.amplitude[:, k],
            found.width[:, k],
            found.flags[:, k],
            found.orientation,
        )
        for k in range(found.position.shape[1])
    ]

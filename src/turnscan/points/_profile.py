"""Profiles: a stripe in millimetres, as polylines, and with a spacing of the user's choice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError, LimitExceeded
from turnscan.points._grid import RangeGrid
from turnscan.stripes import StripeFlag

Spacing = Literal["height", "arc"]
"""height: points at common heights z in all profiles; arc: at equal arc length along each."""

_JUMP = 4.0
"""A run ends where neighbours lie further apart than this many usual spacings of the profile."""
_MOST = 1_000_000
"""Points that one resampled profile may have."""


@dataclass(frozen=True)
class Profile:
    """One unbroken run of points of one profile: a polyline in the object's frame."""

    laser: str
    step: int
    angle: float
    """Table angle, radians."""
    lines: Ints
    """(m,) image rows (columns for a horizontal stripe), ascending."""
    points: Floats
    """(m, 3) mm."""

    def __post_init__(self) -> None:
        m = len(self.lines)
        object.__setattr__(self, "lines", frozen(self.lines, (m,), "Profile.lines", np.int32))
        object.__setattr__(self, "points", frozen(self.points, (m, 3), "Profile.points"))


def profiles(grid: RangeGrid, *, shortest: int = 2) -> list[list[Profile]]:
    """For each step, its unbroken runs of at least ``shortest`` points.

    A run ends at a missing line and where the next point is further away than four times the
    median spacing of that profile.
    """
    breaks = _breaks(grid.points)
    out = []
    for k, step in enumerate(grid.steps):
        lines = np.flatnonzero(grid.found[k]).astype(np.int32)
        cuts = np.flatnonzero(breaks[k][lines[1:]]) + 1
        out.append(
            [
                Profile(grid.laser, int(step), float(grid.angles[k]), run, grid.points[k, run])
                for run in np.split(lines, cuts)
                if len(run) >= shortest
            ]
        )
    return out


def _breaks(points: Floats) -> Bools:
    """(s, n) True where no run leads from the line before to this one."""
    s, n, _ = points.shape
    gap = np.full((s, n), np.nan)
    gap[:, 1:] = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    have = ~np.isnan(gap)
    ordered = np.sort(gap, axis=1)  # NaN last
    middle = np.maximum(have.sum(axis=1) - 1, 0) // 2
    usual = ordered[np.arange(s), middle]
    with np.errstate(invalid="ignore"):
        return np.asarray(~(gap <= _JUMP * usual[:, None]))


def resample(grid: RangeGrid, spacing: float, by: Spacing = "height") -> RangeGrid:
    """The grid with points ``spacing`` mm apart along every profile.

    ``by="height"`` puts them at common heights z = k·spacing, so that line k is the same height
    in all profiles; where a profile passes a height twice (an overhang) the first passage in line
    order counts. ``by="arc"`` puts them at equal arc length along each unbroken run, the first one
    at the run's first point; lines then count on from run to run. New points lie on the segment
    between two neighbours of one run, never across a gap; their sigma comes from those two.

    Raises InputError for a spacing that is not positive, LimitExceeded where it would give more
    than a million points a profile.
    """
    if not (spacing > 0 and np.isfinite(spacing)):
        raise InputError(f"spacing {spacing} mm", hint="give a positive length in mm")
    found = grid.found
    if not found.any():
        return grid
    runs = ~_breaks(grid.points)
    if by == "height":
        z = grid.points[..., 2][found]
        low = int(np.ceil(float(z.min()) / spacing))
        count = int(np.floor(float(z.max()) / spacing)) - low + 1
    else:
        low = 0
        gap = np.linalg.norm(np.diff(grid.points, axis=1), axis=-1)
        inside = np.where(runs[:, 1:], gap, 0.0).sum(axis=1)
        begins = (found & ~runs).sum(axis=1)
        count = int((np.floor(inside / spacing) + begins).max())
    if count > _MOST:
        raise LimitExceeded(
            f"spacing {spacing} mm gives {count} points a profile, at most {_MOST}",
            hint="choose a wider spacing",
        )
    from turnscan.points import _profile_kernels as kernels

    if by == "height":
        at, part = kernels.place_heights(grid.points, runs, found, spacing, low, max(count, 1))
    else:
        at, part = kernels.place_arcs(grid.points, runs, found, spacing, max(count, 1))
    return _between(grid, at, part)


def _between(grid: RangeGrid, at: Ints, part: Floats) -> RangeGrid:
    """The points at fraction ``part`` (s, m) of the way from line ``at`` − 1 to line ``at``."""
    there = at >= 0
    k = np.arange(len(at))[:, None]
    b = np.where(there, at, 0)
    a = np.where(there & (part < 1.0), b - 1, b)
    w = np.where(there, part, np.nan)
    behind = None if grid.behind is None else grid.behind[k, b] & there
    flags = np.where(there, grid.flags[k, a] | grid.flags[k, b], np.uint16(StripeFlag.DARK))
    start, end = grid.points[k, a], grid.points[k, b]
    return replace(
        grid,
        points=start + w[..., None] * (end - start),
        sigma=np.hypot((1.0 - w) * grid.sigma[k, a], w * grid.sigma[k, b]),
        amplitude=(1.0 - w) * grid.amplitude[k, a] + w * grid.amplitude[k, b],
        flags=flags.astype(np.uint16),
        behind=behind,
    )

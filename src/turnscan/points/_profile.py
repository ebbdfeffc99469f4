"""Profiles: a stripe in millimetres, as polylines, and with a spacing of the user's choice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError, LimitExceeded
from turnscan.points._grid import Origin, RangeGrid
from turnscan.points._places import most_places, places, walks
from turnscan.remedy import Option, Remedy
from turnscan.stripes import StripeFlag

Spacing = Literal["height", "arc"]
"""height: points at common heights z in all profiles; arc: at equal arc length along each."""


@dataclass(frozen=True)
class Along:
    """How far apart points are wanted along the profiles."""

    spacing: float
    """mm."""
    by: Spacing = "height"

    def __post_init__(self) -> None:
        if not (self.spacing > 0 and np.isfinite(self.spacing)):
            raise InputError(f"spacing {self.spacing} mm", hint="give a positive length in mm")


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


def resample(
    grid: RangeGrid,
    along: Along,
    *,
    joined: Bools | None = None,
    stays: Bools | None = None,
) -> RangeGrid:
    """The grid with points so far apart along every profile, both ends of every run kept.

    By height they lie at common heights z = k·spacing, each time the profile passes one, and at
    equal arc length where it would go on for two spacings without; by arc at equal arc length
    along each unbroken run, from its first point on. A point nearer than a quarter of the spacing
    to one that stays is left out. New points lie on the segment between two neighbours of one run,
    never across a gap; their sigma comes from those two.

    ``joined`` (s, n) is True where a run leads from the line before to this one; without it runs
    end as in `profiles`. ``stays`` (s, n) names points that stay where they are. The places of the
    new grid are in order along the profile, with one empty between runs; by height a place is one
    height in all profiles as far as they pass it once. The new grid knows where it comes from
    (`RangeGrid.origin`).

    Raises LimitExceeded where it would give more than a million points a profile.
    """
    if not grid.found.any():
        return grid
    walk = walks(grid.points, ~_breaks(grid.points) if joined is None else joined, stays)
    if (most := most_places(walk, along.spacing)) > _MOST:
        raise LimitExceeded(
            f"spacing {along.spacing} mm gives {most:.0f} points a profile, at most {_MOST}",
            hint=Remedy("choose a wider ", Option("spacing")),
        )
    end, part, place = places(walk, along.spacing, along.by == "height")
    at = np.full((len(grid.steps), int(place.max()) + 1), -1, dtype=np.int32)
    share = np.full(at.shape, np.nan)
    at[walk.profile[end], place] = walk.line[end]
    share[walk.profile[end], place] = part
    return _between(grid, at, share)


def _between(grid: RangeGrid, at: Ints, part: Floats) -> RangeGrid:
    """The points at fraction ``part`` (s, m) of the way from line ``at`` − 1 to line ``at``."""
    there = at >= 0
    k = np.arange(len(at))[:, None]
    b = np.where(there, at, 0)
    a = np.where(there & (part < 1.0), b - 1, b)
    w = np.where(there, part, np.nan)
    behind = None if grid.behind is None else grid.behind[k, b] & there
    flags = np.where(there, grid.flags[k, a] | grid.flags[k, b], np.uint16(StripeFlag.DARK))
    start, end, doubt = grid.points[k, a], grid.points[k, b], grid.light_doubt
    if doubt is not None:
        mean = doubt[k, a] + w[..., None] * (doubt[k, b] - doubt[k, a])
        doubt = np.nan_to_num(mean).astype(np.float32)
    noise, share = grid.noise, grid.width_share
    if noise is not None:
        noise = np.hypot((1.0 - w) * noise[k, a], w * noise[k, b]).astype(np.float32)
    return replace(
        grid,
        points=start + w[..., None] * (end - start),
        light_doubt=doubt,
        sigma=np.hypot((1.0 - w) * grid.sigma[k, a], w * grid.sigma[k, b]),
        amplitude=(1.0 - w) * grid.amplitude[k, a] + w * grid.amplitude[k, b],
        flags=flags.astype(np.uint16),
        behind=behind,
        halo=None if grid.halo is None else np.fmax(grid.halo[k, a], grid.halo[k, b]),
        noise=noise,
        width_share=None if share is None else np.maximum(share[k, a], share[k, b]),
        origin=Origin(grid, np.where(there, at - 1 + w, np.nan)),
    )

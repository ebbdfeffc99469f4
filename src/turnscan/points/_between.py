"""A spacing of the user's choice between the profiles of a grid, in degrees or in mm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Singles
from turnscan.errors import InputError, LimitExceeded
from turnscan.points._build import goes_round
from turnscan.points._grid import RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.rig import rotation_z
from turnscan.stripes import StripeFlag

_JUMP = 4.0
"""Two points of one line are neighbours up to this many usual distances of their two profiles."""
_MOST = 100_000
"""Profiles that a grid may get."""
_SAME = 1e-6
"""Part of a step within which a profile counts as one that was measured."""


@dataclass(frozen=True)
class Between:
    """How far apart profiles are wanted."""

    size: float
    unit: Literal["rad", "mm"]
    """mm: along the circle of the outermost point, so nowhere further apart than that."""

    def __post_init__(self) -> None:
        if not (self.size > 0 and np.isfinite(self.size)):
            raise InputError(f"{self.size} {self.unit} between profiles", hint="give more than 0")

    def angle(self, grid: RangeGrid) -> float:
        """Radians, for the part in this grid."""
        if self.unit == "rad":
            return self.size
        reach = float(np.nanmax(np.hypot(grid.points[..., 0], grid.points[..., 1])))
        return self.size / max(reach, 1e-9)


def respace(grid: RangeGrid, between: Between) -> RangeGrid:
    """The grid with profiles at even table angles, from its first one on.

    A new point lies on the segment between the points of one line in the profiles before and
    after, never across a gap or a jump, so finer profiles add no detail; its sigma comes from
    those two. Where an angle was measured its profile stays as it is, and an open turn ends with
    its last profile. Steps are numbered anew from 0; what is missing because one of the two is,
    has that one's cause.

    Raises InputError for a grid whose angles do not run one way, LimitExceeded for more than
    100 000 profiles.
    """
    if len(grid.steps) < 2 or not grid.found.any():
        return grid
    angles = np.unwrap(grid.angles)
    moves = np.diff(angles)
    if not ((moves > 0).all() or (moves < 0).all()):
        raise InputError(
            f"laser {grid.laser}: the table angles are not monotonic, or constant",
            hint="leave the spacing between profiles out",
        )
    way = float(np.sign(moves[0]))
    whole = 2 * np.pi if grid.closed else abs(float(angles[-1] - angles[0]))
    pitch = between.angle(grid)
    count = int(whole / pitch * (1 - 1e-12)) + 1
    if count > _MOST:
        raise LimitExceeded(
            f"{count} profiles, at most {_MOST}",
            hint=Remedy("choose a wider ", Option("spacing_between")),
        )
    # The first profile again, a turn later, ends the last gap.
    ends = np.append(angles, angles[0] + way * 2 * np.pi) if grid.closed else angles
    wanted = angles[0] + way * pitch * np.arange(count)
    if not grid.closed and abs(wanted[-1] - angles[-1]) > _SAME * pitch:
        wanted = np.append(wanted, angles[-1])
    first = np.clip(np.searchsorted(way * ends, way * wanted, side="right") - 1, 0, len(ends) - 2)
    part = (wanted - ends[first]) / (ends[first + 1] - ends[first])
    part = np.where(part < _SAME, 0.0, np.where(part > 1 - _SAME, 1.0, part))
    return _between(grid, first, (first + 1) % len(angles), part, wanted, ends[first])


def _between(
    grid: RangeGrid, a: Floats, b: Floats, part: Floats, wanted: Floats, before: Floats
) -> RangeGrid:
    w = part[:, None]
    found = grid.found
    there = np.where(w == 0, found[a], np.where(w == 1, found[b], _linked(grid, a, b)))

    def mean(values: Floats) -> Floats:
        u = w.reshape(w.shape + (1,) * (values.ndim - 2))
        # A neighbour that does not count may be missing: 0 times NaN is NaN.
        low = np.where(u == 1, 0.0, (1 - u) * values[a])
        return np.where(
            there.reshape(there.shape + (1,) * (values.ndim - 2)),
            low + np.where(u == 0, 0.0, u * values[b]),
            np.nan,
        )

    lost = np.where(found[a], grid.flags[b], grid.flags[a])
    lost = np.where(found[a] & found[b], np.uint16(StripeFlag.AMBIGUOUS), lost)
    near = np.where(w <= 0.5, grid.flags[a], grid.flags[b])

    def spread(sigma: Floats | Singles) -> Floats:
        first, second = np.where(w == 1, 0.0, sigma[a]), np.where(w == 0, 0.0, sigma[b])
        return np.where(there, np.hypot((1 - w) * first, w * second), np.nan)

    eyes = grid.eyes
    if eyes is not None:
        # The camera stands still: in the object's frame it turns back as the table turns.
        eyes = np.einsum("sij,sj->si", rotation_z(before - wanted), eyes[a])
    doubt = grid.light_doubt
    if doubt is not None:
        doubt = np.nan_to_num(mean(doubt.astype(np.float64))).astype(np.float32)
    return replace(
        grid,
        steps=np.arange(len(wanted), dtype=np.int32),
        angles=wanted,
        points=mean(grid.points),
        sigma=spread(grid.sigma),
        amplitude=mean(grid.amplitude),
        flags=np.where(there, near, lost).astype(np.uint16),
        closed=goes_round(wanted),
        eyes=eyes,
        behind=None
        if grid.behind is None
        else there & np.where(w == 1, grid.behind[b], grid.behind[a]),
        light_doubt=doubt,
        halo=None if grid.halo is None else np.fmax(grid.halo[a], grid.halo[b]),
        noise=None if grid.noise is None else spread(grid.noise).astype(np.float32),
    )


def _linked(grid: RangeGrid, a: Floats, b: Floats) -> Bools:
    """(m, n) True where the points of profiles ``a`` and ``b`` (m,) can be one surface."""
    gap = np.linalg.norm(grid.points[b] - grid.points[a], axis=2)
    have = np.isfinite(gap)
    usual = np.full((len(gap), 1), np.inf)
    some = have.any(axis=1)
    usual[some, 0] = np.nanmedian(gap[some], axis=1)
    linked = have & (np.nan_to_num(gap) <= _JUMP * usual)
    if grid.behind is not None:
        linked &= grid.behind[a] == grid.behind[b]
    return np.asarray(linked)

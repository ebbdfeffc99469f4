"""Profiles at a spacing of the user's choice, on the surface of those that were measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats, Longs, Singles
from turnscan.errors import InputError, LimitExceeded
from turnscan.points import Between, RangeGrid, goes_round, usual_sigma
from turnscan.remedy import Option, Remedy
from turnscan.rig import rotation_z
from turnscan.stripes import StripeFlag
from turnscan.surface._grid_mesh import TearLimits
from turnscan.surface.fusion._range_surface import RangeSurface, range_surfaces

_MOST = 100_000
"""Profiles that a grid may get."""
_SAME = 1e-6
"""Part of a step within which a profile counts as one that was measured."""


@dataclass(frozen=True)
class _Chords:
    """What is known of the surface between each point of a grid and that of the same line in the
    next profile, all (s, n): the last one's next is the first."""

    whole: Bools
    """Whether the surface goes on there."""
    rise: Floats
    """(s, n, 3) mm: four times that by which it bulges over the middle of the chord."""
    doubt: Floats
    """mm: how far it may lie off there."""


def respace(grid: RangeGrid, between: Between, tears: TearLimits | None = None) -> RangeGrid:
    """The grid with profiles at even table angles, from its first one on.

    A new point lies between the points of one line in the profiles before and after, where a face
    of the surface joins these: never across a gap or a jump. It stands off their chord as the
    surface bends evenly there, and its sigma holds what that may be wrong by, an edge between the
    two as well; finer profiles add no detail. Where an angle was measured its profile stays as it
    is, and an open turn ends with its last profile. Steps are numbered anew from 0; what is missing
    because one of the two is, has that one's cause.

    Raises InputError for a grid whose angles do not run one way, or that does not know where its
    camera stood, LimitExceeded for more than 100 000 profiles.
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
    chords = _chords(grid, tears)
    return _between(grid, chords, first, (first + 1) % len(angles), part, wanted, ends[first])


def _chords(grid: RangeGrid, tears: TearLimits | None) -> _Chords:
    """How the surface of a grid goes on from profile to profile."""
    shape = grid.found.shape
    out = _Chords(np.zeros(shape, np.bool_), np.zeros((*shape, 3)), np.zeros(shape))
    for surface in range_surfaces(grid, tears):
        _add(out, surface, grid)
    return out


def _add(chords: _Chords, surface: RangeSurface, grid: RangeGrid) -> None:
    """Note what one surface of the grid says of its chords."""
    from turnscan.surface.fusion import _variance_kernels as kernels

    p, X = surface.mesh.provenance, surface.mesh.vertices
    if p is None or not len(X):
        return
    order = np.argsort(grid.steps, kind="stable")
    row = order[np.searchsorted(grid.steps[order], p.step)]
    one = np.flatnonzero(surface.neighbours[1] >= 0)
    other = surface.neighbours[1][one]
    normals = surface.normals[one] + surface.normals[other]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    rise = kernels.rises(X, surface.bend, surface.ranks, surface.neighbours[1])[one]
    back, on = surface.beside_profiles(np.inf, slight=True, ends=True)
    # Of a surface that spans the seam alone the last profile counts as the one after the first.
    first = np.where((row[other] - row[one]) % len(grid.steps) == 1, row[one], row[other])
    at = first, p.line[one]
    chords.whole[at] = True
    chords.rise[at] = rise[:, None] * normals
    chords.doubt[at] = np.maximum(on[one], back[other])


def _between(
    grid: RangeGrid, chords: _Chords, a: Longs, b: Longs, part: Floats, wanted: Floats,
    before: Floats,
) -> RangeGrid:  # fmt: skip
    """The grid at the ``wanted`` (m,) angles, each a ``part`` (m,) of the way from profile ``a`` to
    ``b`` (m,), the first of which was measured at the angles ``before`` (m,)."""
    w = part[:, None]
    found = grid.found
    there = np.where(w == 0, found[a], np.where(w == 1, found[b], chords.whole[a]))

    def mean(values: Floats) -> Floats:
        u = w.reshape(w.shape + (1,) * (values.ndim - 2))
        # A neighbour that does not count may be missing: 0 times NaN is NaN.
        low = np.where(u == 1, 0.0, (1 - u) * values[a])
        return np.where(
            there.reshape(there.shape + (1,) * (values.ndim - 2)),
            low + np.where(u == 0, 0.0, u * values[b]),
            np.nan,
        )

    def spread(sigma: Floats | Singles) -> Floats:
        first, second = np.where(w == 1, 0.0, sigma[a]), np.where(w == 0, 0.0, sigma[b])
        return np.where(there, np.hypot((1 - w) * first, w * second), np.nan)

    lost = np.where(found[a], grid.flags[b], grid.flags[a])
    lost = np.where(found[a] & found[b], np.uint16(StripeFlag.AMBIGUOUS), lost)
    near = np.where(w <= 0.5, grid.flags[a], grid.flags[b])
    # Edges and grazing light move neighbours alike: only noise is less in the mean of two.
    random = grid.noise
    if random is None:
        random = np.minimum(grid.sigma, usual_sigma(grid.sigma[found], most=True))
    noise = spread(random)
    common = mean(np.sqrt(np.maximum(grid.sigma**2 - random**2, 0.0)))
    aside = w * (1 - w)
    sigma = np.sqrt(noise**2 + common**2 + (4 * aside * chords.doubt[a]) ** 2)
    eyes = grid.eyes
    if eyes is not None:
        # The camera stands still: in the object's frame it turns back as the table turns.
        eyes = np.einsum("sij,sj->si", rotation_z(before - wanted), eyes[a])
    doubt, share = grid.light_doubt, grid.width_share
    if doubt is not None:
        doubt = np.nan_to_num(mean(doubt.astype(np.float64))).astype(np.float32)
    return replace(
        grid,
        steps=np.arange(len(wanted), dtype=np.int32),
        angles=wanted,
        points=mean(grid.points) + aside[..., None] * chords.rise[a],
        sigma=sigma,
        amplitude=mean(grid.amplitude),
        flags=np.where(there, near, lost).astype(np.uint16),
        closed=goes_round(wanted),
        eyes=eyes,
        behind=None
        if grid.behind is None
        else there & np.where(w == 1, grid.behind[b], grid.behind[a]),
        light_doubt=doubt,
        halo=None if grid.halo is None else np.fmax(grid.halo[a], grid.halo[b]),
        noise=None if grid.noise is None else noise.astype(np.float32),
        width_share=None if share is None else np.maximum(share[a], share[b]),
    )

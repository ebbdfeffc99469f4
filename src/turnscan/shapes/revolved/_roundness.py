"""Roundness of turned parts by height, cylindricity of their walls, and threads on them.

Means of cells of neighbouring points stand for the surface, for the range of single points is that
of their noise. The least-squares and the minimum-zone circle are those of ISO 12181, in the
limaçon's approximation r(φ) ≈ R + x cos φ + y sin φ; the latter is a linear programme.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.shapes._outline_curves import Line, Outline
from turnscan.shapes.revolved._axis import Turned
from turnscan.shapes.verification._statistics import noise_range

_UPRIGHT = 0.7
"""Radial part of the normal that a wall has, for its radius to be seen."""
_HALF = 2.0
"""Steps of the mesh to both sides of a height."""
_CELL, _MOST = 12, 90
"""Points of a cell at the least, and how many there are all round at the most."""
_LONE = 1e-6
"""Freedom of a cell whose points are all of one row, but for rounding: it tells no noise."""
_SPANNED = 0.5
"""Of the band about a height: how far the wall must reach to both sides, else it ends there."""
_COVERED = 0.75
"""Share of the turn that must be seen."""
_STRAIGHT = float(np.radians(0.3))
"""Between a line of the profile and the axis, where it is a cylinder's."""
_PITCHES = 400
_THREAD = 6.0
"""Standard deviations that the wave of a thread must have."""
_RAYLEIGH = float(np.sqrt(2 * np.log(2)))
"""Median length of a plane vector whose coordinates are Gaussian with a standard deviation of 1."""


@dataclass(frozen=True)
class Roundness:
    """How round a wall is at one height. All in mm."""

    height: float
    """Along the axis from its point."""
    hollow: bool
    radius: float
    radius_sigma: float
    """Counts how far it is from that without a mean profile: a wall hardly higher than two steps of
    the mesh has none that its edges do not bend."""
    least_squares: float
    """Width of the zone about the least-squares circle that holds the means of cells."""
    minimum_zone: float
    """Width of the narrowest such zone."""
    run_out: float
    """The same width about the axis of the part."""
    eccentricity: float
    eccentricity_sigma: float
    noise: float
    """Width that the noise of the points makes of a perfect circle, on average; NaN where the
    points do not tell their noise, and where the wall ends beside the height: edges bend it."""
    sigma: float
    """Standard uncertainty that this noise leaves in the widths; NaN as well."""
    cells: int
    covered: float
    """Share of the turn."""


@dataclass(frozen=True)
class Cylindricity:
    """How cylindrical a straight piece of the wall is. All in mm."""

    low: float
    high: float
    hollow: bool
    radius: float
    radius_sigma: float
    value: float
    """Width of the zone about the least-squares cylinder that holds the means of cells."""
    run_out: float
    """The same about the axis of the part: total run-out."""
    noise: float
    sigma: float
    cells: int


@dataclass(frozen=True)
class Thread:
    """A wave that winds about the axis."""

    low: float
    high: float
    pitch: float
    """mm along the axis for each turn; positive where it winds as a right-hand thread does."""
    amplitude: float
    """mm."""
    sigma: float
    """mm, of the amplitude."""


def roundness(turned: Turned, heights: Sequence[float]) -> list[Roundness]:
    """Roundness at heights (mm from the axis' point) of each wall that is seen nearly all round."""
    out = []
    for height in heights:
        level = np.abs(turned.z - height) <= _HALF * turned.spacing
        for hollow in (False, True):
            some = level & _wall(turned, hollow)
            for part in _radii(turned, some):
                found = _round_at(turned, part, height, hollow)
                if found is not None:
                    out.append(found)
    return out


def _wall(turned: Turned, hollow: bool) -> Bools:
    way = -1.0 if hollow else 1.0
    return np.asarray(way * turned.normal[:, 0] >= _UPRIGHT)


def _radii(turned: Turned, some: Bools) -> list[np.ndarray]:
    """Points of several walls at one height apart: where radii leave a gap."""
    index = np.flatnonzero(some)
    if not len(index):
        return []
    order = index[np.argsort(turned.r[index])]
    gaps = np.flatnonzero(np.diff(turned.r[order]) > 3 * turned.spacing) + 1
    return np.split(order, gaps)


def _round_at(turned: Turned, some: np.ndarray, height: float, hollow: bool) -> Roundness | None:
    away = np.abs(turned.r[some] - np.median(turned.r[some]))
    near = max(turned.spacing / 2 + 4 * turned.sigma, 6 * 1.4826 * float(np.median(away)))
    some = some[away <= near]  # without the edges of keyways and holes
    reach = _SPANNED * _HALF * turned.spacing
    along = turned.z[some] - height
    beside = along.min() > -reach or along.max() < reach  # an edge, which bends stripes
    off = turned.off[some] / turned.normal[some, 0]  # along r, the slope of the wall taken off
    stripes = len(np.unique(np.round(turned.angle[some], 2)))
    count = min(_MOST, len(some) // _CELL, stripes // 2)  # none empty between coarse steps
    if count < 12:
        return None
    at = (turned.angle[some] / (2 * np.pi) % 1.0) * count
    mean, angle, noise = _cells(at.astype(np.int64) % count, off, count, _row(turned, some))
    angle = (angle + 0.5) * (2 * np.pi / count)
    covered = len(mean) / count
    if covered < _COVERED:
        return None
    A = np.column_stack([np.ones(len(mean)), np.cos(angle), np.sin(angle)])
    fit = np.linalg.lstsq(A, mean, rcond=None)[0]
    rest = mean - A @ fit
    inverse = np.linalg.inv(A.T @ A) * float(np.fmax(noise, rest.std(ddof=3))) ** 2
    wide, spread = noise_range(np.full(len(mean), noise))
    if beside:
        wide = spread = float("nan")
    wall = np.column_stack([np.ones(len(some)), turned.z[some] - height])
    level = float(np.linalg.lstsq(wall, turned.r[some] - off, rcond=None)[0][0])
    around = turned.angle[some]
    plain = np.column_stack([wall, np.cos(around), np.sin(around)])
    other = float(np.linalg.lstsq(plain, turned.r[some], rcond=None)[0][0])
    radius = level + float(fit[0])
    known = inverse[0, 0] + (radius - other) ** 2 + _common(turned, some)
    radius_sigma = float(np.sqrt(known))
    return Roundness(
        height, hollow, radius, radius_sigma,
        float(np.ptp(rest)), _minimum_zone(A, mean), float(np.ptp(mean)),
        float(np.hypot(fit[1], fit[2])), float(np.sqrt(np.linalg.eigvalsh(inverse[1:, 1:])[-1])),
        wide, spread, len(mean), covered,
    )  # fmt: skip


def _common(turned: Turned, some: np.ndarray) -> float:
    """mm²: the variance that common causes give the mean radius of some points."""
    return float(sum(float(f[some, 0].mean()) ** 2 for f in turned.moves))


def _row(turned: Turned, some: np.ndarray) -> np.ndarray:
    """Number of the row of each point: as wide as the mesh along the axis."""
    z = turned.z[some]
    return np.asarray((z - z.min()) / turned.spacing, dtype=np.int64)


def _cells(
    cell: np.ndarray, value: Floats, most: int, row: np.ndarray
) -> tuple[Floats, np.ndarray, float]:
    """Means of the cells that have points enough, which they are, and a mean's noise, mm: NaN where
    no cell has points of two rows.

    Points of one row lie between the same measured ones, so neighbours are off together: the noise
    is told by how the means of rows scatter about their cell's.
    """
    count = np.bincount(cell, minlength=most)
    good = count >= max(_CELL // 2, 3)
    mean = np.bincount(cell, value, minlength=most) / np.maximum(count, 1)
    rows = int(row.max()) + 1
    place = cell * rows + row
    n = np.bincount(place, minlength=most * rows).reshape(most, rows)
    off = np.bincount(place, value - mean[cell], minlength=most * rows).reshape(most, rows)
    free = 1.0 - (n**2).sum(axis=1) / np.maximum(count, 1) ** 2  # Σ of squared sums about the mean
    some = good & (free > _LONE)
    square = (off**2).sum(axis=1)[some] / count[some] ** 2 / free[some]
    return mean[good], np.flatnonzero(good), float(np.sqrt(square.mean())) if some.any() else np.nan


def _minimum_zone(A: Floats, mean: Floats) -> float:
    """Width of the narrowest zone |A p − mean| ≤ t / 2: a linear programme in p and t."""
    from scipy.optimize import linprog

    half = np.full((len(mean), 1), -0.5)
    found = linprog(
        np.r_[np.zeros(A.shape[1]), 1.0],
        np.vstack([np.hstack([A, half]), np.hstack([-A, half])]), np.r_[mean, -mean],
        bounds=[(None, None)] * A.shape[1] + [(0, None)],
    )  # fmt: skip
    return float(found.x[-1]) if found.x is not None else float("nan")


def _along(turned: Turned, line: Line) -> np.ndarray | None:
    """The points of a line of the profile, where it runs along the axis and is seen all round."""
    way = (line.end - line.start) / max(line.length, 1e-12)
    if abs(way[0]) > np.sin(_STRAIGHT) or line.length < 4 * turned.spacing:
        return None
    low, high = sorted((float(line.start[1]), float(line.end[1])))
    inside = (turned.z > low + turned.spacing) & (turned.z < high - turned.spacing)
    near = np.abs(turned.r - (line.start[0] + line.end[0]) / 2) < turned.spacing + 6 * turned.sigma
    hollow = bool(way[1] < 0)
    some = np.flatnonzero(inside & near & _wall(turned, hollow))
    seen = np.unique((turned.angle[some] / (2 * np.pi) % 1.0 * 36).astype(np.int64))
    return some if len(some) > 20 * _CELL and len(seen) >= _COVERED * 36 else None


def _lines(outlines: Sequence[Outline]) -> list[Line]:
    return [p for o in outlines for p in o.pieces if isinstance(p, Line) and not p.link]


def cylindricities(turned: Turned, outlines: Sequence[Outline]) -> list[Cylindricity]:
    """The cylindricity of each line of the profile that runs along the axis."""
    out = []
    for line in _lines(outlines):
        some = _along(turned, line)
        if some is None:
            continue
        r, angle, z = turned.r[some], turned.angle[some], turned.z[some]
        t = (z - z.mean()) / max(float(np.ptp(z)), 1e-12)
        c, s = np.cos(angle), np.sin(angle)
        A = np.column_stack([np.ones(len(r)), c, s, t * c, t * s])
        fit = np.linalg.lstsq(A, r, rcond=None)[0]
        across = max(int(np.sqrt(len(r) / 25)), 3)
        around = int(angle.size // (25 * across)) or 1
        rows = np.clip(((t + 0.5) * across).astype(np.int64), 0, across - 1)
        place = rows * around + (angle / (2 * np.pi) % 1.0 * around).astype(np.int64) % around
        row = _row(turned, some)
        means, _, noise = _cells(place, r - A @ fit, across * around, row)
        about = _cells(place, r - fit[0], across * around, row)[0]
        if len(means) < 12:
            continue
        wide, spread = noise_range(np.full(len(means), noise))
        own = float(np.fmax(noise, means.std())) / np.sqrt(len(means))
        sigma = float(np.sqrt(own**2 + _common(turned, some)))
        out.append(
            Cylindricity(
                float(z.min()), float(z.max()), bool(turned.normal[some[0], 0] < 0), float(fit[0]),
                sigma, float(np.ptp(means)), float(np.ptp(about)), wide, spread, len(means),
            )
        )  # fmt: skip
    return out


def thread(turned: Turned, outlines: Sequence[Outline]) -> list[Thread]:
    """Waves that wind about straight pieces of the wall as a thread does, the strongest of each.

    The wave cos(2πz/p ∓ φ) is sought over pitches p from three steps of the mesh to a third of the
    piece; rings without a pitch belong to the profile. What noise makes of it is told by the median
    over all pitches, for the noise of neighbours is not independent.
    """
    out = []
    for line in _lines(outlines):
        some = _along(turned, line)
        if some is None:
            continue
        off, z, angle = turned.off[some], turned.z[some], turned.angle[some]
        off = off - off.mean()
        long = float(np.ptp(z))
        if long < 12 * turned.spacing:
            continue
        waves = np.linspace(3.0 / long, 1.0 / (3.0 * turned.spacing), _PITCHES)
        hands = np.repeat([1.0, -1.0], _PITCHES)
        pitches = hands / np.tile(waves, 2)
        sizes = np.empty(2 * _PITCHES)
        for k, hand in enumerate((1.0, -1.0)):
            turn = np.exp(-1j * hand * angle) * off
            for j, w in enumerate(waves):
                size = 2.0 * abs(complex(np.mean(turn * np.exp(2j * np.pi * w * z))))
                sizes[k * _PITCHES + j] = size
        best = int(np.argmax(sizes))
        sigma = float(np.median(sizes)) / _RAYLEIGH
        if sizes[best] > _THREAD * sigma:
            low, high = float(z.min()), float(z.max())
            out.append(Thread(low, high, float(pitches[best]), float(sizes[best]), sigma))
    return out

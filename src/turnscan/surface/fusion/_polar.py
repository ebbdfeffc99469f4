"""Merge in angle and height: for parts with one radius at every angle and height."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._parts import joined_provenance
from turnscan.points import Along, RangeGrid, usual_sigma
from turnscan.surface._grid_mesh import TearLimits, mesh_grid, thin
from turnscan.surface.fusion._range_surface import RangeSurface

_CLASHES = 0.005
"""Share of the cells with two radii above which a part is re-entrant."""
_FLAT = float(np.cos(np.deg2rad(20.0)))
_FLATS = 0.03
"""Share of the area within 20° of level above which angle and height miss too much of a part."""
_JUMP = 3.0
"""Combined sigma beyond which two measurements of one cell are not averaged."""
_GUESS = 0.75
"""Lines' distances that a surface may be off between two profiles before a cell is a guess."""
_VAGUE = 17.0
"""Usual sigma beyond which a cell between profiles is a guess."""
_COARSE = 2.5
"""Profiles further apart than this many lines are coarse."""
_SAME = 0.25
"""Part of a step within which two profiles are one column of cells …"""
_APART = 0.5
"""… and the most that is, beside the axis, where a step is short."""


@dataclass(frozen=True)
class PolarGrid:
    """The radius of several surfaces in common cells of angle and height."""

    angles: Floats
    """(s,) rad, ascending from 0 to 2π: where the cells lie."""
    radius: Floats
    """(surfaces, s, n) mm, NaN where nothing was measured."""
    weight: Floats
    """(surfaces, s, n) cos(incidence)/spread², 0 where nothing was measured."""
    slope: Floats
    """(surfaces, s, n) cosine between the surface's normal and the radius."""
    noise: Floats
    """(surfaces, s, n) mm along the normal: the sigma of the points."""
    random: Floats
    """(surfaces, s, n) mm along the normal: of that, what averages out."""
    spread: Floats
    """(surfaces, s, n) mm along the normal: that and what the surface may do between its
    profiles and lines."""
    bend: Floats
    """(surfaces, s, n) mm along the normal: the same, but for edges between profiles."""
    source: Ints
    """(surfaces, s, n) number of the nearest vertex of that surface, −1 where none."""
    aside: Floats
    """(surfaces, s, n) rad from the cell's angle: 0 where the surface meets the cell, else where it
    ends before that; NaN where nothing was measured."""
    bottom: float
    """mm: height of the first line."""
    rise: float
    """mm between lines."""
    several: float
    """Share of the cells with two radii, of one surface or of two of them: a wall beside the axis
    is seen from before it by one and from beyond it by the other."""
    flat: float
    """Share of the area that is within 20° of level."""

    @property
    def fits(self) -> bool:
        """Whether the part has one radius at every angle and height, as far as it was seen."""
        return self.several <= _CLASHES and self.flat <= _FLATS


def polar_grid(surfaces: Sequence[RangeSurface], steps: int, rise: float) -> PolarGrid:
    """Lay range surfaces into common cells, ``rise`` mm high and ``steps`` round the turn or more.

    Where profiles are much further apart than the lines in them, the cells stand on the profiles
    themselves, those of all surfaces, so that each measured place has one. Elsewhere they divide
    the turn evenly whatever the steps of the scan were; so the seam closes.
    """
    from turnscan.mesh import _normal_kernels as faces
    from turnscan.surface.fusion import _polar_kernels as kernels
    from turnscan.surface.fusion._variance_kernels import Vertices

    # By an edge alone no cell becomes a guess (`PolarGrid.bend`); it counts for less beside what
    # another surface measured there. Nor is a slight one asked for: where a face is doubted, the
    # cell takes another radius of the part.
    between = [(s.between(), s.between(edges=np.inf)) for s in surfaces]
    columns, room = _columns(surfaces, steps, rise)
    heights = np.concatenate([s.mesh.vertices[:, 2] for s in surfaces])
    bottom = float(heights.min())
    shape = (len(surfaces), len(columns), int((heights.max() - bottom) / rise) + 1)
    radius, slope, noise, random, spread, bend, aside = np.full((7, *shape), np.nan)
    weight, source = np.zeros(shape), np.full(shape, -1, dtype=np.int32)
    most = usual_sigma(np.concatenate([s.sigma for s in surfaces]), most=True)
    met = clashes = 0
    area = level = 0.0
    apart = 0.0
    for i, s in enumerate(surfaces):
        X = s.mesh.vertices
        known = s.sigma[s.sigma > 0]
        alike = max(3 * rise, 6 * float(np.median(known)) if len(known) else 0.0)
        more = kernels.raster(
            Vertices(X, s.sigma, s.ranks, s.noise(most), s.bend, s.alike),
            between[i],
            s.between_lines,
            _turns(X),
            np.maximum(s.cosine, 0.05),
            s.mesh.faces,
            columns,
            (bottom, rise),
            (alike, room),
            kernels.Cells(
                radius[i],
                weight[i],
                slope[i],
                noise[i],
                random[i],
                spread[i],
                bend[i],
                source[i],
                aside[i],
            ),
        )
        met, clashes, apart = met + more[0], clashes + more[1], max(apart, alike)
        both = faces.level(X, s.mesh.faces, s.normals, _FLAT)
        area, level = area + both[0], level + both[1]
    clashes += _unlike(np.where(aside == 0, radius, np.nan), apart)
    several, flat = clashes / max(met, 1), level / max(area, 1e-300)
    angles, aside = 2 * np.pi * columns, 2 * np.pi * aside
    return PolarGrid(
        angles,
        radius,
        weight,
        slope,
        noise,
        random,
        spread,
        bend,
        source,
        aside,
        bottom,
        rise,
        several,
        flat,
    )


def _turns(X: Floats) -> Floats:
    """(v,) the angle of each vertex about the axis, in turns."""
    return np.asarray(np.arctan2(X[:, 1], X[:, 0]) / (2 * np.pi) % 1.0)


def _columns(surfaces: Sequence[RangeSurface], steps: int, rise: float) -> tuple[Floats, float]:
    """(s,) where cells stand round the turn, in turns, and how far beside one a surface may end
    that has its place there: where the cells stand on profiles, none is met by the whole of each,
    as a sheet leans a little and passes a little beside the axis."""
    reach = np.concatenate([np.hypot(*s.mesh.vertices[:, :2].T) for s in surfaces])
    if 2 * np.pi / steps * float(np.median(reach)) < _COARSE * rise:
        return np.arange(steps) / steps, 0.0
    profiles = [_directions(s) for s in surfaces]
    angle, far = np.concatenate([a for a, _ in profiles]), np.concatenate([r for _, r in profiles])
    # Beside the axis a step is short, and noise draws an angle by many: what lies there has a
    # column of its own where none stands near it, and takes none from what lies further out.
    usual = float(np.median(reach))
    room = np.clip(_SAME * usual / np.maximum(far, 1e-12), _SAME, _APART) / steps
    out = list[float]()
    for k in np.lexsort((angle, -far)):
        i = bisect(out, angle[k])
        beside = (out[i - 1], out[i % len(out)]) if out else ()
        if all(abs((angle[k] - c + 0.5) % 1.0 - 0.5) > room[k] for c in beside):
            out.insert(i, float(angle[k]))
    return np.asarray(out), _SAME / steps


def _directions(s: RangeSurface) -> tuple[Floats, Floats]:
    """(p,) where each profile of a surface stands round the turn, in turns, and mm how far its
    furthest point lies from the axis.

    It stands where its points lie least aside of, by least squares: far ones tell most.
    """
    x, y = s.mesh.vertices[:, 0], s.mesh.vertices[:, 1]
    r = np.hypot(x, y)
    angle = np.arctan2(np.bincount(s.ranks, y * r), np.bincount(s.ranks, x * r))
    far = np.zeros(len(angle))
    np.maximum.at(far, s.ranks, r)
    return np.asarray(angle / (2 * np.pi) % 1.0), far


def _unlike(radius: Floats, apart: float) -> int:
    """In how many cells two surfaces lie more than ``apart`` mm from each other."""
    low, high = np.full((2, *radius.shape[1:]), np.nan)
    for r in radius:
        low, high = np.fmin(low, r), np.fmax(high, r)
    with np.errstate(invalid="ignore"):
        return int((high - low > apart).sum())


def merge_polar(
    grid: PolarGrid, surfaces: Sequence[RangeSurface], tears: TearLimits, along: Along | None = None
) -> tuple[Mesh, int]:
    """The merged surface, and how many cells disagreed beyond three sigma.

    Where all that was measured in a cell lies within three combined sigma of the best (largest
    cos(incidence)/spread²) it is averaged with those weights; what does not, is left out: the best
    counts. What the surface may do between profiles excuses no disagreement, for it may be a gap;
    it makes a measurement count less, and the sigma of a cell larger. Averaging lowers noise alone
    (`RangeSurface.noise`): what is known worse, at an edge or between profiles, all surfaces may
    have alike.
    Where its bend may be more than three quarters of a line's distance and more than three usual
    sigma, nothing was measured, and the cell is left to the other surfaces; so is one between
    profiles that is known seventeen times worse than usual (`_vague`). A vertex has the provenance
    of the nearest vertex of the best surface.
    ``along`` chooses the points along the merged profiles.
    """
    measured = grid.noise[~np.isnan(grid.noise)]
    usual = usual_sigma(measured)
    with np.errstate(invalid="ignore"):
        guess = grid.bend**2 - grid.noise**2 > max(_GUESS * grid.rise, _JUMP * usual) ** 2
    guess |= _vague(grid, surfaces, _VAGUE * usual)
    weight = np.where(guess, 0.0, grid.weight)
    # What ends beside a cell says nothing where another surface goes on.
    met = ((weight > 0) & (grid.aside == 0)).any(axis=0)
    weight = np.where(met & (grid.aside != 0), 0.0, weight)
    best = np.argmax(weight * np.nan_to_num(grid.radius), axis=0)[None]
    chosen = np.take_along_axis(grid.radius, best, 0)
    noise, slope = (np.take_along_axis(v, best, 0) for v in (grid.noise, grid.slope))
    with np.errstate(invalid="ignore"):
        off = np.fmax(slope, grid.slope) * np.abs(grid.radius - chosen) > _JUMP * np.hypot(
            grid.noise, noise
        )
    weight = np.where(off, 0.0, weight)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        radius = np.nansum(weight * grid.radius, axis=0) / total
        phi = grid.angles[:, None] + np.nansum(weight * grid.aside, axis=0) / total
        common = np.sqrt(np.maximum(grid.spread**2 - grid.random**2, 0.0))
        sigma = np.hypot(
            np.sqrt(np.nansum((weight * grid.random) ** 2, axis=0)),
            np.nansum(weight * common, axis=0),
        )
        sigma /= total
    _, s, n = grid.radius.shape
    points = np.stack(
        [
            radius * np.cos(phi),
            radius * np.sin(phi),
            np.where(np.isnan(radius), np.nan, grid.bottom + grid.rise * np.arange(n)),
        ],
        axis=-1,
    )
    merged = RangeGrid(
        laser="merged",
        steps=np.arange(s, dtype=np.int32),
        angles=grid.angles,
        points=points,
        sigma=sigma,
        amplitude=sigma,
        flags=np.isnan(radius).astype(np.uint16),
        closed=True,
    )
    mesh = mesh_grid(thin(merged, along, tears), tears)
    starts = np.cumsum([0] + [len(p.mesh.vertices) for p in surfaces])[:-1]
    source = np.take_along_axis(grid.source, best, 0)[0] + starts[best[0]]
    return replace(mesh, provenance=_measured_by(mesh, source, surfaces)), int(off.sum())


def _vague(grid: PolarGrid, surfaces: Sequence[RangeSurface], most: float) -> Bools:
    """(surfaces, s, n) True for cells of more than ``most`` mm of sigma between profiles: further
    than a line's distance from the measured vertex that is nearest to them.

    A point that is known so badly is kept where it was measured; what runs from there to the next
    profile is a guess.
    """
    out = np.zeros(grid.radius.shape, dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        some = np.stack(np.nonzero(grid.noise > most))
    for i, surface in enumerate(surfaces):
        own = some[:, some[0] == i]
        r, angle = grid.radius[tuple(own)], grid.angles[own[1]] + grid.aside[tuple(own)]
        height = grid.bottom + grid.rise * own[2]
        at = np.stack([r * np.cos(angle), r * np.sin(angle), height], axis=-1)
        away = np.linalg.norm(at - surface.mesh.vertices[grid.source[tuple(own)]], axis=1)
        out[tuple(own)] = away > grid.rise
    return out


def _measured_by(
    mesh: Mesh, source: npt.NDArray[np.int64], surfaces: Sequence[RangeSurface]
) -> Provenance | None:
    cells, whole = mesh.provenance, joined_provenance([s.mesh for s in surfaces])
    if cells is None or whole is None:
        return None
    at = source[cells.step, cells.line]
    return Provenance(cells.sigma, whole.laser[at], whole.step[at], whole.line[at], whole.lasers)

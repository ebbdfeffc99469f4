"""Merge in angle and height: for parts with one radius at every angle and height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.points import Along, RangeGrid
from turnscan.surface._grid_mesh import Tears, mesh_grid, thin
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._paste import joined_provenance
from turnscan.surface._range_surface import RangeSurface

_CLASHES = 0.005
"""Share of the cells with two radii above which a part is re-entrant."""
_FLAT = float(np.cos(np.deg2rad(20.0)))
_FLATS = 0.03
"""Share of the area within 20° of level above which angle and height miss too much of a part."""
_JUMP = 3.0
"""Combined sigma beyond which two measurements of one cell are not averaged."""


@dataclass(frozen=True)
class PolarGrid:
    """The radius of several surfaces in common cells of angle and height."""

    radius: Floats
    """(surfaces, s, n) mm, NaN where nothing was measured."""
    weight: Floats
    """(surfaces, s, n) cos(incidence)/sigma², 0 where nothing was measured."""
    sigma: Floats
    """(surfaces, s, n) mm."""
    source: Ints
    """(surfaces, s, n) number of the nearest vertex of that surface, −1 where none."""
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
    """Lay range surfaces into common cells: ``steps`` round the turn, ``rise`` mm high.

    The cells divide the turn evenly whatever the steps of the scan were, so its seam closes.
    """
    from turnscan.surface import _face_kernels as faces
    from turnscan.surface import _polar_kernels as kernels

    heights = np.concatenate([s.mesh.vertices[:, 2] for s in surfaces])
    bottom = float(heights.min())
    shape = (len(surfaces), steps, int((heights.max() - bottom) / rise) + 1)
    radius, sigma = np.full(shape, np.nan), np.full(shape, np.nan)
    weight, source = np.zeros(shape), np.full(shape, -1, dtype=np.int32)
    met = clashes = 0
    area = level = 0.0
    apart = 0.0
    for i, s in enumerate(surfaces):
        X = s.mesh.vertices
        around = np.arctan2(X[:, 1], X[:, 0]) % (2 * np.pi) * steps / (2 * np.pi)
        noise = s.sigma
        known = noise[noise > 0]
        alike = max(3 * rise, 6 * float(np.median(known)) if len(known) else 0.0)
        more = kernels.raster(
            around, X, s.mesh.faces, _weights(s), noise, bottom, rise, alike,
            radius[i], weight[i], sigma[i], source[i],
        )  # fmt: skip
        met, clashes, apart = met + more[0], clashes + more[1], max(apart, alike)
        both = faces.level(X, s.mesh.faces, s.normals, _FLAT)
        area, level = area + both[0], level + both[1]
    clashes += _unlike(radius, apart)
    several, flat = clashes / max(met, 1), level / max(area, 1e-300)
    return PolarGrid(radius, weight, sigma, source, bottom, rise, several, flat)


def _unlike(radius: Floats, apart: float) -> int:
    """In how many cells two surfaces lie more than ``apart`` mm from each other."""
    low, high = np.full((2, *radius.shape[1:]), np.nan)
    for r in radius:
        low, high = np.fmin(low, r), np.fmax(high, r)
    with np.errstate(invalid="ignore"):
        return int((high - low > apart).sum())


def _weights(s: RangeSurface) -> Floats:
    weights: Floats = np.maximum(s.cosine, 0.05) / np.maximum(s.sigma, 1e-6) ** 2
    return weights


def merge_polar(
    grid: PolarGrid, surfaces: Sequence[RangeSurface], tears: Tears, along: Along | None = None
) -> tuple[Mesh, int]:
    """The merged surface, and how many cells disagreed beyond three sigma.

    Where all that was measured in a cell lies within three combined sigma of the best (largest
    cos(incidence)/sigma²) it is averaged with those weights; what does not, is left out: the best
    counts. A vertex has the provenance of the nearest vertex of the best surface.
    ``along`` chooses the points along the merged profiles.
    """
    best = np.argmax(grid.weight, axis=0)[None]
    chosen = np.take_along_axis(grid.radius, best, 0)
    spread = np.take_along_axis(grid.sigma, best, 0)
    with np.errstate(invalid="ignore"):
        off = np.abs(grid.radius - chosen) > _JUMP * np.hypot(grid.sigma, spread)
    weight = np.where(off, 0.0, grid.weight)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        radius = np.nansum(weight * grid.radius, axis=0) / total
        sigma = np.sqrt(np.nansum((weight * grid.sigma) ** 2, axis=0)) / total
    _, s, n = grid.radius.shape
    phi = np.arange(s) * 2 * np.pi / s
    points = np.stack(
        [
            radius * np.cos(phi)[:, None],
            radius * np.sin(phi)[:, None],
            np.where(np.isnan(radius), np.nan, grid.bottom + grid.rise * np.arange(n)),
        ],
        axis=-1,
    )
    merged = RangeGrid(
        laser="merged",
        steps=np.arange(s, dtype=np.int32),
        angles=phi,
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


def _measured_by(
    mesh: Mesh, source: npt.NDArray[np.int64], surfaces: Sequence[RangeSurface]
) -> Provenance | None:
    cells, whole = mesh.provenance, joined_provenance([s.mesh for s in surfaces])
    if cells is None or whole is None:
        return None
    at = source[cells.step, cells.line]
    return Provenance(cells.sigma, whole.laser[at], whole.step[at], whole.line[at], whole.lasers)

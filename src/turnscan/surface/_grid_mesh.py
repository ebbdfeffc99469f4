"""RangeGrid → Mesh: neighbouring profiles pasted together, torn where the surface is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, handed_over
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.points import (
    Along,
    Origin,
    RangeGrid,
    normal_sigma,
    resample,
)
from turnscan.surface._noise import noise, spacing
from turnscan.threads import in_parts

_LEAST = 0.5
"""Part of the even spacing below which no local one is believed: what is denser is not torn."""
_LEAP = 2.2
"""An edge between profiles longer than this many even spacings has to continue one like it …"""
_BEND = float(np.cos(np.deg2rad(25.0)))
"""… in the profiles before or after, bent by no more than this."""
_TRUSTED = 3.0
"""A sigma above this many usual ones is a stray point's: it excuses no deeper jump than this."""


@dataclass(frozen=True)
class TearLimits:
    """When two neighbours in the grid are not one surface."""

    stretch: float = 4.0
    """A side longer than this many local spacings (the median of it and its neighbours in the
    same direction, so a surface seen at an angle is allowed its wider spacing, up to that at
    ``grazing``) …"""
    jump: float = 5.0
    """… and longer than this many combined sigma, is torn."""
    grazing: float = float(np.deg2rad(80.0))
    """Radians: a face whose normal lies further than this from the viewing ray and whose depth is
    more than ``jump`` combined sigma, is torn, unless its sides between profiles are like those
    before or after: noise of a face seen at just that angle would tear a row of holes into it."""

    def __post_init__(self) -> None:
        if not (self.stretch > 1 and self.jump >= 0 and 0 < self.grazing <= np.pi / 2):
            raise ValueError(
                f"TearLimits: stretch {self.stretch}, jump {self.jump}, {self.grazing} rad"
            )


def mesh_grid(grid: RangeGrid, tears: TearLimits | None = None) -> Mesh:
    """Paste neighbouring profiles of one grid into a mesh (paper §3; docs/explain/surface.md).

    Each quad of the grid is cut along its first diagonal, or the second where its lines climb from
    step to step; where a corner is missing or torn off the other three still make a face. The seam
    closes where ``grid.closed`` and there are at least three steps. All faces look outward: towards
    the camera that saw them, or away from the axis where the camera's place is not known. Every
    side has one or two faces. Sigma is that along the surface's normal (`normal_sigma`).
    """
    lines = slice(0, grid.flags.shape[1])
    if grid.origin is None:
        lines = grid.lines_about()
        grid = grid.of_lines(lines)
    vertices, faces, flat = _faces(grid, tears or TearLimits())
    s, n = grid.flags.shape
    step, line = np.divmod(flat, max(n, 1))
    if grid.origin is not None:
        # The measured point that is nearest to it.
        line = np.rint(grid.origin.lines[step, line])
    return Mesh(
        vertices,
        faces,
        Provenance(
            sigma=normal_sigma(grid).reshape(s * n)[flat],
            laser=np.zeros(len(flat), dtype=np.int32),
            step=grid.steps[step],
            line=(line + lines.start).astype(np.int32),
            lasers=(grid.laser,),
        ),
    )


def thin(grid: RangeGrid, along: Along | None, tears: TearLimits | None = None) -> RangeGrid:
    """`turnscan.points.resample` of a grid whose runs are those of its surface; None: as it is.

    Beside the ends of its profiles all points stay at which the surface is torn, so that the mesh
    of the new grid is torn there and nowhere else.
    """
    from turnscan.surface import _strip_kernels as kernels

    if along is None:
        return grid
    joined, ends = kernels.joints(
        kernels.used_vertices(_quads(grid, tears or TearLimits()), *grid.flags.shape)
    )
    return resample(grid, along, joined=joined, stays=ends)


def _faces(grid: RangeGrid, tears: TearLimits) -> tuple[Floats, Ints, Ints]:
    """Vertices, faces and the place of each vertex in the grid, a flat index."""
    from turnscan.surface import _grid_kernels as kernels

    s, n = grid.flags.shape
    faces = _quads(grid, tears) if grid.origin is None else _strips(grid, grid.origin, tears)
    points = grid.points.reshape(s * n, 3)
    if _inward(points, faces, eyes_of(grid), n) < 0:
        faces = np.ascontiguousarray(faces[:, ::-1])
    flat, faces = kernels.compact(faces, s * n)
    return points[flat], faces, flat


def _strips(grid: RangeGrid, origin: Origin, tears: TearLimits) -> Ints:
    """(f, 3) faces of a resampled grid: they cover what those of its origin cover."""
    from turnscan.surface import _strip_kernels as kernels

    used = kernels.used_vertices(_quads(origin.grid, tears), *origin.grid.flags.shape)
    faces: Ints = kernels.zipped(grid.points, origin.lines, behind_of(grid), used)
    return faces


def behind_of(grid: RangeGrid) -> Bools:
    """(s, n) `RangeGrid.behind`, False all over where the grid has none; read-only either way, for
    which kernels are compiled once."""
    if grid.behind is None:
        return handed_over(np.zeros(grid.flags.shape, np.bool_))
    return grid.behind


def eyes_of(grid: RangeGrid) -> Floats:
    """(s, 3) mm: `RangeGrid.eyes`, NaN where the grid has none; read-only either way."""
    if grid.eyes is None:
        return handed_over(np.full((len(grid.steps), 3), np.nan), nan=True)
    return grid.eyes


def _quads(grid: RangeGrid, tears: TearLimits) -> Ints:
    """(f, 3) faces of a grid as it was measured, in its own winding, of flat indices."""
    from turnscan.surface import _grid_kernels as kernels

    side = behind_of(grid)
    closed = grid.closed and len(grid.steps) >= 3
    to_step, to_line = kernels.edges(grid.points, side, closed)
    step, line = (np.maximum(even, 1e-12) for even in spacing(grid))
    believed = noise(grid)
    # By the arc of whichever end is nearer to the axis: the other may be what it leaps to.
    nearer = np.fmin(step, np.roll(step, -1, axis=0))
    far = np.maximum(_LEAP * nearer, tears.stretch * line)
    far = np.maximum(far, tears.jump * np.sqrt(2.0) * believed)
    to_step[kernels.leaps(grid.points, to_step, far, closed, _BEND)] = np.nan
    most = 1.0 / max(float(np.cos(tears.grazing)), 1e-3)
    sigma = np.minimum(grid.sigma, _TRUSTED * _median(grid.sigma))
    sides = kernels.Sides(
        to_step,
        to_line,
        kernels.usual(to_step, step, True, closed, _LEAST, most),
        kernels.usual(to_line, line, False, False, _LEAST, most),
        kernels.lead_on(grid.points, to_step, closed, _BEND),
    )
    limits = kernels.Limits(tears.stretch, tears.jump, float(np.cos(tears.grazing)))
    measured = kernels.Measured(grid.points, believed, sigma, side, eyes_of(grid))

    def part(first: int, end: int) -> Ints:
        faces: Ints = kernels.triangulate(measured, sides, closed, limits, (first, end))
        return faces

    return np.concatenate(in_parts(part, len(to_step)))


def _median(values: Floats) -> float:
    have = values[~np.isnan(values)]
    return float(np.median(have)) if len(have) else 0.0


def _inward(points: Floats, faces: Ints, eyes: Floats, n: int) -> float:
    """Positive where the grid's winding makes the faces look at the camera, on the whole.

    The faces of a grid wind alike, so one sign holds for all of them.
    """
    from turnscan.mesh import _normal_kernels as kernels

    if not len(faces):
        return 1.0
    some = faces[:: max(1, len(faces) // 20_000)]
    first, eye = points[some[:, 0]], eyes[some[:, 0] // n]
    outward = np.where(np.isnan(eye), first * (1.0, 1.0, 0.0), eye - first)
    return float(np.einsum("ij,ij->", kernels.crosses(points, some), outward))

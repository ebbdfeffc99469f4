"""What all points of a scan have in common, and what that does to a volume."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.findings import Finding
from turnscan.mesh import Mesh, vector_areas
from turnscan.points import RangeGrid, pixel_moves, pixels_of, rig_moves
from turnscan.rig import Pose, Rig
from turnscan.shapes._passed import Alone, alone, passed_findings
from turnscan.surface.fusion import RangeSurface

_EDGE = float(np.cos(np.radians(45.0)))
"""Sides across which the surface turns further are edges, over which a merge puts nothing."""


@dataclass(frozen=True, eq=False)
class View:
    """A grid as its own rig measured it, and where it lies on the part."""

    grid: RangeGrid
    """In the frame of its own scan, with the angles of its table."""
    rig: Rig
    """The same object for all views that one rig measured: its errors are common to them."""
    name: str
    """Of its laser in the provenance of the mesh."""
    pose: Pose | None = None
    """From the frame of its scan to that of the mesh; None where they are one."""


@dataclass(frozen=True)
class Source:
    """What a mesh was made from, as far as the uncertainty of its volume hangs on it."""

    grids: Sequence[RangeGrid] = ()
    """Those of its lasers, where the rig is known."""
    rig: Rig | None = None
    """What measured them; its covariance is the calibration's."""
    profiles: Sequence[RangeSurface] = ()
    """What was merged in voxels; empty where the vertices are points of profiles."""
    moves: Sequence[Floats] = ()
    """(v, 3) mm each: how the vertices move, all at once, with one standard deviation of each other
    cause, such as the pose of a scan."""
    placed: Sequence[View] = ()
    """In place of ``grids`` and ``rig`` where several poses were joined."""
    surface: Mesh | None = None
    """What was merged of the grids, islands as well, before anything of it was edited, closed or
    thinned; None where it was not kept."""

    @cached_property
    def alone(self) -> Alone:
        """Measured points that are on no face of the surface."""
        if self.surface is None or not self.grids:
            return Alone(np.zeros((0, 3)), 0.0)
        return alone(np.concatenate([g.points[g.found] for g in self.grids]), self.surface)

    def findings(self, mesh: Mesh) -> list[Finding]:
        """What the measured points say of the fillings of the mesh, where they pass them by."""
        return passed_findings(mesh, self.alone, sum(int(g.found.sum()) for g in self.grids))

    @property
    def every_view(self) -> list[View]:
        """All grids whose rig is known."""
        rig = self.rig
        alone = [] if rig is None else [View(g, rig, g.laser) for g in self.grids]
        return list(self.placed or alone)

    @property
    def views(self) -> list[View]:
        """Those whose rig has a covariance, or whose light is thick."""
        return [
            v
            for v in self.every_view
            if v.rig.covariance is not None or v.grid.light_doubt is not None
        ]


def calibration_moves(mesh: Mesh, source: Source) -> Iterator[Floats]:
    """(v, 3) mm: how the vertices of a mesh move with the rig's calibration (`points.rig_moves`),
    with what is not known of its thick sheet of light (`RangeGrid.light_doubt`), and with the place
    of stripes in their pixels (`points.pixel_moves`).

    What one rig measured moves together, in all poses of the part; rigs are independent of each
    other. Vertices that were not measured go with the nearest that somebody did. Nothing where rig
    or provenance are not known.
    """
    from scipy.spatial import cKDTree

    p = mesh.provenance
    if p is None:
        return
    known = np.zeros(len(mesh.vertices), dtype=np.bool_)
    by_rig = dict[int, list[tuple[Longs, Iterator[Floats]]]]()
    for view in source.views:
        if view.name not in p.lasers:
            continue
        grid, laser = view.grid, p.lasers.index(view.name)
        mine = np.flatnonzero((p.laser == laser) & np.isin(p.step, grid.steps) & ~known)
        known[mine] = True
        order = np.argsort(grid.steps, kind="stable")
        row = order[np.searchsorted(grid.steps[order], p.step[mine])]
        fields = _moves_of(view, mesh.vertices[mine], row, p.line[mine])
        by_rig.setdefault(id(view.rig), []).append((mine, fields))
    if not known.any():
        return
    there = np.flatnonzero(known)
    near = there[cKDTree(mesh.vertices[there]).query(mesh.vertices)[1]]
    for measured in by_rig.values():
        for parts in zip(*(fields for _, fields in measured), strict=True):
            field = np.zeros_like(mesh.vertices)
            for (mine, _), part in zip(measured, parts, strict=True):
                field[mine] = np.nan_to_num(part)
            yield field[near]


def common_moves(mesh: Mesh, source: Source) -> list[Floats]:
    """(v, 3) mm each: how the vertices of a mesh move with all that they have in common: the
    calibration (`calibration_moves`), and the other causes of their source."""
    return [*calibration_moves(mesh, source), *source.moves]


def _moves_of(view: View, points: Floats, row: Longs, line: Ints) -> Iterator[Floats]:
    """(m, 3) mm: how points of a view, measured in those rows and lines of its grid, move with its
    rig, in the frame of the mesh."""
    pose, grid = view.pose, view.grid
    own = points if pose is None else pose.inverse().apply(points)
    angles = grid.angles[row]
    pixels = pixels_of(view.rig, own, angles)
    fields: Iterable[Floats] = rig_moves(view.rig, grid.laser, pixels, angles)
    own_light: Iterable[Floats] = [np.zeros_like(points)] * 3
    if grid.light_doubt is not None and len(points):
        doubt = np.where(line[:, None] >= 0, grid.light_doubt[row, line], 0.0)
        # A line is a row of the picture, or a column where the stripe runs along the rows.
        across = int(np.argmax(np.median(np.abs(pixels - line[:, None]), axis=0)))
        own_light = chain([doubt], pixel_moves(view.rig, grid.laser, pixels, angles, across))
    for field in chain(fields, own_light):
        yield field if pose is None else pose.turn(field)


def moved(shares: Floats, moves: Iterable[Floats]) -> float:
    """mm³: standard uncertainty of a volume from moves (v, 3) that are independent of each other.

    ``shares`` (v, 3) mm² is ∂V/∂vertex. Each move is common to all vertices, so that what it does
    is added up with its sign and does not average out; the moves among themselves do.
    """
    return float(np.sqrt(sum(float(np.einsum("vi,vi->", shares, m)) ** 2 for m in moves)))


def profile_sigma(profiles: Sequence[RangeSurface], mesh: Mesh) -> float:
    """mm³: what a merge in voxels put between the profiles, on top of their chords.

    The bulge of a face over its corners i, j is (nⱼ − nᵢ)·(xⱼ − xᵢ)/8 in the middle of each side,
    a third of the sum of the three on average. It is right to the second order and wrong near
    borders and edges, so all of it is doubted.
    """
    total, area = 0.0, 0.0
    for r in profiles:
        t, n = r.mesh.triangles, r.normals[r.mesh.faces]
        over, on = np.roll(t, -1, axis=1), np.roll(n, -1, axis=1)
        rise = np.einsum("fij,fij->fi", on - n, over - t) / 8
        rise[np.einsum("fij,fij->fi", on, n) < _EDGE] = 0.0
        each = np.linalg.norm(vector_areas(t), axis=1)
        total, area = total + float(each @ rise.sum(axis=1)) / 3, area + float(each.sum())
    return abs(total / area) * mesh.area_of() if area > 0 else 0.0

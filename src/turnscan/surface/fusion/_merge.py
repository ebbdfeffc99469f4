"""Merge: the surfaces of several lasers, passes or scans → one, and where they disagree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._parts import measured, submesh
from turnscan.points import Along, RangeGrid, usual_sigma
from turnscan.remedy import Option, Remedy
from turnscan.surface._grid_mesh import TearLimits
from turnscan.surface.decimation import dissolve
from turnscan.surface.fusion._carve import carved
from turnscan.surface.fusion._combine import paste
from turnscan.surface.fusion._kept import Merged, keeping
from turnscan.surface.fusion._overlap import apart_findings, overlap_findings, overlaps
from turnscan.surface.fusion._polar import PolarGrid, merge_polar, polar_grid
from turnscan.surface.fusion._range_surface import (
    RangeSurface,
    range_surfaces,
    rise,
    spacing,
)
from turnscan.surface.fusion._seat import seated
from turnscan.surface.fusion._tsdf import fuse, without_slivers
from turnscan.surface.fusion._witness import witnessed

MergeMethod = Literal["auto", "grid", "tsdf", "paste"]
_SEAM = 3
"""Voxels, of the size of the usual spacing, by which a surface may end before it meets the next:
one point is cleaned away at the edge, up to one spacing is left before it, and a cube needs all
its corners."""
_SHORT = 0.3
"""Voxels: of two vertices that are confirmed, no further from each other, one is left."""


def merge(
    grids: Sequence[RangeGrid],
    tears: TearLimits | None = None,
    how: MergeMethod = "auto",
    voxel: float | None = None,
    *,
    along: Along | None = None,
    sewn: bool = False,
) -> tuple[Mesh, list[Finding]]:
    """One mesh from the grids of several lasers or scans, and what there is to know about it.

    ``grid`` averages in cells of angle and height (parts with one radius at each); ``tsdf`` in
    voxels of ``voxel`` mm (None: the usual spacing of the points), for all parts; ``paste`` keeps
    every measured point and averages nothing (`paste`). All points are merged; ``along`` chooses
    those of a surface that is made of profiles (``paste``, ``grid``). ``auto`` pastes a single
    grid, and merges several by ``grid`` where the part allows it and the table turned, else by
    ``tsdf``; where that leaves out more than a tenth of what was measured, by what keeps most of it
    (`keeping`). ``sewn``: the narrow gaps that ``tsdf`` leaves between surfaces are closed by faces
    not ``measured``.

    The order of the grids does not matter, to the last bit, as long as their lasers have names of
    their own.

    Raises InputError where a merge needs what the grids do not know, LimitExceeded for voxels too
    small for the part.
    """
    t = tears or TearLimits()
    # By name and place in the scan, so that the order in which they come changes nothing.
    grids = sorted(grids, key=lambda g: (g.laser, *g.steps[:1], *g.angles[:1]))
    there = [g for g in grids if g.found.any()]
    if how == "paste" or (how == "auto" and len(there) < 2) or not there:
        return paste(grids, t, along), []
    surfaces = [s for g in there for s in range_surfaces(g, t) if len(s.mesh.faces)]
    if not surfaces:
        return paste(grids, t, along), []
    sigma = usual_sigma(np.concatenate([s.sigma for s in surfaces]))
    surfaces, through = carved(surfaces, max(rise(surfaces), 3 * sigma))
    surfaces = [s for s in surfaces if len(s.mesh.faces)]
    found = overlaps(surfaces)
    findings = [*apart_findings(there, surfaces, found), *overlap_findings(found)]
    if through:
        text = f"{through} faces between profiles are removed: a camera saw points behind them"
        findings.append(Finding("surface.through", "note", text))
    turns = all(len(g.angles) > 2 and np.ptp(g.angles) > 0 for g in there)
    if how == "grid" and not turns:
        raise InputError(
            "scans without a turning table have no angle to merge by",
            hint=Remedy("use ", Option("merge", "tsdf")),
        )
    ways = _Ways(
        grids, surfaces, t, along, sewn, spacing(surfaces) if voxel is None else voxel, sigma
    )
    if not turns or how == "tsdf":
        mesh, said = ways.in_voxels("asked for" if turns else "the scans have no common axis")
        return mesh, [*findings, *said]
    cells = polar_grid(surfaces, _steps(there), rise(surfaces))
    why = f"{cells.several:.1%} of the cells have several radii, {cells.flat:.0%} is level"
    if how == "grid":
        mesh, said = ways.by_angle(cells, why)
    else:
        # What is thinned afterwards holds less, whichever way it was merged.
        best, why, (mesh, said) = keeping(surfaces, replace(ways, along=None).all(cells), why)
        if along is not None:
            mesh, said = ways.all(cells)[best](why)
    return mesh, [*findings, *said]


@dataclass(frozen=True)
class _Ways:
    """The ways of merging the same surfaces; each takes the reason for which it was chosen."""

    grids: Sequence[RangeGrid]
    surfaces: Sequence[RangeSurface]
    tears: TearLimits
    along: Along | None
    sewn: bool
    voxel: float
    """mm."""
    sigma: float
    """mm: the usual one."""

    @property
    def count(self) -> int:
        """Grids that saw anything."""
        return sum(bool(g.found.any()) for g in self.grids)

    def all(self, cells: PolarGrid) -> list[Callable[[str], Merged]]:
        """Those that a turning table allows, first the one that fits the part's shape."""
        by_shape = [lambda why: self.by_angle(cells, why), self.in_voxels]
        return [*(by_shape if cells.fits else by_shape[::-1]), self.side_by_side]

    def by_angle(self, cells: PolarGrid, why: str) -> Merged:
        """In cells of angle and height."""
        mesh, off = merge_polar(cells, self.surfaces, self.tears, self.along)
        text = f"{self.count} grids merged in angle and height ({why}); {off} cells disagreed"
        return mesh, [_merged_by(text, "tsdf|paste")]

    def in_voxels(self, why: str) -> Merged:
        """In voxels."""
        size, most = self.voxel, max(self.voxel, 3 * self.sigma)
        ramp = min(max(2.5 * size, 3 * self.sigma), 6 * size)
        text = f"{self.count} grids merged in voxels of {size:.3g} mm, ramp {ramp:.3g} mm ({why})"
        if self.along is not None:
            text += "; the spacing along profiles has no effect"
        mesh = fuse(self.surfaces, size, ramp, _SEAM if self.sewn else 0, most)
        mesh, lost = _confirmed(mesh, self.surfaces, size, most)
        mesh = without_slivers(mesh, _SHORT * size)
        return mesh, [_merged_by(text, "grid|paste"), *lost]

    def side_by_side(self, why: str) -> Merged:
        """Pasted: nothing is averaged."""
        text = f"{self.count} grids pasted, nothing averaged ({why})"
        return paste(self.grids, self.tears, self.along), [_merged_by(text, "grid|tsdf")]


def _merged_by(text: str, others: str) -> Finding:
    """How grids were merged, and what else could be chosen."""
    return Finding(
        "surface.merge", "note", text, "", Remedy("other ways: ", Option("merge", others))
    )


def _confirmed(
    mesh: Mesh, surfaces: Sequence[RangeSurface], voxel: float, most: float
) -> tuple[Mesh, list[Finding]]:
    """The mesh without the vertices that no measured surface confirms, or that are guessed.

    What was guessed beside a measured point, or is known badly there, goes onto it (`seated`);
    between profiles it is spanned by faces between the vertices that are left, and where that does
    not go, as beyond the end of a profile, its faces go. So is what stands afar from all points,
    but where that does not go it stays, with its sigma. What is confirmed from afar alone is known
    no better than that. Faces that close a seam are not measured, and need no witness; nor do the
    vertices on their border, but what is not confirmed there was not measured either.
    """
    told = witnessed(mesh, surfaces, voxel, most)
    good, guessed, loose, afar = told.confirmed, told.guessed, told.loose, told.afar
    p = mesh.provenance
    if p is not None:
        sigma = np.where(good & ~np.isnan(p.sigma), told.sigma, p.sigma)
        mesh = replace(mesh, provenance=replace(p, sigma=sigma))
    doubted = np.zeros(len(mesh.vertices), dtype=np.bool_)
    if mesh.measured is not None:
        made = np.zeros(len(mesh.vertices), dtype=np.bool_)
        made[mesh.faces[~mesh.measured]] = True
        doubted = made & (~good | guessed | afar)
        good, guessed, loose, afar = good | made, guessed & ~made, loose & ~made, afar & ~made
    out = list[Finding]()
    if not good.all():
        text = f"{int((~good).sum())} vertices far from every measured surface are removed"
        out.append(Finding("surface.unmeasured", "note", text, _about(mesh.vertices[~good])))
        mesh, left = _without(mesh, ~good)
        guessed, loose, afar, doubted = guessed[left], loose[left], afar[left], doubted[left]
    if (guessed | loose).any():
        mesh, unseated = seated(mesh, guessed | loose, surfaces, voxel)
        guessed &= unseated
    if (guessed | afar).any():
        mesh, left = dissolve(mesh, guessed | afar)
        guessed, doubted = guessed[left], doubted[left]
    if guessed.any():
        text = f"{int(guessed.sum())} vertices between profiles, or beyond their ends, are removed"
        out.append(Finding("surface.guessed", "note", text, _about(mesh.vertices[guessed])))
        mesh, left = _without(mesh, guessed)
        doubted = doubted[left]
    return _unmeasured(mesh, doubted) if doubted.any() else mesh, out


def _unmeasured(mesh: Mesh, which: Bools) -> Mesh:
    """The mesh with vertices (v,), and the faces at them, as not measured."""
    p = mesh.provenance
    if p is not None:
        laser, step, line = (np.where(which, -1, k) for k in (p.laser, p.step, p.line))
        p = Provenance(np.where(which, np.nan, p.sigma), laser, step, line, p.lasers)
    return replace(mesh, provenance=p, measured=measured(mesh) & ~which[mesh.faces].any(axis=1))


def _about(X: Floats) -> str:
    x, y, z = np.median(X, axis=0)
    return f"about ({x:.0f}, {y:.0f}, {z:.0f}) mm"


def _without(mesh: Mesh, which: Bools) -> tuple[Mesh, Bools]:
    """The mesh without the faces at vertices (v,), and which of its vertices are left."""
    keep = np.asarray(~which[mesh.faces].any(axis=1))
    used = np.zeros(len(which), dtype=np.bool_)
    used[mesh.faces[keep]] = True
    return submesh(mesh, keep), used


def _steps(grids: Sequence[RangeGrid]) -> int:
    """Cells round the turn: as many as the usual step of the finest grid makes."""
    usual = min(float(np.median(np.abs(np.diff(np.unwrap(g.angles))))) for g in grids)
    return max(8, round(2 * np.pi / max(usual, 1e-4)))

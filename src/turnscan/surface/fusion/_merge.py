"""Merge: the surfaces of several lasers, passes or scans → one, and where they disagree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import submesh
from turnscan.points import Along, RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.surface._grid_mesh import TearLimits
from turnscan.surface.decimation import dissolve
from turnscan.surface.fusion._carve import carved
from turnscan.surface.fusion._combine import paste
from turnscan.surface.fusion._overlap import apart_findings, overlap_findings, overlaps
from turnscan.surface.fusion._polar import merge_polar, polar_grid
from turnscan.surface.fusion._range_surface import (
    RangeSurface,
    range_surfaces,
    rise,
    spacing,
    usual_sigma,
)
from turnscan.surface.fusion._seat import seated
from turnscan.surface.fusion._tsdf import fuse
from turnscan.surface.fusion._witness import witnessed

MergeMethod = Literal["auto", "grid", "tsdf", "paste"]
_SEAM = 3
"""Voxels, of the size of the usual spacing, by which a surface may end before it meets the next:
one point is cleaned away at the edge, up to one spacing is left before it, and a cube needs all
its corners."""


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
    ``tsdf``. ``sewn``: the narrow gaps that ``tsdf`` leaves between surfaces are closed by faces
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
    if turns and how != "tsdf":
        cells = polar_grid(surfaces, _steps(there), rise(surfaces))
        why = f"{cells.several:.1%} of the cells have several radii, {cells.flat:.0%} is level"
        if how == "grid" or cells.fits:
            mesh, off = merge_polar(cells, surfaces, t, along)
            text = f"{len(there)} grids merged in angle and height ({why}); {off} cells disagreed"
            return mesh, [
                *findings,
                _merged_by(text, "tsdf|paste"),
            ]
    else:
        why = "asked for" if how == "tsdf" else "the scans have no common axis"
    size = spacing(surfaces) if voxel is None else voxel
    ramp = min(max(2.5 * size, 3 * sigma), 6 * size)
    text = f"{len(there)} grids merged in voxels of {size:.3g} mm, ramp {ramp:.3g} mm ({why})"
    if along is not None:
        text += "; the spacing along profiles has no effect"
    findings.append(_merged_by(text, "grid|paste"))
    most = max(size, 3 * sigma)
    mesh = fuse(surfaces, size, ramp, _SEAM if sewn else 0, most)
    mesh, lost = _confirmed(mesh, surfaces, size, most)
    return mesh, [*findings, *lost]


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
    not go, as beyond the end of a profile, its faces go. What is confirmed from afar alone is known
    no better than that. Faces that close a seam are not measured, and need no witness.
    """
    told = witnessed(mesh, surfaces, voxel, most)
    good, guessed, loose = told.confirmed, told.guessed, told.loose
    p = mesh.provenance
    if p is not None:
        sigma = np.where(good & ~np.isnan(p.sigma), told.sigma, p.sigma)
        mesh = replace(mesh, provenance=replace(p, sigma=sigma))
    if mesh.measured is not None:
        made = np.zeros(len(mesh.vertices), dtype=np.bool_)
        made[mesh.faces[~mesh.measured]] = True
        good, guessed, loose = good | made, guessed & ~made, loose & ~made
    out = list[Finding]()
    if not good.all():
        text = f"{int((~good).sum())} vertices far from every measured surface are removed"
        out.append(Finding("surface.unmeasured", "note", text, _about(mesh.vertices[~good])))
        mesh, left = _without(mesh, ~good)
        guessed, loose = guessed[left], loose[left]
    if (guessed | loose).any():
        mesh, unseated = seated(mesh, guessed | loose, surfaces, voxel)
        mesh, guessed = dissolve(mesh, guessed & unseated)
    if guessed.any():
        text = f"{int(guessed.sum())} vertices between profiles, or beyond their ends, are removed"
        out.append(Finding("surface.guessed", "note", text, _about(mesh.vertices[guessed])))
        mesh, _ = _without(mesh, guessed)
    return mesh, out


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

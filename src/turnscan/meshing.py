"""Range grids → one mesh, edited, closed and decimated as asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from turnscan import edit, surface
from turnscan.arrays import Floats
from turnscan.edit import Entry
from turnscan.findings import Finding
from turnscan.memory import give_back
from turnscan.mesh import Mesh, cut_touching
from turnscan.points import RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.settings import Settings
from turnscan.shapes import Source
from turnscan.surface import clean, decimation, fusion, holes


class Meshed(NamedTuple):
    """The mesh of a scan, before and after its gaps were closed and it was decimated."""

    grids: list[RangeGrid]
    """Without the points that are known too badly."""
    opened: Mesh
    mesh: Mesh
    findings: list[Finding]
    cut: Floats
    """(k, 3) mm: vertices of the opened mesh that lost faces by hand."""
    lost: holes.LeftOut | None
    """Faces that were known too badly; None for none."""
    merged: Mesh
    """With its islands, before anything was edited."""


def to_mesh(
    grids: Sequence[RangeGrid],
    s: Settings,
    edits: Sequence[Entry] = (),
    progress: Progress = no_progress,
    rig: Rig | None = None,
    *,
    finish: bool = True,
) -> Meshed:
    """Grids → one sound mesh without islands, edited; the same closed and thinned as asked for.

    ``rig`` is the one that measured the grids; volumes are as uncertain as it is. All points make
    the surface; then what states more than ``s.largest_sigma`` is left out, in mesh and grids.
    ``progress`` hears of merging, closing and decimating. Without ``finish`` the mesh is neither
    closed nor decimated nor settled.
    """
    progress(0)
    give_back()
    sewn = s.caps is not None and s.caps.holes is not None
    merged, findings = fusion.merge(grids, s.tears, s.merge, s.voxel, along=s.along, sewn=sewn)
    give_back()
    certain, lost, uncertain = clean.part_uncertain(merged, s.largest_sigma)
    left_out = holes.LeftOut.of(merged, lost) if len(lost.faces) else None
    sure, points = _certain(grids, s.largest_sigma)
    loose, touching = cut_touching(certain)
    mesh, islands, faces = clean.drop_islands(loose, s.island, grids, s.tears)
    if islands:
        touching += clean.long_islands(loose, s.island, grids, s.tears)
    opened, repairing, cut = edit.repair_mesh(mesh, edits, lambda: source_of(sure, rig, loose))
    mesh, closing = opened, list[Finding]()
    if finish:
        mesh, closing = finished(mesh, s, progress.subrange(0.4, 1))
    whole = clean.settled(mesh)
    give_back()
    if finish and mesh is opened:  # nothing was closed or decimated: there is one mesh
        opened = whole
    closed = finish and s.caps is not None
    some = left_out is not None
    remarks = surface.mesh_findings(whole, islands, faces, closed=closed, left_out=some)
    if closed:
        remarks += Source(tuple(sure), surface=loose).findings(whole)
    said = findings + points + uncertain + touching + repairing + closing + remarks
    return Meshed(sure, opened, whole if finish else opened, said, cut, left_out, loose)


def _certain(
    grids: Sequence[RangeGrid], limit: float | None
) -> tuple[list[RangeGrid], list[Finding]]:
    """Grids without the points that state a larger uncertainty, mm, and what went."""
    each = [clean.drop_uncertain(grid, limit) for grid in grids]
    return [grid for grid, _ in each], [f for _, said in each for f in said]


def finished(
    mesh: Mesh, s: Settings, progress: Progress = no_progress
) -> tuple[Mesh, list[Finding]]:
    """An edited mesh, closed and decimated as asked for; ``progress`` gets the fraction done."""
    findings = list[Finding]()
    if s.caps is not None:
        mesh, findings = holes.close(mesh, s.caps, progress.subrange(0, 1 / 3))
    if s.tolerance is not None or s.faces is not None:
        dense, thinning = mesh, progress.subrange(1 / 3, 1)
        mesh = decimation.decimate(dense, tolerance=s.tolerance, faces=s.faces, progress=thinning)
        findings += decimation.decimation_findings(
            dense, mesh, tolerance=s.tolerance, faces=s.faces
        )
    return mesh, findings


def source_of(grids: Sequence[RangeGrid], rig: Rig | None, surface: Mesh | None = None) -> Source:
    """What the uncertainty of a volume hangs on: the grids a mesh was made from, their rig, and the
    ``surface`` that they were merged to.

    Grids that do not know where their camera stood were pasted, not merged.
    """
    there = [g for g in grids if g.found.any() and g.eyes is not None]
    merged = there if len(there) > 1 else []
    profiles = [r for g in merged for r in fusion.range_surfaces(g)]
    return Source(tuple(grids), rig, tuple(profiles), surface=surface)

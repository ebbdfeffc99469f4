"""What a person should know about a mesh."""

from __future__ import annotations

import numpy as np

from turnscan.findings import Finding, Severity
from turnscan.surface._mesh import Mesh
from turnscan.surface._topology import boundary_loops, is_closed


def mesh_findings(mesh: Mesh, islands: int, island_faces: int, gaps: int | None) -> list[Finding]:
    """Findings on a finished mesh: islands taken away, gaps left or closed (None: not asked)."""
    out = []
    if islands:
        text = f"{islands} loose pieces with {island_faces} faces in all were taken away"
        out.append(Finding("surface.islands", "note", text, "", "keep them with --island 0"))
    if not len(mesh.faces):
        remedy = "finer steps, or a looser working volume"
        return [*out, Finding("surface.none", "error", "no face could be made", "", remedy)]
    if gaps is not None and mesh.measured is not None:
        t = mesh.triangles
        size = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
        share = float(size[~mesh.measured].sum() / size.sum())
        text = f"{gaps} gaps closed; {share:.1%} of the surface was not measured"
        severity: Severity = "warning" if share > 0.25 else "note"
        out.append(Finding("surface.caps", severity, text))
    if not is_closed(mesh):
        loops = boundary_loops(mesh)
        longest = len(loops[0]) if loops else 0
        text = f"the surface has {len(loops)} open borders, the longest of {longest} sides"
        remedy = "" if gaps is not None else "close them with --close"
        out.append(Finding("surface.open", "note", text, "", remedy))
    return out

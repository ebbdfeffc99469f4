"""What a person should know about a mesh."""

from __future__ import annotations

from turnscan.findings import Finding
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._soundness import soundness
from turnscan.mesh._topology import boundary_loops, is_closed
from turnscan.remedy import Option, Remedy


def mesh_findings(
    mesh: Mesh, islands: int, island_faces: int, *, closed: bool = False, left_out: bool = False
) -> list[Finding]:
    """Findings on a finished mesh: islands removed, what is not sound, borders left open; or why it
    has no face, where faces were ``left_out`` as too uncertain, too."""
    out = []
    if islands:
        text = f"{islands} loose pieces with {island_faces} faces in all were removed"
        keep = Remedy("keep them with ", Option("island", 0))
        out.append(Finding("surface.islands", "note", text, "", keep))
    if left_out and not len(mesh.faces):
        text = "no face is left that states so small an uncertainty"
        more = Remedy("give a larger ", Option("largest_sigma"))
        return [*out, Finding("surface.none", "error", text, "", more)]
    if not len(mesh.faces):
        finer = "finer steps, or a looser working volume"
        return [*out, Finding("surface.none", "error", "no face could be formed", "", finer)]
    out += soundness(mesh)
    if not is_closed(mesh):
        loops = boundary_loops(mesh)
        longest = len(loops[0]) if loops else 0
        text = f"the surface has {len(loops)} boundaries, the longest of {longest} edges"
        remedy = "" if closed else Remedy("close them with ", Option("close"))
        out.append(Finding("surface.open", "note", text, "", remedy))
    return out

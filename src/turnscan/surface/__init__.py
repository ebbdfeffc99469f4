"""RangeGrid(s) → Mesh: tears, seam, joining of lasers, islands, caps."""

from turnscan.surface._close import Caps, boundary_loops, close, is_closed, split_touching
from turnscan.surface._findings import mesh_findings
from turnscan.surface._grid_mesh import Tears, mesh_grid, submesh, vertex_normals
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._paste import components, drop_islands, join, join_range_scans, paste

__all__ = [
    "Caps",
    "Mesh",
    "Provenance",
    "Tears",
    "boundary_loops",
    "close",
    "components",
    "drop_islands",
    "is_closed",
    "join",
    "join_range_scans",
    "mesh_findings",
    "mesh_grid",
    "paste",
    "split_touching",
    "submesh",
    "vertex_normals",
]

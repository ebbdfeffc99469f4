"""RangeGrid(s) → Mesh: tears, seam, joining of lasers, islands, caps."""

from turnscan.surface._cast import Caster
from turnscan.surface._clean import Clean, clean
from turnscan.surface._close import Caps, close
from turnscan.surface._findings import mesh_findings
from turnscan.surface._grid_mesh import Tears, mesh_grid, submesh, vertex_normals
from turnscan.surface._holes import CAUSE_WORDS, Cause, Hole, holes
from turnscan.surface._merge import How, Overlap, merge, overlaps
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._paste import components, drop_islands, join, paste
from turnscan.surface._range_surface import RangeSurface, range_surfaces
from turnscan.surface._topology import boundary_loops, is_closed, split_touching
from turnscan.surface._tsdf import fuse

__all__ = [
    "CAUSE_WORDS",
    "Caps",
    "Caster",
    "Cause",
    "Clean",
    "Hole",
    "How",
    "Mesh",
    "Overlap",
    "Provenance",
    "RangeSurface",
    "Tears",
    "boundary_loops",
    "clean",
    "close",
    "components",
    "drop_islands",
    "fuse",
    "holes",
    "is_closed",
    "join",
    "merge",
    "mesh_findings",
    "mesh_grid",
    "overlaps",
    "paste",
    "range_surfaces",
    "split_touching",
    "submesh",
    "vertex_normals",
]

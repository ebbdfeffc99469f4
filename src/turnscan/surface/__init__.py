"""RangeGrid(s) → Mesh: tears, seam, joining of lasers, islands, caps."""

from turnscan.surface._bridge import bridge
from turnscan.surface._cast import Caster
from turnscan.surface._causes import explain
from turnscan.surface._clean import Clean, clean
from turnscan.surface._close import Bottom, Caps, Top, close, closings
from turnscan.surface._cut import Clip, Section, clip, cut, sections
from turnscan.surface._decimate import decimate, decimation_findings
from turnscan.surface._denoise import denoise
from turnscan.surface._despike import despike
from turnscan.surface._fill import FillHow, fill
from turnscan.surface._findings import mesh_findings
from turnscan.surface._grid_mesh import Tears, half_edges, mesh_grid, submesh, thin, vertex_normals
from turnscan.surface._holes import CAUSE_WORDS, Cause, Hole, holes
from turnscan.surface._merge import How, merge
from turnscan.surface._mesh import Mesh, Provenance
from turnscan.surface._overlap import Overlap, overlaps
from turnscan.surface._paste import (
    components,
    drop_islands,
    join,
    long_islands,
    measured_vertices,
    paste,
)
from turnscan.surface._range_surface import RangeSurface, range_surfaces, steady_normals
from turnscan.surface._settle import settled
from turnscan.surface._smooth import smooth, spikes
from turnscan.surface._sought import Sought
from turnscan.surface._sound_fill import Filled, fill_soundly, unfilled
from turnscan.surface._soundness import crossings, soundness
from turnscan.surface._told import Told, part, silent
from turnscan.surface._topology import boundary_loops, cut_touching, fans_about, is_closed, twins
from turnscan.surface._tsdf import fuse
from turnscan.surface._zip import longest_sides

__all__ = [
    "CAUSE_WORDS",
    "Bottom",
    "Caps",
    "Caster",
    "Cause",
    "Clean",
    "Clip",
    "FillHow",
    "Filled",
    "Hole",
    "How",
    "Mesh",
    "Overlap",
    "Provenance",
    "RangeSurface",
    "Section",
    "Sought",
    "Tears",
    "Told",
    "Top",
    "boundary_loops",
    "bridge",
    "clean",
    "clip",
    "close",
    "closings",
    "components",
    "crossings",
    "cut",
    "cut_touching",
    "decimate",
    "decimation_findings",
    "denoise",
    "despike",
    "drop_islands",
    "explain",
    "fans_about",
    "fill",
    "fill_soundly",
    "fuse",
    "half_edges",
    "holes",
    "is_closed",
    "join",
    "long_islands",
    "longest_sides",
    "measured_vertices",
    "merge",
    "mesh_findings",
    "mesh_grid",
    "overlaps",
    "part",
    "paste",
    "range_surfaces",
    "sections",
    "settled",
    "silent",
    "smooth",
    "soundness",
    "spikes",
    "steady_normals",
    "submesh",
    "thin",
    "twins",
    "unfilled",
    "vertex_normals",
]

"""Mesh, topology, normals, rays, sections, soundness: what any mesh program has."""

from turnscan.mesh._cut import clip, cut, sections
from turnscan.mesh._mesh import Mesh, Provenance, vector_areas
from turnscan.mesh._normals import smoothed_normals, vertex_normals
from turnscan.mesh._parts import (
    components,
    join,
    longest_sides,
    measured,
    measured_vertices,
    submesh,
)
from turnscan.mesh._point_cloud import PointCloud
from turnscan.mesh._rays import Caster
from turnscan.mesh._samples import sample_surface
from turnscan.mesh._soundness import crossings, soundness
from turnscan.mesh._topology import (
    boundary_loops,
    cut_touching,
    faces_about,
    half_edges,
    is_closed,
    opposite_half_edges,
    vertex_fans,
)

__all__ = [
    "Caster",
    "Mesh",
    "PointCloud",
    "Provenance",
    "boundary_loops",
    "clip",
    "components",
    "crossings",
    "cut",
    "cut_touching",
    "faces_about",
    "half_edges",
    "is_closed",
    "join",
    "longest_sides",
    "measured",
    "measured_vertices",
    "opposite_half_edges",
    "sample_surface",
    "sections",
    "smoothed_normals",
    "soundness",
    "submesh",
    "vector_areas",
    "vertex_fans",
    "vertex_normals",
]

"""Planes, spheres, cylinders, cones and tori in a mesh, with uncertainty and relations."""

from turnscan.shapes.primitives._budget import fit_whole
from turnscan.shapes.primitives._caps import filled_planes
from turnscan.shapes.primitives._edges import Edge, EdgeForm, find_edges, normals_and_distances
from turnscan.shapes.primitives._find import find_shapes
from turnscan.shapes.primitives._form_errors import FormError, FormKind, form_errors
from turnscan.shapes.primitives._orientation import orientation_errors
from turnscan.shapes.primitives._shapes import Kind, Relation, RelationKind, Shape, ShapeSet
from turnscan.shapes.primitives._sharpened import Sharpened, sharpened
from turnscan.shapes.primitives._sizes import ShapeSize, neighbours_of, sizes_between
from turnscan.shapes.primitives._volume import shapes_volume_sigma, volume_slopes

__all__ = [
    "Edge",
    "EdgeForm",
    "FormError",
    "FormKind",
    "Kind",
    "Relation",
    "RelationKind",
    "Shape",
    "ShapeSet",
    "ShapeSize",
    "Sharpened",
    "filled_planes",
    "find_edges",
    "find_shapes",
    "fit_whole",
    "form_errors",
    "neighbours_of",
    "normals_and_distances",
    "orientation_errors",
    "shapes_volume_sigma",
    "sharpened",
    "sizes_between",
    "volume_slopes",
]

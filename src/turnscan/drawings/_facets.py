"""The faces of a shape of OpenCASCADE as triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Ints
from turnscan.drawings._parts import parts_of
from turnscan.drawings._step_shapes import shape_of
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import Shape

_ANGLE = 0.2
"""Radians between the facets of a curved face, at the most."""


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles of faces."""

    mesh: Mesh
    """mm; faces that share edges hang together."""
    face: Ints
    """(f,) number of the face that a triangle is of, in the order of `surfaces`."""
    surfaces: Sequence[Shape | None]
    """Of each face that has triangles; None for a freeform one."""
    order: Sequence[int]
    """Which face of the shape each of them is."""
    lost: int
    """Faces that OpenCASCADE could not turn into triangles."""


def facets_of(shape: Any, deflection: float) -> Facets:
    """The faces of a shape as triangles within ``deflection`` mm of them."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    BRepMesh_IncrementalMesh(shape, deflection, False, _ANGLE)
    points, faces, owner, count = list[np.ndarray](), list[np.ndarray](), list[np.ndarray](), 0
    surfaces, order, lost = list[Shape | None](), list[int](), 0
    for number, face in enumerate(map(TopoDS.Face, parts_of(shape, "face"))):
        place = TopLoc_Location()
        body = BRep_Tool.Triangulation_s(face, place)
        if body is None or not body.NbTriangles():
            lost += 1
            continue
        move = place.Transformation()
        nodes = (body.Node(k + 1).Transformed(move) for k in range(body.NbNodes()))
        X = np.array([(p.X(), p.Y(), p.Z()) for p in nodes])
        corners = [body.Triangle(k + 1).Get() for k in range(body.NbTriangles())]
        some = np.array(corners, dtype=np.int64) - 1
        some = some[:, ::-1] if face.Orientation() == TopAbs_REVERSED else some
        owner.append(np.full(len(some), len(surfaces), dtype=np.int32))
        surfaces.append(None if BRep_Tool.Surface_s(face) is None else shape_of(face, X[some]))
        order.append(number)
        points.append(X)
        faces.append(some + count)
        count += len(X)
    if not points:
        none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
        return Facets(none, np.zeros(0, np.int32), (), (), lost)
    X, corner = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    mesh = Mesh(X, corner.reshape(-1)[np.concatenate(faces)])
    return Facets(mesh, np.concatenate(owner), surfaces, order, lost)

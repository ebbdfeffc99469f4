"""What a shape of OpenCASCADE consists of, and its sizes."""

from __future__ import annotations

from typing import Any

import numpy as np

from turnscan.arrays import Floats

_VOLUME = 1e-6
"""Of a volume."""


def parts_of(shape: Any, kind: str) -> list[Any]:
    """The faces or solids of a shape of OpenCASCADE."""
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    out = []
    walk = TopExp_Explorer(shape, TopAbs_FACE if kind == "face" else TopAbs_SOLID)
    while walk.More():
        out.append(walk.Current())
        walk.Next()
    return out


def extent_of(shape: Any) -> float:
    """mm: diagonal of the box about a shape of OpenCASCADE."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    return 0.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))


def middle_and_size(face: Any) -> tuple[float, float, float, float]:
    """mm: the centre of mass of a face of OpenCASCADE, and the root of its area."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    p = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, p)
    c = p.CentreOfMass()
    return c.X(), c.Y(), c.Z(), float(np.sqrt(abs(p.Mass())))


def distance_to(face: Any, point: Floats) -> float:
    """mm from a point (3,) to a face of OpenCASCADE."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    return float(BRepExtrema_DistShapeShape(vertex, face).Value())


def volume_of(shape: Any) -> float:
    """mm³ that a shape of OpenCASCADE encloses, integrated until the error is below `_VOLUME`: what
    it does without that is wrong by some tenths of a per cent under trimmed B-splines."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    p = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, p, _VOLUME)
    return float(p.Mass())

"""STEP AP242 by OpenCASCADE: an analytic solid, or the triangles of a mesh."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Ints
from turnscan.drawings._parts import extent_of, parts_of, volume_of
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.drawings._step_shapes import merged, shape_of
from turnscan.errors import ExportError, FormatError
from turnscan.formats._text import about_lines
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import Shape

_NAME = "NAME"
_NAMED = rb"'NAME \d+','NAME \d+'"
"""OpenCASCADE counts the products of a process; the same part gives the same file."""
_ANGLE = 0.2
"""Radians between the facets of a curved face, at the most."""
_FINE = 2e-5
"""Of the part's size: how far facets may be off the faces, usually."""


@dataclass(frozen=True, eq=False)
class StepPart:
    """What a STEP file holds, as OpenCASCADE reads it."""

    solids: int
    valid: bool
    """Whether OpenCASCADE finds no fault in it."""
    volume: float
    """mm³."""
    mesh: Mesh
    """Its faces as triangles, mm; they hang together where the faces share edges."""
    shapes: tuple[Shape, ...]
    """The planes, cylinders, spheres, cones and tori of its faces; those of one surface are one."""
    label: Ints
    """(f,) index of the shape that a triangle of ``mesh`` belongs to; −1 for freeform faces."""
    lost: int = 0
    """Faces that OpenCASCADE could not turn into triangles: ``mesh`` lacks them."""


def write_step(what: Solid | Mesh, name: str, about: Mapping[str, object]) -> bytes:
    """A STEP file (AP242, mm) of an analytic solid, or of a mesh as tessellated geometry.

    ``name`` is that of the product; ``about`` says where it comes from and stands in a comment in
    front of the header, where `read_about` finds it. There is no date in it. Raises InputError
    where OpenCASCADE is not installed, ExportError where it refuses.
    """
    check_opencascade()
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
    from OCP.TCollection import TCollection_HAsciiString

    _silence()
    writer = STEPControl_Writer()
    for key, value in (
        ("write.step.schema", "AP242DIS"),
        ("write.step.unit", "MM"),
        ("write.step.product.name", _NAME),
        ("write.step.tessellated", "On"),
    ):
        Interface_Static.SetCVal_s(key, value)
    shape = what.shape if isinstance(what, Solid) else _tessellated(what)
    if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
        raise ExportError("OpenCASCADE could not turn the part into STEP")
    text = TCollection_HAsciiString
    header = APIHeaderSection_MakeHeader(writer.Model())
    header.SetName(text(_NAME))
    header.SetTimeStamp(text(""))
    header.SetAuthorValue(1, text(""))
    header.SetOrganizationValue(1, text(""))
    header.SetOriginatingSystem(text(str(about.get("software", "turnscan"))))
    kind = "analytic solid" if isinstance(what, Solid) else "triangles"
    header.SetDescriptionValue(1, text(kind))
    out = io.BytesIO()
    if writer.WriteStream(out) != IFSelect_RetDone:
        raise ExportError("OpenCASCADE could not write STEP")
    first, rest = out.getvalue().split(b"\n", 1)
    rest = rest.replace(b"FILE_NAME('%b'" % _NAME.encode(), b"FILE_NAME('%b'" % _text(name), 1)
    rest = re.sub(_NAMED, lambda _: b"'%b','%b'" % (2 * (_text(name),)), rest, count=1)
    lines = [line.replace("*/", "*\\/") for line in about_lines(about)]  # JSON knows it as */ too
    return b"\n".join([first, b"/*", *(line.encode("ascii") for line in lines), b"*/", rest])


def read_step(data: bytes, deflection: float | None = None) -> StepPart:
    """What a STEP file holds; curved faces become facets within ``deflection`` mm of them.

    None takes 1/50000 of its size. Lengths are mm, whatever the unit of the file.

    Raises InputError where OpenCASCADE is not installed, FormatError where it cannot read the file.
    """
    check_opencascade()
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader

    _silence()
    reader = STEPControl_Reader()
    if reader.ReadStream("part.step", io.BytesIO(data)) != IFSelect_RetDone:
        raise FormatError("OpenCASCADE cannot read this STEP file", hint="export it again")
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape.IsNull():
        raise FormatError("the STEP file holds no shape", hint="export it again")
    solids = parts_of(shape, "solid")
    valid = bool(BRepCheck_Analyzer(shape).IsValid())
    volume = volume_of(shape)
    if deflection is None:
        deflection = max(_FINE * extent_of(shape), 1e-9)
    BRepMesh_IncrementalMesh(shape, deflection, False, _ANGLE)
    mesh, shapes, label, lost = _facets(shape)
    return StepPart(len(solids), valid, volume, mesh, shapes, label, lost)


def _text(words: str) -> bytes:
    """A text as ISO 10303-21 (6.4.3) has it between its quotes."""
    plain = words.replace("\\", "\\\\").replace("'", "''")
    return "".join(
        c if c.isascii() and c.isprintable() else f"\\X4\\{ord(c):08X}\\X0\\" for c in plain
    ).encode("ascii")


def _silence() -> None:
    """Turn off what OpenCASCADE prints while it works."""
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()


def _tessellated(mesh: Mesh) -> Any:
    """A face that has triangles and no surface."""
    from OCP.BRep import BRep_Builder
    from OCP.gp import gp_Pnt
    from OCP.Poly import Poly_Triangle, Poly_Triangulation
    from OCP.TopoDS import TopoDS_Face

    body = Poly_Triangulation(len(mesh.vertices), len(mesh.faces), False)
    for k, (x, y, z) in enumerate(mesh.vertices.tolist()):
        body.SetNode(k + 1, gp_Pnt(x, y, z))
    for k, (a, b, c) in enumerate((mesh.faces + np.int32(1)).tolist()):
        body.SetTriangle(k + 1, Poly_Triangle(a, b, c))
    face = TopoDS_Face()
    BRep_Builder().MakeFace(face, body)
    return face


def _facets(shape: Any) -> tuple[Mesh, tuple[Shape, ...], Ints, int]:
    """The triangles that a shape's faces have, the analytic surfaces, whose each one is, and how
    many faces have no triangles."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    points, faces, owner, count = list[np.ndarray](), list[np.ndarray](), list[np.ndarray](), 0
    surfaces, lost = list[Shape | None](), 0
    for face in map(TopoDS.Face, parts_of(shape, "face")):
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
        owner.append(np.full(len(some), len(surfaces)))
        surfaces.append(None if BRep_Tool.Surface_s(face) is None else shape_of(face, X[some]))
        points.append(X)
        faces.append(some + count)
        count += len(X)
    if not points:
        none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
        return none, (), np.zeros(0, np.int32), lost
    shapes, number = merged(surfaces)
    label = number[np.concatenate(owner)]
    X, corner = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return Mesh(X, corner.reshape(-1)[np.concatenate(faces)]), shapes, label, lost

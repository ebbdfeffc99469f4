"""STEP AP242 by OpenCASCADE: faces with colours, or the triangles of a mesh."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Ints
from turnscan.drawings._document import document_of, silence, tessellated
from turnscan.drawings._facets import facets_of
from turnscan.drawings._parts import (
    distance_to,
    extent_of,
    middle_and_size,
    parts_of,
    volume_of,
)
from turnscan.drawings._solid import Solid, check_opencascade
from turnscan.drawings._step_shapes import merged
from turnscan.errors import ExportError, FormatError
from turnscan.formats._text import about_lines
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import Shape

_NAME = "NAME"
"""Stands for the name until the file is written: OpenCASCADE writes other letters its own way."""
_SAME = 1e-8
"""Of the part's size, up to which middle and size of a face that is read back are those made."""
_FINE = 2e-5
"""Of the part's size: how far facets may be off the faces, usually."""


@dataclass(frozen=True, eq=False)
class StepBodies:
    """The solids that a STEP file holds, as OpenCASCADE reads it."""

    solids: int
    valid: bool
    """Whether OpenCASCADE finds no fault in it."""
    volume: float
    """mm³."""

    @staticmethod
    def of(data: bytes) -> StepBodies:
        """Of a STEP file, without its faces.

        Raises InputError where OpenCASCADE is not installed, FormatError where it cannot read it.
        """
        return _bodies(_shape_in(data))


@dataclass(frozen=True, eq=False)
class StepPart(StepBodies):
    """What a STEP file holds, with its faces."""

    mesh: Mesh
    """Its faces as triangles, mm; they hang together where the faces share edges."""
    shapes: tuple[Shape, ...]
    """The planes, cylinders, spheres, cones and tori of its faces; those of one surface are one."""
    label: Ints
    """(f,) index of the shape that a triangle of ``mesh`` belongs to; −1 for freeform faces."""
    lost: int = 0
    """Faces that OpenCASCADE could not turn into triangles: ``mesh`` lacks them."""
    faces: int = 0
    """All of its faces."""


def write_step(what: Solid | Mesh, name: str, about: Mapping[str, object]) -> bytes:
    """A STEP file (AP242, mm) of faces with their colours, or of a mesh as tessellated geometry.

    ``name`` is that of the product; ``about`` says where it comes from and stands in a comment in
    front of the header, where `read_about` finds it. There is no date in it. Raises InputError
    where OpenCASCADE is not installed, ExportError where it refuses.
    """
    check_opencascade()
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.BRepTools import BRepTools
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.STEPControl import STEPControl_AsIs
    from OCP.TCollection import TCollection_HAsciiString

    silence()
    caf = STEPCAFControl_Writer()
    for key, value in (
        ("write.step.schema", "AP242DIS"),
        ("write.step.unit", "MM"),
        ("write.step.tessellated", "On"),
    ):
        Interface_Static.SetCVal_s(key, value)
    shape = what.whole if isinstance(what, Solid) else tessellated(what)
    # Facets of faces that have a surface would be written beside them, as a second solid.
    BRepTools.Clean_s(shape)
    document = document_of(shape, _NAME, what.colours if isinstance(what, Solid) else {})
    if not caf.Transfer(document, STEPControl_AsIs):
        raise ExportError("OpenCASCADE could not turn the part into STEP")
    writer, text = caf.ChangeWriter(), TCollection_HAsciiString
    header = APIHeaderSection_MakeHeader(writer.Model())
    header.SetName(text(_NAME))
    header.SetTimeStamp(text(""))
    header.SetAuthorValue(1, text(""))
    header.SetOrganizationValue(1, text(""))
    header.SetOriginatingSystem(text(str(about.get("software", "turnscan"))))
    header.SetDescriptionValue(1, text(what.kind if isinstance(what, Solid) else "triangles"))
    out = io.BytesIO()
    if writer.WriteStream(out) != IFSelect_RetDone:
        raise ExportError("OpenCASCADE could not write STEP")
    first, rest = out.getvalue().split(b"\n", 1)
    for place in (b"FILE_NAME('%b'", b"PRODUCT('%b','%b'"):
        slots = place.count(b"%b")
        rest = rest.replace(place % (slots * (_NAME.encode(),)), place % (slots * (_text(name),)))
    lines = [line.replace("*/", "*\\/") for line in about_lines(about)]  # JSON knows it as */ too
    return b"\n".join([first, b"/*", *(line.encode("ascii") for line in lines), b"*/", rest])


def _bodies(shape: Any) -> StepBodies:
    return StepBodies(len(parts_of(shape, "solid")), _is_valid(shape), volume_of(shape))


def read_step(data: bytes, deflection: float | None = None) -> StepPart:
    """What a STEP file holds; curved faces become facets within ``deflection`` mm of them.

    None takes 1/50000 of its size. Lengths are mm, whatever the unit of the file.

    Raises InputError where OpenCASCADE is not installed, FormatError where it cannot read the file.
    """
    shape = _shape_in(data)
    what = _bodies(shape)
    if deflection is None:
        deflection = max(_FINE * extent_of(shape), 1e-9)
    facets = facets_of(shape, deflection)
    shapes, number = merged(facets.surfaces)
    return StepPart(
        what.solids, what.valid, what.volume, facets.mesh, shapes, number[facets.face],
        facets.lost, len(parts_of(shape, "face")),
    )  # fmt: skip


def faults_in_file(solid: Solid) -> tuple[int, ...]:
    """The faces of a solid, by their number, that have faults when its STEP file is read back.

    A reader takes the tolerance of an edge from both its faces, so a face may be sound alone and
    not beside its neighbours. One that it parts into several, or leaves out, has faults, too.
    """
    from OCP.BRepCheck import BRepCheck_Analyzer

    shape = _shape_in(write_step(solid, _NAME, {}))
    faces = parts_of(shape, "face")
    whole = BRepCheck_Analyzer(shape)
    bad = tuple(
        k for k, f in enumerate(faces) if not (whole.IsValid(f) and BRepCheck_Analyzer(f).IsValid())
    )
    if len(faces) == solid.faces:
        return bad
    return _parted(parts_of(solid.shape, "face"), faces, bad)


def _parted(made: Sequence[Any], read: Sequence[Any], bad: Sequence[int]) -> tuple[int, ...]:
    """The faces, by their number, that were ``made`` and are not all of what was ``read``, or that
    are ``bad`` there.

    A reader that parts one gives all back in another order: they are known by middle and area.
    """
    from scipy.spatial import cKDTree

    was, now = (np.array([middle_and_size(face) for face in some]) for some in (made, read))
    off, partner = (np.asarray(found) for found in cKDTree(now).query(was))
    owner = np.asarray(cKDTree(was).query(now)[1])
    kept = owner[partner] == np.arange(len(made))
    out = {*np.flatnonzero(~kept).tolist(), *owner[list(bad)].tolist()}
    other = np.flatnonzero(off > _SAME * np.ptp(was, axis=0).max())
    for k in np.setdiff1d(np.arange(len(read)), partner[kept]):
        if len(other):
            gaps = [distance_to(made[int(i)], now[k, :3]) for i in other]
            out.add(int(other[np.argmin(gaps)]))
    return tuple(sorted(out))


def _shape_in(data: bytes) -> Any:
    check_opencascade()
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader

    silence()
    reader = STEPControl_Reader()
    if reader.ReadStream("part.step", io.BytesIO(data)) != IFSelect_RetDone:
        raise FormatError("OpenCASCADE cannot read this STEP file", hint="export it again")
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape.IsNull():
        raise FormatError("the STEP file holds no shape", hint="export it again")
    return shape


def _is_valid(shape: Any) -> bool:
    """Whether OpenCASCADE finds no fault; bare triangles, which it takes for one, are none."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopoDS import TopoDS

    faces = [TopoDS.Face(f) for f in parts_of(shape, "face")]
    real = [f for f in faces if BRep_Tool.Surface_s(f) is not None]
    checked = [shape] if len(real) == len(faces) else real
    return all(BRepCheck_Analyzer(s).IsValid() for s in checked)


def _text(words: str) -> bytes:
    """A text as ISO 10303-21 (6.4.3) has it between its quotes."""
    plain = words.replace("\\", "\\\\").replace("'", "''")
    return "".join(
        c if c.isascii() and c.isprintable() else f"\\X4\\{ord(c):08X}\\X0\\" for c in plain
    ).encode("ascii")

"""IGES 5.3 by OpenCASCADE, for programs that read no STEP: a solid or shell."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

from turnscan.drawings._document import Colour, document_of, silence
from turnscan.drawings._parts import parts_of, volume_of
from turnscan.errors import ExportError

_DAY = "20000101.000000"
"""A file does not depend on the clock."""
_ALIKE = 1e-3
"""Of the volume: edges lie within a tolerance of their faces, and readers place them again."""
_SOLIDS = 1
"""OpenCASCADE's mode in which solids stay solids (entity 186)."""


def iges_of(shape: Any, name: str, colours: Mapping[int, Colour]) -> bytes:
    """A solid or shell of OpenCASCADE as IGES, mm; ``name`` is that of the product, ``colours``
    those of its faces by their number.

    Raises ExportError where OpenCASCADE refuses.
    """
    from OCP.IGESCAFControl import IGESCAFControl_Writer
    from OCP.IGESControl import IGESControl_Controller
    from OCP.Interface import Interface_Static
    from OCP.TCollection import TCollection_HAsciiString

    silence()
    IGESControl_Controller.Init_s()
    Interface_Static.SetCVal_s("write.iges.unit", "MM")
    Interface_Static.SetIVal_s("write.iges.brep.mode", _SOLIDS)
    writer = IGESCAFControl_Writer()
    plain = name.encode("ascii", "replace").decode("ascii")
    if not writer.Transfer(document_of(shape, plain, colours)):
        raise ExportError("OpenCASCADE could not turn the part into IGES")
    writer.ComputeModel()
    model = writer.Model()
    head, text = model.GlobalSection(), TCollection_HAsciiString
    for put, value in (
        (head.SetDate, _DAY), (head.SetLastChangeDate, _DAY), (head.SetSendName, plain),
        (head.SetFileName, f"{plain}.igs"), (head.SetSystemId, "turnscan"),
        (head.SetAuthorName, ""), (head.SetCompanyName, ""),
    ):  # fmt: skip
        put(text(value))
    model.SetGlobalSection(head)
    out = io.BytesIO()
    if not writer.Write(out):
        raise ExportError("OpenCASCADE could not write IGES")
    return out.getvalue()


def reads_as(path: str, shape: Any, solids: int) -> bool:
    """Whether an IGES file holds as many solids of the same volume, or the faces of the same shell,
    valid; OpenCASCADE reads it from files alone."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader

    reader = IGESControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        return False
    reader.TransferRoots()
    back = reader.OneShape()
    if back.IsNull() or len(parts_of(back, "face")) != len(parts_of(shape, "face")):
        return False
    if not BRepCheck_Analyzer(back).IsValid():
        return False
    if not solids:
        return True
    alike = abs(volume_of(back) / volume_of(shape) - 1) <= _ALIKE
    return len(parts_of(back, "solid")) == solids and alike

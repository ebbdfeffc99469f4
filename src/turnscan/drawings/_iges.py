"""IGES 5.3 by OpenCASCADE, for programs that read no STEP: an analytic solid."""

from __future__ import annotations

import io
from typing import Any

from turnscan.drawings._parts import parts_of, volume_of
from turnscan.errors import ExportError

_DAY = "20000101.000000"
"""A file does not depend on the clock."""
_EXACT = 1e-6
_SOLIDS = 1
"""OpenCASCADE's mode in which solids stay solids (entity 186)."""


def iges_of(shape: Any, name: str) -> bytes:
    """A solid of OpenCASCADE as IGES, mm; ``name`` is that of the product.

    Raises ExportError where OpenCASCADE refuses.
    """
    from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
    from OCP.Message import Message
    from OCP.TCollection import TCollection_HAsciiString

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    IGESControl_Controller.Init_s()
    writer = IGESControl_Writer("MM", _SOLIDS)
    if not writer.AddShape(shape):
        raise ExportError("OpenCASCADE could not turn the part into IGES")
    writer.ComputeModel()
    model = writer.Model()
    head, text = model.GlobalSection(), TCollection_HAsciiString
    plain = name.encode("ascii", "replace").decode("ascii")
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


def reads_as(path: str, shape: Any) -> bool:
    """Whether an IGES file holds the same solid, valid; OpenCASCADE reads it from files alone."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader

    reader = IGESControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        return False
    reader.TransferRoots()
    back = reader.OneShape()
    if back.IsNull() or len(parts_of(back, "solid")) != 1:
        return False
    valid = bool(BRepCheck_Analyzer(back).IsValid())
    return valid and abs(volume_of(back) / volume_of(shape) - 1) <= _EXACT

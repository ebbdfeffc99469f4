"""What STEP and IGES are written from: a named shape of OpenCASCADE with a colour for each face."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from turnscan.drawings._parts import parts_of
from turnscan.mesh import Mesh

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255 (sRGB)."""


def document_of(shape: Any, name: str, colours: Mapping[int, Colour]) -> Any:
    """A document with one part; ``colours`` are those of its faces by their number."""
    from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFApp import XCAFApp_Application
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    text = TCollection_ExtendedString
    document = TDocStd_Document(text("XmlOcaf"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    main = document.Main()
    label = XCAFDoc_DocumentTool.ShapeTool_s(main).AddShape(shape, False)
    TDataStd_Name.Set_s(label, text(name))
    paints = XCAFDoc_DocumentTool.ColorTool_s(main)
    for k, face in enumerate(parts_of(shape, "face")):
        if k in colours:
            red, green, blue = (c / 255 for c in colours[k])
            paint = Quantity_Color(red, green, blue, Quantity_TOC_sRGB)
            paints.SetColor(face, paint, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return document


def tessellated(mesh: Mesh) -> Any:
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


def silence() -> None:
    """Turn off what OpenCASCADE prints while it works."""
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()

"""Bytes for CAD and print; every writer has a reader that audits it."""

from turnscan.formats._audit import audit
from turnscan.formats._dxf import write_dxf
from turnscan.formats._dxf_read import read_dxf, read_dxf_content
from turnscan.formats._formats import EXPORTERS, Exporter, export, exporter_for, read_mesh
from turnscan.formats._options import DxfForm, DxfVersion, ExportOptions, Profiles
from turnscan.formats._plain import texture_files
from turnscan.formats._ply import write_ply
from turnscan.formats._ply_read import read_range_ply
from turnscan.formats._stl import write_stl
from turnscan.formats._text import read_about

__all__ = [
    "EXPORTERS",
    "DxfForm",
    "DxfVersion",
    "ExportOptions",
    "Exporter",
    "Profiles",
    "audit",
    "export",
    "exporter_for",
    "read_about",
    "read_dxf",
    "read_dxf_content",
    "read_mesh",
    "read_range_ply",
    "texture_files",
    "write_dxf",
    "write_ply",
    "write_stl",
]

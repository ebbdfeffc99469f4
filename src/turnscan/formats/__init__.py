"""Bytes for CAD and print; every writer has a reader that audits it."""

from turnscan.formats._audit import audit
from turnscan.formats._dxf import write_dxf
from turnscan.formats._dxf_read import DxfContent, read_dxf, read_dxf_content
from turnscan.formats._formats import EXPORTERS, Exporter, export, exporter_for, read_mesh
from turnscan.formats._glb import write_glb
from turnscan.formats._glb_read import read_glb
from turnscan.formats._options import DxfForm, DxfVersion, ExportOptions, Profiles
from turnscan.formats._plain import read_obj, read_xyz, write_obj, write_xyz
from turnscan.formats._ply import write_ply
from turnscan.formats._ply_read import RangePly, read_ply, read_range_ply
from turnscan.formats._stl import read_stl, write_stl
from turnscan.formats._text import read_about
from turnscan.formats._threemf import read_3mf, write_3mf

__all__ = [
    "EXPORTERS",
    "DxfContent",
    "DxfForm",
    "DxfVersion",
    "ExportOptions",
    "Exporter",
    "Profiles",
    "RangePly",
    "audit",
    "export",
    "exporter_for",
    "read_3mf",
    "read_about",
    "read_dxf",
    "read_dxf_content",
    "read_glb",
    "read_mesh",
    "read_obj",
    "read_ply",
    "read_range_ply",
    "read_stl",
    "read_xyz",
    "write_3mf",
    "write_dxf",
    "write_glb",
    "write_obj",
    "write_ply",
    "write_stl",
    "write_xyz",
]

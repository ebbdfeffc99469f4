"""Bytes for CAD and print; every writer has a reader that audits it."""

from turnscan.export._dxf import write_dxf
from turnscan.export._options import DxfForm, DxfVersion, ExportOptions, Profiles
from turnscan.export._plain import write_obj, write_xyz
from turnscan.export._ply import write_ply
from turnscan.export._stl import write_stl

__all__ = [
    "DxfForm",
    "DxfVersion",
    "ExportOptions",
    "Profiles",
    "write_dxf",
    "write_obj",
    "write_ply",
    "write_stl",
    "write_xyz",
]

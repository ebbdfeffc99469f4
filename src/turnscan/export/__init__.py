"""Bytes for CAD and print; every writer has a reader that audits it."""

from turnscan.export._audit import audit
from turnscan.export._dimensions import with_sigma
from turnscan.export._dxf import write_dxf
from turnscan.export._dxf_read import DxfContent, read_dxf, read_dxf_content
from turnscan.export._formats import EXPORTERS, Exporter, export, exporter_for, read_mesh
from turnscan.export._glb import write_glb
from turnscan.export._glb_read import read_glb
from turnscan.export._options import DxfForm, DxfVersion, ExportOptions, Profiles
from turnscan.export._plain import read_obj, read_xyz, write_obj, write_xyz
from turnscan.export._ply import write_ply
from turnscan.export._ply_read import read_ply
from turnscan.export._section_dxf import write_section_dxf
from turnscan.export._section_json import section_report, write_section_json
from turnscan.export._section_svg import draw_section, write_section_pdf, write_section_svg
from turnscan.export._sheet import found
from turnscan.export._stl import read_stl, write_stl
from turnscan.export._text import read_about
from turnscan.export._threemf import read_3mf, write_3mf

__all__ = [
    "EXPORTERS",
    "DxfContent",
    "DxfForm",
    "DxfVersion",
    "ExportOptions",
    "Exporter",
    "Profiles",
    "audit",
    "draw_section",
    "export",
    "exporter_for",
    "found",
    "read_3mf",
    "read_about",
    "read_dxf",
    "read_dxf_content",
    "read_glb",
    "read_mesh",
    "read_obj",
    "read_ply",
    "read_stl",
    "read_xyz",
    "section_report",
    "with_sigma",
    "write_3mf",
    "write_dxf",
    "write_glb",
    "write_obj",
    "write_ply",
    "write_section_dxf",
    "write_section_json",
    "write_section_pdf",
    "write_section_svg",
    "write_stl",
    "write_xyz",
]

"""Drawings: sections as DXF, SVG, PDF and JSON with dimensions, and solids as STEP."""

from turnscan.drawings._dimensions import with_sigma
from turnscan.drawings._document import Colour
from turnscan.drawings._dxf import write_section_dxf
from turnscan.drawings._facets import Facets
from turnscan.drawings._json import section_report, write_section_json
from turnscan.drawings._revolved import revolved_solid
from turnscan.drawings._sheet import found
from turnscan.drawings._shell import Shell, ShellMaker
from turnscan.drawings._solid import ANALYTIC, Solid, check_opencascade, solid_of
from turnscan.drawings._step import StepPart, read_step, write_step
from turnscan.drawings._svg import draw_section, write_section_pdf, write_section_svg

__all__ = [
    "ANALYTIC",
    "Colour",
    "Facets",
    "Shell",
    "ShellMaker",
    "Solid",
    "StepPart",
    "check_opencascade",
    "draw_section",
    "found",
    "read_step",
    "revolved_solid",
    "section_report",
    "solid_of",
    "with_sigma",
    "write_section_dxf",
    "write_section_json",
    "write_section_pdf",
    "write_section_svg",
    "write_step",
]

"""Schemas of the verbs: what each takes and writes, as JSON Schema, for forms and reference pages.

They are made of the same option classes as the flags of the command line. A schema is an object
with one property for each value; besides the words of JSON Schema (draft 2020-12) a property has
``role`` (option, input or output), ``unit`` and ``group``, and that of an input has ``accepts``:
the kinds of files that it takes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from turnscan.workflows._options._calibrate import BoardOptions, CalibrateOptions
from turnscan.workflows._options._compare import MAP_SUFFIXES, CompareOptions
from turnscan.workflows._options._declare import Checked, Declared, declared
from turnscan.workflows._options._format import FormatOptions
from turnscan.workflows._options._import import ImportOptions, SeriesOptions
from turnscan.workflows._options._join import JoinOptions, RangeScanOptions
from turnscan.workflows._options._measure import MeasureOptions
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._options._revolve import REVOLVE_SUFFIXES, RevolveOptions
from turnscan.workflows._options._section import SectionOptions
from turnscan.workflows._options._shapes import SHAPES_SUFFIXES, ShapesOptions
from turnscan.workflows._options._units import DIMENSION_SUFFIXES, SECTION_SUFFIXES
from turnscan.workflows._options._verify import VerifyOptions

FileKind = Literal[
    "scan", "mesh", "pictures", "range-scan", "placement", "rig", "table", "artefact"
]
"""What a file can be to a verb: a scan file; a mesh; a folder, video or archive of pictures; a
range scan of another scanner; the .conf file that places such; a rig; a table or list of values
(CSV, JSON); the file of an artefact."""

MESH_SUFFIXES = (".dxf", ".stl", ".ply", ".obj", ".3mf", ".glb", ".xyz", ".step")
"""Of the files that a surface is written to."""
REPORT_SUFFIXES = (".html", ".json")
_SURFACE: tuple[FileKind, ...] = ("mesh", "scan")
_OF_PICTURES = (
    "strategy", "choose", "refine", "threshold", "spacing", "spacing_by", "spacing_between",
    "every", "radius", "z_min", "z_max", "top", "bottom", "denoise", "outliers",
    "largest_sigma",
)  # fmt: skip
"""Options about stripes, the table or the rig: range scans have none of these."""


@dataclass(frozen=True)
class InputFile:
    """Files that a verb reads."""

    name: str
    help: str
    accepts: tuple[FileKind, ...]
    many: bool = False
    required: bool = True


@dataclass(frozen=True)
class OutputFile:
    """Files that a verb writes, one for each suffix that is chosen."""

    name: str
    help: str
    suffixes: tuple[str, ...]
    required: bool = False
    usual: tuple[str, ...] = ()
    """Suffixes that are chosen by default."""


@dataclass(frozen=True)
class OptionsOf:
    """An option class of a verb, or those options of it that the verb has."""

    kind: type[Checked]
    without: tuple[str, ...] = ()
    only: tuple[str, ...] = ()

    @property
    def declared(self) -> dict[str, Declared]:
        """The options, by name."""
        return {
            name: option
            for name, option in declared(self.kind).items()
            if name not in self.without and (not self.only or name in self.only)
        }


@dataclass(frozen=True)
class Verb:
    """What a verb takes and what it writes."""

    name: str
    title: str
    help: str
    group: str
    inputs: tuple[InputFile, ...]
    options: tuple[OptionsOf, ...] = ()
    outputs: tuple[OutputFile, ...] = ()

    @property
    def declared(self) -> Iterator[tuple[str, Declared]]:
        """Every option, with its name."""
        for part in self.options:
            yield from part.declared.items()

    def json_schema(self) -> dict[str, Any]:
        """The schema of its values (JSON Schema draft 2020-12)."""
        made = {f.name: _input(f) for f in self.inputs}
        made |= {name: _option(option) for name, option in self.declared}
        made |= {f.name: _output(f) for f in self.outputs}
        required = [f.name for f in self.inputs if f.required]
        required += [f.name for f in self.outputs if f.required]
        required += [name for name, option in self.declared if option.required]
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": self.title,
            "description": self.help,
            "type": "object",
            "properties": made,
            "required": required,
            "additionalProperties": False,
        }


_TYPES = {
    "choice": "string", "number": "number", "count": "integer", "switch": "boolean",
    "text": "string",
}  # fmt: skip


def option_schemas(kind: type[Checked]) -> dict[str, dict[str, Any]]:
    """A schema for the value of each option of a class, by its name."""
    return {name: _option(option) for name, option in declared(kind).items()}


def _option(option: Declared) -> dict[str, Any]:
    one: dict[str, Any] = {"type": _TYPES[option.kind]}
    if option.kind == "choice":
        added = option.more() if option.more is not None else ()
        one["enum"] = [*option.choices, *added]
    if option.least is not None:
        one["exclusiveMinimum" if option.above else "minimum"] = option.least
    if option.most is not None:
        one["maximum"] = option.most
    if option.many:
        one = {"type": "array", "items": one}
    elif option.optional:
        one["type"] = [one["type"], "null"]
        if "enum" in one:
            one["enum"].append(None)
    about = {"role": "option", "description": option.help}
    if not option.required:
        default = option.default
        one["default"] = list(default) if isinstance(default, tuple) else default
    about |= {k: v for k, v in (("unit", option.unit), ("group", option.group)) if v}
    return one | about


def _input(file: InputFile) -> dict[str, Any]:
    one: dict[str, Any] = {"type": "string"}
    if file.many:
        one = {"type": "array", "items": one} | ({"minItems": 1} if file.required else {})
    return one | {"role": "input", "description": file.help, "accepts": list(file.accepts)}


def _output(file: OutputFile) -> dict[str, Any]:
    return {
        "type": "array",
        "items": {"type": "string", "enum": list(file.suffixes)},
        "uniqueItems": True,
        "default": list(file.usual),
        "role": "output",
        "description": file.help,
    } | ({"minItems": 1} if file.required else {})


_RIG = InputFile("rig", "The rig, in place of the one stored in the scan.", ("rig",),
                 required=False)  # fmt: skip
_FILES = OutputFile(
    "outputs",
    "The surface; each file is read back and compared. STEP holds the solid "
    "that the part's shapes close to, else its triangles.",
    MESH_SUFFIXES,
    True,
    (".ply",),
)
_REPORT = OutputFile("report", "Report, with pictures or as figures.", REPORT_SUFFIXES)
_FIGURES = OutputFile("figures", "The figures as JSON, unrounded.", (".json",))

_ALL = (
    Verb(
        "import", "Import pictures",
        "Pictures of a laser line on a turning part, made elsewhere, become a scan. The numbers in "
        "their names say which step each belongs to. Several series are several lasers, named as "
        "their folders.",
        "Get in",
        (
            InputFile("pictures", "Pictures with the laser on.", ("pictures",), many=True),
            InputFile(
                "dark", "Pictures with the laser off: one for each lit picture, or one for all. "
                "Without them the background is estimated from the scan.",
                ("pictures",), many=True, required=False,
            ),
            InputFile("rig", "Rig to store in the scan.", ("rig",), required=False),
        ),
        (OptionsOf(SeriesOptions), OptionsOf(ImportOptions)),
        (OutputFile("output", "The scan.", (".turnscan",), True, (".turnscan",)),),
    ),
    Verb(
        "calibrate", "Calibrate from pictures",
        "Pictures of boards and of the turning table become a rig: camera, laser sheets and table, "
        "together or one by one. Stages without pictures are those of the rig that is known.",
        "Get in",
        (
            InputFile("camera", "Board pictures in varied poses, laser off.", ("pictures",),
                      required=False),
            InputFile("laser", "Board pictures with the stripe on the board or its white margin; "
                      "once for each laser.", ("pictures",), many=True, required=False),
            InputFile("laser_dark", "The same with the laser off, one for each picture with it on.",
                      ("pictures",), many=True, required=False),
            InputFile("table", "Pictures of the empty table, step by step.", ("pictures",),
                      required=False),
            InputFile("table_dark", "The same with the laser off.", ("pictures",), required=False),
            InputFile("rig", "What is known already: a rig whose stages are added or calibrated "
                      "again.", ("rig",), required=False),
        ),
        (OptionsOf(BoardOptions), OptionsOf(CalibrateOptions)),
        (
            OutputFile("output", "The rig.", (".json",), True, (".json",)),
            OutputFile("report", "Report with residuals and uncertainties.", (".html",), False,
                       (".html",)),
        ),
    ),
    Verb(
        "range-scans", "Import range scans",
        "Range scans (PLY) of another scanner become one surface; a .conf file says where each "
        "lies.",
        "Get in",
        (
            InputFile("source", "The .conf file, with its range scans beside it.", ("placement",)),
        ),
        (
            OptionsOf(RangeScanOptions), OptionsOf(ReconstructOptions, without=_OF_PICTURES),
            OptionsOf(FormatOptions),
        ),
        (_FILES, _REPORT),
    ),
    Verb(
        "join", "Join poses",
        "Several poses of one part become one surface. Without picked points and marker spheres "
        "they are registered by their shape; the first one gives the frame.",
        "Make",
        (
            InputFile(
                "sources", "The poses: scans, or range scans, or one .conf file of range scans.",
                ("scan", "range-scan", "placement"), many=True,
            ),
            InputFile(
                "points", "Corresponding points in several poses: CSV point,pose,x,y,z or JSON, "
                "mm, in the frame of each pose.",
                ("table",), required=False,
            ),
            InputFile(
                "reference", "The part as it is drawn (mesh in mm, or STEP), which each pose is "
                "brought onto; the poses need not overlap then.",
                ("mesh",), required=False,
            ),
            _RIG,
        ),
        (OptionsOf(JoinOptions), OptionsOf(ReconstructOptions), OptionsOf(FormatOptions)),
        (_FILES, _REPORT),
    ),
    Verb(
        "export", "Convert a file",
        "The surface of a mesh file or a scan in other formats.",
        "Make",
        (InputFile("source", "Mesh or scan.", _SURFACE),),
        (OptionsOf(ReconstructOptions, only=("decimate",)), OptionsOf(FormatOptions)),
        (
            OutputFile(
                "outputs", "The surface; each file is read back and compared. STEP holds the solid "
                "that the part's shapes close to, else its triangles.",
                MESH_SUFFIXES, True, (".stl",),
            ),
        ),
    ),
    Verb(
        "section", "Draw sections",
        "Planes through a part as drawings of lines, arcs and splines with their sizes.",
        "Make",
        (InputFile("part", "Mesh (mm) or scan.", _SURFACE),),
        (OptionsOf(SectionOptions),),
        (OutputFile("outputs", "The drawings.", SECTION_SUFFIXES, True, (".dxf",)),),
    ),
    Verb(
        "revolve", "Measure a turned part",
        "The axis of a turned part, how round and cylindrical it is, and the profile of its wall "
        "as a drawing or a revolved solid.",
        "Inspect",
        (InputFile("part", "Mesh (mm) or scan.", _SURFACE),),
        (OptionsOf(RevolveOptions),),
        (
            OutputFile("outputs", "The half-section, or a solid.", REVOLVE_SUFFIXES, True),
            OutputFile("report", "Report with pictures, figures, or a table.", DIMENSION_SUFFIXES),
            _FIGURES,
        ),
    ),
    Verb(
        "compare", "Compare with a reference",
        "Deviation of a measured surface from a reference, a CAD part for example, and how much of "
        "the reference was measured; its features one by one, and whether they keep tolerances.",
        "Inspect",
        (
            InputFile("measured", "The measured mesh or scan.", _SURFACE),
            InputFile("reference", "The mesh, STEP or scan that it is compared with.", _SURFACE),
            InputFile(
                "tolerance_table", "Tolerances: CSV feature,quantity,tolerance, as in "
                "3,diameter,H7 or *,*,ISO 2768-m.",
                ("table",), required=False,
            ),
        ),
        (OptionsOf(CompareOptions),),
        (
            OutputFile("picture", "Colour map of the deviation.", (".png",), False, (".png",)),
            OutputFile("outputs", "The surface coloured by its deviation.", MAP_SUFFIXES),
            OutputFile(
                "report", "Report with pictures, figures, or the sizes as a table.",
                DIMENSION_SUFFIXES,
            ),
            _FIGURES,
        ),
    ),
    Verb(
        "measure", "Measure planes, spheres, cylinders",
        "Size and volume, every size of the shapes of the part, planar faces and the angles "
        "between them, a sphere or a cylinder.",
        "Inspect",
        (InputFile("file", "Mesh (mm) or scan.", _SURFACE),),
        (OptionsOf(MeasureOptions),),
        (
            OutputFile(
                "report", "Dimension report with a picture of each feature, or a table.",
                DIMENSION_SUFFIXES,
            ),
            _FIGURES,
        ),
    ),
    Verb(
        "shapes", "Find shapes",
        "The planes, cylinders, spheres, cones and tori of a part, their sizes and relations.",
        "Inspect",
        (InputFile("part", "Mesh (mm) or scan.", _SURFACE),),
        (OptionsOf(ShapesOptions),),
        (
            OutputFile("outputs", "The mesh coloured by shape, or a solid.", SHAPES_SUFFIXES),
            OutputFile(
                "report", "Report with pictures, figures, or the dimensions as a table.",
                DIMENSION_SUFFIXES,
            ),
            _FIGURES,
        ),
    ),
    Verb(
        "check", "Check a file",
        "Whether a scan file is whole, or a mesh closed, manifold and free of self-intersections.",
        "Inspect",
        (InputFile("file", "Scan or mesh.", _SURFACE),),
        (),
        (_FIGURES,),
    ),
    Verb(
        "verify", "Verify the scanner",
        "Scans of a measured artefact (sphere, ball bar, plate or step block) against its values; "
        "several, in the order of time, also give the repeatability.",
        "Inspect",
        (
            InputFile("scans", "Scans of the artefact, or meshes of them.", ("scan", "mesh"),
                      many=True),
            InputFile("artefact", "Artefact file with its measured values.", ("artefact",)),
            _RIG,
        ),
        (OptionsOf(VerifyOptions),),
        (_REPORT, _FIGURES),
    ),
)  # fmt: skip

VERBS = {verb.name: verb for verb in _ALL}
"""The verbs that have a schema, by name."""

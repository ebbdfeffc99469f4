"""The verbs of turnscan as functions, which the command line, the browser and Python call.

Each takes typed options and one `turnscan.progress.Progress`, and returns its result with what was
found. Names are imported when they are used, so that a door waits only for what it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnscan.formats import ExportOptions
    from turnscan.workflows._artefact import TARGET, artefact
    from turnscan.workflows._batch import Batch, batch, table_of
    from turnscan.workflows._batch_recipe import Recipe, read_recipe
    from turnscan.workflows._batch_task import Outcome, Task
    from turnscan.workflows._batch_workers import Patience
    from turnscan.workflows._calibrate import CalibratedRig, CalibrationPictures, calibrate
    from turnscan.workflows._calibrate_options import BoardOptions, CalibrateOptions
    from turnscan.workflows._capture import CapturedPicture, CapturedPictures, capture
    from turnscan.workflows._capture_options import CaptureOptions
    from turnscan.workflows._check import CheckedLaser, CheckedScan, check
    from turnscan.workflows._check_mesh import CheckedMesh
    from turnscan.workflows._compare import Comparison, compare
    from turnscan.workflows._compare_options import MAP_SUFFIXES, CompareOptions
    from turnscan.workflows._compared_features import Agreement
    from turnscan.workflows._declare import Declared, declared
    from turnscan.workflows._demo import Demonstration, demo
    from turnscan.workflows._demo_options import DemoOptions
    from turnscan.workflows._design import DesignedRig, design, published_design
    from turnscan.workflows._design_options import DesignOptions, parse_theta
    from turnscan.workflows._device_options import DEFAULT_DEVICE, DeviceOptions
    from turnscan.workflows._devices import (
        Acknowledged,
        FoundDevices,
        acknowledge,
        find_devices,
        identify_lasers,
        lasers_in_words,
    )
    from turnscan.workflows._doctor import diagnosis_json, diagnosis_lines, doctor
    from turnscan.workflows._doctor_options import DoctorOptions
    from turnscan.workflows._edits import EditChanges, KeptEdits, edits
    from turnscan.workflows._emulate import EmulatedDevices, EmulatedLog, emulate
    from turnscan.workflows._emulate_options import EmulateOptions
    from turnscan.workflows._export import Exported, export
    from turnscan.workflows._files import (
        check_apart,
        check_output,
        check_writable,
        write_atomically,
    )
    from turnscan.workflows._format_options import FormatOptions
    from turnscan.workflows._gallery import (
        ScanGlance,
        duplicate_scan,
        frame_thumbnail,
        glance_at,
    )
    from turnscan.workflows._import_options import (
        AngleSource,
        EvenSteps,
        ImportOptions,
        ListedAngles,
        MarkerAngles,
        SeriesOptions,
        parse_angles,
    )
    from turnscan.workflows._import_pictures import ImportedScan, import_pictures
    from turnscan.workflows._import_preview import ImportPreview, SeriesPreview, preview_import
    from turnscan.workflows._incoming import Incoming, file_kinds, files_within, unpack
    from turnscan.workflows._join import join
    from turnscan.workflows._join_options import JoinOptions, RangeScanOptions
    from turnscan.workflows._kept_options import kept_names, kept_options, options_of
    from turnscan.workflows._live_calibration import (
        CELL_COLUMNS,
        CELL_ROWS,
        CalibrationState,
        LiveCalibration,
        LiveRig,
    )
    from turnscan.workflows._live_look import (
        GrowingScan,
        SeenStripe,
        picture_quality,
        seen_stripe,
    )
    from turnscan.workflows._measure import Measured, measure
    from turnscan.workflows._measure_options import MeasureOptions
    from turnscan.workflows._opening import OpenScan, open_scan
    from turnscan.workflows._precompile import precompile
    from turnscan.workflows._reading import read_mesh_file, read_rig_file
    from turnscan.workflows._reconstruct import reconstruct
    from turnscan.workflows._reconstruct_options import ReconstructOptions
    from turnscan.workflows._refine import RefinedRig, refine
    from turnscan.workflows._refine_options import RefineOptions
    from turnscan.workflows._report import ReportTable, about
    from turnscan.workflows._result import ReconstructResult
    from turnscan.workflows._revolve import RevolvedPart, revolve
    from turnscan.workflows._revolve_options import REVOLVE_SUFFIXES, RevolveOptions
    from turnscan.workflows._saving import save
    from turnscan.workflows._scan import (
        PlannedScan,
        ScanLeft,
        TakenScan,
        resume,
        scan,
        scan_left,
    )
    from turnscan.workflows._scan_options import ScanOptions
    from turnscan.workflows._schema import (
        VERBS,
        FileKind,
        InputFile,
        OptionsOf,
        OutputFile,
        Verb,
        option_schemas,
    )
    from turnscan.workflows._section import section
    from turnscan.workflows._section_options import SectionOptions
    from turnscan.workflows._sections import Sections, cuts_of
    from turnscan.workflows._selection_rules import SELECTION_RULES
    from turnscan.workflows._session import ScanSession, hole_in_words
    from turnscan.workflows._session_grid import CAUSE_TEXTS
    from turnscan.workflows._session_history import HistoryRow
    from turnscan.workflows._session_mesh import SurfacePatch, mesh_file_arrays
    from turnscan.workflows._session_state import (
        NotOpen,
        PlacedFinding,
        SessionChange,
        SessionState,
        Stale,
    )
    from turnscan.workflows._shapes import FoundShapes, find_shapes
    from turnscan.workflows._shapes_options import SHAPES_SUFFIXES, ShapesOptions
    from turnscan.workflows._simulate import SimulatedScan, simulate
    from turnscan.workflows._simulate_options import SimulateOptions
    from turnscan.workflows._stoppable import StoppableDevices, live_pictures, stoppable_devices
    from turnscan.workflows._stripes import ScanStripes
    from turnscan.workflows._targets import check_targets
    from turnscan.workflows._types import (
        LONGEST_PAUSE,
        MOST_PICTURES,
        KnownRig,
        Opened,
        Orientation,
        ScanControl,
        Shot,
        SurfaceFigures,
        photograph,
        scan_events,
    )
    from turnscan.workflows._units import DIMENSION_SUFFIXES, SECTION_SUFFIXES, check_step
    from turnscan.workflows._verify import (
        Trend,
        Verification,
        Verified,
        read_artefact,
        verification_history,
        verification_json,
        verify,
    )
    from turnscan.workflows._verify_options import VerifyOptions
    from turnscan.workflows._verify_report import (
        trend_picture,
        verification_html,
        verification_lines,
    )

_MODULES = {
    "_artefact": ("TARGET", "artefact"),
    "_calibrate": ("CalibratedRig", "CalibrationPictures", "calibrate"),
    "_calibrate_options": ("BoardOptions", "CalibrateOptions"),
    "_capture": ("CapturedPicture", "CapturedPictures", "capture"),
    "_capture_options": ("CaptureOptions",),
    "_check": ("CheckedLaser", "CheckedScan", "check"),
    "_check_mesh": ("CheckedMesh",),
    "_compare": ("Comparison", "compare"),
    "_compare_options": ("MAP_SUFFIXES", "CompareOptions"),
    "_compared_features": ("Agreement",),
    "_declare": ("Declared", "declared"),
    "_demo": ("Demonstration", "demo"),
    "_demo_options": ("DemoOptions",),
    "_design": ("DesignedRig", "design", "published_design"),
    "_design_options": ("DesignOptions", "parse_theta"),
    "_batch": ("Batch", "batch", "table_of"),
    "_batch_recipe": ("Recipe", "read_recipe"),
    "_batch_task": ("Outcome", "Task"),
    "_batch_workers": ("Patience",),
    "_device_options": ("DEFAULT_DEVICE", "DeviceOptions"),
    "_devices": (
        "Acknowledged",
        "FoundDevices",
        "acknowledge",
        "file_kinds",
        "files_within",
        "find_devices",
        "identify_lasers",
        "lasers_in_words",
    ),
    "_doctor": ("diagnosis_json", "diagnosis_lines", "doctor"),
    "_doctor_options": ("DoctorOptions",),
    "_edits": ("EditChanges", "KeptEdits", "edits"),
    "_emulate": ("EmulatedDevices", "EmulatedLog", "emulate"),
    "_emulate_options": ("EmulateOptions",),
    "_export": ("Exported", "export"),
    "_files": ("check_apart", "check_output", "check_writable", "write_atomically"),
    "_format_options": ("FormatOptions",),
    "_gallery": ("ScanGlance", "duplicate_scan", "frame_thumbnail", "glance_at"),
    "_import_options": (
        "AngleSource",
        "EvenSteps",
        "ImportOptions",
        "ListedAngles",
        "MarkerAngles",
        "SeriesOptions",
        "parse_angles",
    ),
    "_import_pictures": ("ImportedScan", "import_pictures"),
    "_import_preview": ("ImportPreview", "SeriesPreview", "preview_import"),
    "_incoming": ("Incoming", "file_kinds", "files_within", "unpack"),
    "_join": ("join",),
    "_join_options": ("JoinOptions", "RangeScanOptions"),
    "_kept_options": ("kept_names", "kept_options", "options_of"),
    "_measure": ("Measured", "measure"),
    "_measure_options": ("MeasureOptions",),
    "_opening": ("OpenScan", "open_scan"),
    "_precompile": ("precompile",),
    "_reading": ("read_mesh_file", "read_rig_file"),
    "_reconstruct": ("reconstruct",),
    "_reconstruct_options": ("ReconstructOptions",),
    "_refine": ("RefinedRig", "refine"),
    "_refine_options": ("RefineOptions",),
    "_report": ("ReportTable", "about"),
    "_result": ("ReconstructResult",),
    "_saving": ("ExportOptions", "save"),
    "_scan": (
        "PlannedScan",
        "ScanLeft",
        "TakenScan",
        "resume",
        "scan",
        "scan_left",
    ),
    "_revolve": ("RevolvedPart", "revolve"),
    "_revolve_options": ("REVOLVE_SUFFIXES", "RevolveOptions"),
    "_scan_options": ("ScanOptions",),
    "_schema": (
        "VERBS",
        "FileKind",
        "InputFile",
        "OptionsOf",
        "OutputFile",
        "Verb",
        "option_schemas",
    ),
    "_section": ("section",),
    "_section_options": ("SectionOptions",),
    "_sections": ("Sections", "cuts_of"),
    "_selection_rules": ("SELECTION_RULES",),
    "_session": ("ScanSession", "hole_in_words"),
    "_session_grid": ("CAUSE_TEXTS",),
    "_session_history": ("HistoryRow",),
    "_session_mesh": ("SurfacePatch", "mesh_file_arrays"),
    "_session_state": ("NotOpen", "PlacedFinding", "SessionChange", "SessionState", "Stale"),
    "_live_calibration": (
        "CELL_COLUMNS",
        "CELL_ROWS",
        "CalibrationState",
        "LiveCalibration",
        "LiveRig",
    ),
    "_live_look": (
        "GrowingScan",
        "SeenStripe",
        "picture_quality",
        "seen_stripe",
    ),
    "_stoppable": (
        "StoppableDevices",
        "live_pictures",
        "stoppable_devices",
    ),
    "_shapes": ("FoundShapes", "find_shapes"),
    "_shapes_options": ("SHAPES_SUFFIXES", "ShapesOptions"),
    "_simulate": ("SimulatedScan", "simulate"),
    "_simulate_options": ("SimulateOptions",),
    "_stripes": ("ScanStripes",),
    "_targets": ("check_targets",),
    "_types": (
        "KnownRig",
        "SurfaceFigures",
        "LONGEST_PAUSE",
        "MOST_PICTURES",
        "Opened",
        "Orientation",
        "ScanControl",
        "Shot",
        "photograph",
        "scan_events",
    ),
    "_units": ("DIMENSION_SUFFIXES", "SECTION_SUFFIXES", "check_step"),
    "_verify": (
        "Trend",
        "Verification",
        "Verified",
        "read_artefact",
        "verification_history",
        "verification_json",
        "verify",
    ),
    "_verify_options": ("VerifyOptions",),
    "_verify_report": ("trend_picture", "verification_html", "verification_lines"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "CAUSE_TEXTS",
    "CELL_COLUMNS",
    "CELL_ROWS",
    "DEFAULT_DEVICE",
    "DIMENSION_SUFFIXES",
    "LONGEST_PAUSE",
    "MAP_SUFFIXES",
    "MOST_PICTURES",
    "REVOLVE_SUFFIXES",
    "SECTION_SUFFIXES",
    "SELECTION_RULES",
    "SHAPES_SUFFIXES",
    "TARGET",
    "VERBS",
    "Acknowledged",
    "Agreement",
    "AngleSource",
    "Batch",
    "BoardOptions",
    "CalibrateOptions",
    "CalibratedRig",
    "CalibrationPictures",
    "CalibrationState",
    "CaptureOptions",
    "CapturedPicture",
    "CapturedPictures",
    "CheckedLaser",
    "CheckedMesh",
    "CheckedScan",
    "CompareOptions",
    "Comparison",
    "Declared",
    "DemoOptions",
    "Demonstration",
    "DesignOptions",
    "DesignedRig",
    "DeviceOptions",
    "DoctorOptions",
    "EditChanges",
    "EmulateOptions",
    "EmulatedDevices",
    "EmulatedLog",
    "EvenSteps",
    "ExportOptions",
    "Exported",
    "FileKind",
    "FormatOptions",
    "FoundDevices",
    "FoundShapes",
    "GrowingScan",
    "HistoryRow",
    "ImportOptions",
    "ImportPreview",
    "ImportedScan",
    "Incoming",
    "InputFile",
    "JoinOptions",
    "KeptEdits",
    "KnownRig",
    "ListedAngles",
    "LiveCalibration",
    "LiveRig",
    "MarkerAngles",
    "MeasureOptions",
    "Measured",
    "NotOpen",
    "OpenScan",
    "Opened",
    "OptionsOf",
    "Orientation",
    "Outcome",
    "OutputFile",
    "Patience",
    "PlacedFinding",
    "PlannedScan",
    "RangeScanOptions",
    "Recipe",
    "ReconstructOptions",
    "ReconstructResult",
    "RefineOptions",
    "RefinedRig",
    "ReportTable",
    "RevolveOptions",
    "RevolvedPart",
    "ScanControl",
    "ScanGlance",
    "ScanLeft",
    "ScanOptions",
    "ScanSession",
    "ScanStripes",
    "SectionOptions",
    "Sections",
    "SeenStripe",
    "SeriesOptions",
    "SeriesPreview",
    "SessionChange",
    "SessionState",
    "ShapesOptions",
    "Shot",
    "SimulateOptions",
    "SimulatedScan",
    "Stale",
    "StoppableDevices",
    "SurfaceFigures",
    "SurfacePatch",
    "TakenScan",
    "Task",
    "Trend",
    "Verb",
    "Verification",
    "Verified",
    "VerifyOptions",
    "about",
    "acknowledge",
    "artefact",
    "batch",
    "calibrate",
    "capture",
    "check",
    "check_apart",
    "check_output",
    "check_step",
    "check_targets",
    "check_writable",
    "compare",
    "cuts_of",
    "declared",
    "demo",
    "design",
    "diagnosis_json",
    "diagnosis_lines",
    "doctor",
    "duplicate_scan",
    "edits",
    "emulate",
    "export",
    "file_kinds",
    "files_within",
    "find_devices",
    "find_shapes",
    "frame_thumbnail",
    "glance_at",
    "hole_in_words",
    "identify_lasers",
    "import_pictures",
    "join",
    "kept_names",
    "kept_options",
    "lasers_in_words",
    "live_pictures",
    "measure",
    "mesh_file_arrays",
    "open_scan",
    "option_schemas",
    "options_of",
    "parse_angles",
    "parse_theta",
    "photograph",
    "picture_quality",
    "precompile",
    "preview_import",
    "published_design",
    "read_artefact",
    "read_mesh_file",
    "read_recipe",
    "read_rig_file",
    "reconstruct",
    "refine",
    "resume",
    "revolve",
    "save",
    "scan",
    "scan_events",
    "scan_left",
    "section",
    "seen_stripe",
    "simulate",
    "stoppable_devices",
    "table_of",
    "trend_picture",
    "unpack",
    "verification_history",
    "verification_html",
    "verification_json",
    "verification_lines",
    "verify",
    "write_atomically",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__

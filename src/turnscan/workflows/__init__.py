"""The verbs of turnscan as functions, which the command line, the browser and Python call.

Each takes typed options and one `turnscan.progress.Progress`, and returns its result with what was
found. Names are imported when they are used, so that a door waits only for what it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnscan.formats import ExportOptions
    from turnscan.workflows._batch._batch import Batch, batch, table_of
    from turnscan.workflows._batch._recipe import Recipe, read_recipe
    from turnscan.workflows._batch._task import Outcome, Task
    from turnscan.workflows._batch._workers import Patience
    from turnscan.workflows._calibration._artefact import TARGET, artefact
    from turnscan.workflows._calibration._calibrate import (
        CalibratedRig,
        CalibrationPictures,
        calibrate,
    )
    from turnscan.workflows._calibration._live_calibration import (
        CELL_COLUMNS,
        CELL_ROWS,
        CalibrationState,
        LiveCalibration,
        LiveRig,
    )
    from turnscan.workflows._calibration._refine import RefinedRig, refine
    from turnscan.workflows._calibration._targets import check_targets
    from turnscan.workflows._calibration._verify import (
        Trend,
        Verification,
        Verified,
        read_artefact,
        verification_history,
        verification_json,
        verify,
    )
    from turnscan.workflows._calibration._verify_report import (
        trend_picture,
        verification_html,
        verification_lines,
    )
    from turnscan.workflows._demo import Demonstration, demo
    from turnscan.workflows._design._design import DesignedRig, design, published_design
    from turnscan.workflows._files._kept_options import kept_names, kept_options, options_of
    from turnscan.workflows._files._reading import read_mesh_file, read_rig_file
    from turnscan.workflows._files._writing import (
        check_apart,
        check_output,
        check_writable,
        write_atomically,
    )
    from turnscan.workflows._importing._incoming import Incoming, file_kinds, files_within, unpack
    from turnscan.workflows._importing._pictures import ImportedScan, import_pictures
    from turnscan.workflows._importing._preview import ImportPreview, SeriesPreview, preview_import
    from turnscan.workflows._inspection._check import CheckedLaser, CheckedScan, check
    from turnscan.workflows._inspection._check_mesh import CheckedMesh
    from turnscan.workflows._inspection._compare import Comparison, compare
    from turnscan.workflows._inspection._compared_features import Agreement
    from turnscan.workflows._inspection._measure import Measured, measure
    from turnscan.workflows._inspection._revolve import RevolvedPart, revolve
    from turnscan.workflows._inspection._section import section
    from turnscan.workflows._inspection._shapes import FoundShapes, find_shapes
    from turnscan.workflows._options._calibrate import BoardOptions, CalibrateOptions
    from turnscan.workflows._options._capture import CaptureOptions
    from turnscan.workflows._options._compare import MAP_SUFFIXES, CompareOptions
    from turnscan.workflows._options._declare import Declared, declared
    from turnscan.workflows._options._demo import DemoOptions
    from turnscan.workflows._options._design import DesignOptions, parse_theta
    from turnscan.workflows._options._device import DEFAULT_DEVICE, DeviceOptions
    from turnscan.workflows._options._doctor import DoctorOptions
    from turnscan.workflows._options._emulate import EmulateOptions
    from turnscan.workflows._options._format import FormatOptions
    from turnscan.workflows._options._import import (
        AngleSource,
        EvenSteps,
        ImportOptions,
        ListedAngles,
        MarkerAngles,
        SeriesOptions,
        parse_angles,
    )
    from turnscan.workflows._options._join import JoinOptions, RangeScanOptions
    from turnscan.workflows._options._measure import MeasureOptions
    from turnscan.workflows._options._reconstruct import ReconstructOptions
    from turnscan.workflows._options._refine import RefineOptions
    from turnscan.workflows._options._revolve import REVOLVE_SUFFIXES, RevolveOptions
    from turnscan.workflows._options._scan import ScanOptions
    from turnscan.workflows._options._schema import (
        VERBS,
        FileKind,
        InputFile,
        OptionsOf,
        OutputFile,
        Verb,
        option_schemas,
    )
    from turnscan.workflows._options._section import SectionOptions
    from turnscan.workflows._options._shapes import SHAPES_SUFFIXES, ShapesOptions
    from turnscan.workflows._options._simulate import SimulateOptions
    from turnscan.workflows._options._types import (
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
    from turnscan.workflows._options._units import DIMENSION_SUFFIXES, SECTION_SUFFIXES, check_step
    from turnscan.workflows._options._verify import VerifyOptions
    from turnscan.workflows._precompile import precompile
    from turnscan.workflows._scanning._capture import CapturedPicture, CapturedPictures, capture
    from turnscan.workflows._scanning._devices import (
        Acknowledged,
        FoundDevices,
        acknowledge,
        find_devices,
        identify_lasers,
        lasers_in_words,
    )
    from turnscan.workflows._scanning._doctor import diagnosis_json, diagnosis_lines, doctor
    from turnscan.workflows._scanning._emulate import EmulatedDevices, EmulatedLog, emulate
    from turnscan.workflows._scanning._live_look import (
        GrowingScan,
        SeenStripe,
        picture_quality,
        seen_stripe,
    )
    from turnscan.workflows._scanning._scan import (
        PlannedScan,
        ScanLeft,
        TakenScan,
        resume,
        scan,
        scan_left,
    )
    from turnscan.workflows._scanning._simulate import SimulatedScan, simulate
    from turnscan.workflows._scanning._stoppable import (
        StoppableDevices,
        live_pictures,
        stoppable_devices,
    )
    from turnscan.workflows._session._edits import EditChanges, KeptEdits, edits
    from turnscan.workflows._session._gallery import (
        ScanGlance,
        duplicate_scan,
        frame_thumbnail,
        glance_at,
    )
    from turnscan.workflows._session._grid import CAUSE_TEXTS
    from turnscan.workflows._session._history import HistoryRow
    from turnscan.workflows._session._mesh import SurfacePatch, mesh_file_arrays
    from turnscan.workflows._session._opening import OpenScan, open_scan
    from turnscan.workflows._session._selection_rules import SELECTION_RULES
    from turnscan.workflows._session._session import ScanSession, hole_in_words
    from turnscan.workflows._session._state import (
        NotOpen,
        PlacedFinding,
        SessionChange,
        SessionState,
        Stale,
    )
    from turnscan.workflows._solids._sections import Sections, cuts_of
    from turnscan.workflows._surface._export import Exported, export
    from turnscan.workflows._surface._join import join
    from turnscan.workflows._surface._reconstruct import reconstruct
    from turnscan.workflows._surface._report import ReportTable, about
    from turnscan.workflows._surface._result import ReconstructResult
    from turnscan.workflows._surface._saving import save
    from turnscan.workflows._surface._stripes import ScanStripes

_MODULES = {
    "_calibration._artefact": ("TARGET", "artefact"),
    "_calibration._calibrate": ("CalibratedRig", "CalibrationPictures", "calibrate"),
    "_options._calibrate": ("BoardOptions", "CalibrateOptions"),
    "_scanning._capture": ("CapturedPicture", "CapturedPictures", "capture"),
    "_options._capture": ("CaptureOptions",),
    "_inspection._check": ("CheckedLaser", "CheckedScan", "check"),
    "_inspection._check_mesh": ("CheckedMesh",),
    "_inspection._compare": ("Comparison", "compare"),
    "_options._compare": ("MAP_SUFFIXES", "CompareOptions"),
    "_inspection._compared_features": ("Agreement",),
    "_options._declare": ("Declared", "declared"),
    "_demo": ("Demonstration", "demo"),
    "_options._demo": ("DemoOptions",),
    "_design._design": ("DesignedRig", "design", "published_design"),
    "_options._design": ("DesignOptions", "parse_theta"),
    "_batch._batch": ("Batch", "batch", "table_of"),
    "_batch._recipe": ("Recipe", "read_recipe"),
    "_batch._task": ("Outcome", "Task"),
    "_batch._workers": ("Patience",),
    "_options._device": ("DEFAULT_DEVICE", "DeviceOptions"),
    "_scanning._devices": (
        "Acknowledged",
        "FoundDevices",
        "acknowledge",
        "find_devices",
        "identify_lasers",
        "lasers_in_words",
    ),
    "_scanning._doctor": ("diagnosis_json", "diagnosis_lines", "doctor"),
    "_options._doctor": ("DoctorOptions",),
    "_session._edits": ("EditChanges", "KeptEdits", "edits"),
    "_scanning._emulate": ("EmulatedDevices", "EmulatedLog", "emulate"),
    "_options._emulate": ("EmulateOptions",),
    "_surface._export": ("Exported", "export"),
    "_files._writing": ("check_apart", "check_output", "check_writable", "write_atomically"),
    "_options._format": ("FormatOptions",),
    "_session._gallery": ("ScanGlance", "duplicate_scan", "frame_thumbnail", "glance_at"),
    "_options._import": (
        "AngleSource",
        "EvenSteps",
        "ImportOptions",
        "ListedAngles",
        "MarkerAngles",
        "SeriesOptions",
        "parse_angles",
    ),
    "_importing._pictures": ("ImportedScan", "import_pictures"),
    "_importing._preview": ("ImportPreview", "SeriesPreview", "preview_import"),
    "_importing._incoming": ("Incoming", "file_kinds", "files_within", "unpack"),
    "_surface._join": ("join",),
    "_options._join": ("JoinOptions", "RangeScanOptions"),
    "_files._kept_options": ("kept_names", "kept_options", "options_of"),
    "_inspection._measure": ("Measured", "measure"),
    "_options._measure": ("MeasureOptions",),
    "_session._opening": ("OpenScan", "open_scan"),
    "_precompile": ("precompile",),
    "_files._reading": ("read_mesh_file", "read_rig_file"),
    "_surface._reconstruct": ("reconstruct",),
    "_options._reconstruct": ("ReconstructOptions",),
    "_calibration._refine": ("RefinedRig", "refine"),
    "_options._refine": ("RefineOptions",),
    "_surface._report": ("ReportTable", "about"),
    "_surface._result": ("ReconstructResult",),
    "_surface._saving": ("ExportOptions", "save"),
    "_scanning._scan": (
        "PlannedScan",
        "ScanLeft",
        "TakenScan",
        "resume",
        "scan",
        "scan_left",
    ),
    "_inspection._revolve": ("RevolvedPart", "revolve"),
    "_options._revolve": ("REVOLVE_SUFFIXES", "RevolveOptions"),
    "_options._scan": ("ScanOptions",),
    "_options._schema": (
        "VERBS",
        "FileKind",
        "InputFile",
        "OptionsOf",
        "OutputFile",
        "Verb",
        "option_schemas",
    ),
    "_inspection._section": ("section",),
    "_options._section": ("SectionOptions",),
    "_solids._sections": ("Sections", "cuts_of"),
    "_session._selection_rules": ("SELECTION_RULES",),
    "_session._session": ("ScanSession", "hole_in_words"),
    "_session._grid": ("CAUSE_TEXTS",),
    "_session._history": ("HistoryRow",),
    "_session._mesh": ("SurfacePatch", "mesh_file_arrays"),
    "_session._state": ("NotOpen", "PlacedFinding", "SessionChange", "SessionState", "Stale"),
    "_calibration._live_calibration": (
        "CELL_COLUMNS",
        "CELL_ROWS",
        "CalibrationState",
        "LiveCalibration",
        "LiveRig",
    ),
    "_scanning._live_look": (
        "GrowingScan",
        "SeenStripe",
        "picture_quality",
        "seen_stripe",
    ),
    "_scanning._stoppable": (
        "StoppableDevices",
        "live_pictures",
        "stoppable_devices",
    ),
    "_inspection._shapes": ("FoundShapes", "find_shapes"),
    "_options._shapes": ("SHAPES_SUFFIXES", "ShapesOptions"),
    "_scanning._simulate": ("SimulatedScan", "simulate"),
    "_options._simulate": ("SimulateOptions",),
    "_surface._stripes": ("ScanStripes",),
    "_calibration._targets": ("check_targets",),
    "_options._types": (
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
    "_options._units": ("DIMENSION_SUFFIXES", "SECTION_SUFFIXES", "check_step"),
    "_calibration._verify": (
        "Trend",
        "Verification",
        "Verified",
        "read_artefact",
        "verification_history",
        "verification_json",
        "verify",
    ),
    "_options._verify": ("VerifyOptions",),
    "_calibration._verify_report": ("trend_picture", "verification_html", "verification_lines"),
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

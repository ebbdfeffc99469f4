"""The verbs of turnscan as functions, which the command line, the browser and Python call.

Each takes typed options and one `turnscan.progress.Progress`, and returns its result with what was
found. Names are imported when they are used, so that a door waits only for what it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnscan.formats import ExportOptions
    from turnscan.workflows._artefact import PAPERS, TARGET, artefact
    from turnscan.workflows._calibrate import CalibratedRig, CalibrationPictures, calibrate
    from turnscan.workflows._calibrate_options import CalibrateOptions
    from turnscan.workflows._check import CheckedLaser, CheckedScan, check
    from turnscan.workflows._check_mesh import CheckedMesh
    from turnscan.workflows._compare import Agreement, Comparison, compare
    from turnscan.workflows._declare import Declared, declared
    from turnscan.workflows._design import DesignedRig, design, published_design
    from turnscan.workflows._design_options import DesignOptions, parse_theta
    from turnscan.workflows._export import Exported, export
    from turnscan.workflows._files import (
        check_apart,
        check_output,
        check_writable,
        write_atomically,
    )
    from turnscan.workflows._import_options import (
        AngleSource,
        EvenSteps,
        ImportOptions,
        ListedAngles,
        MarkerAngles,
        parse_angles,
    )
    from turnscan.workflows._import_pictures import ImportedScan, import_pictures
    from turnscan.workflows._join import join
    from turnscan.workflows._kept_options import kept_options, options_of
    from turnscan.workflows._measure import Measured, MeasureOptions, measure
    from turnscan.workflows._opening import OpenScan, open_scan
    from turnscan.workflows._reading import UNITS, read_mesh_file, read_rig_file
    from turnscan.workflows._reconstruct import reconstruct
    from turnscan.workflows._reconstruct_options import ReconstructOptions
    from turnscan.workflows._report import about
    from turnscan.workflows._result import ReconstructResult
    from turnscan.workflows._saving import save
    from turnscan.workflows._section import section
    from turnscan.workflows._sections import SECTION_SUFFIXES, Sections, cuts_of
    from turnscan.workflows._simulate import SimulatedScan, SimulateOptions, simulate
    from turnscan.workflows._stripes import ScanStripes
    from turnscan.workflows._targets import check_targets
    from turnscan.workflows._verify import (
        Trend,
        Verification,
        Verified,
        read_artefact,
        verification_json,
        verify,
    )

_MODULES = {
    "_files": ("check_apart", "check_output", "check_writable", "write_atomically"),
    "_compare": ("Agreement", "Comparison", "compare"),
    "_declare": ("Declared", "declared"),
    "_export": ("Exported", "export"),
    "_join": ("join",),
    "_kept_options": ("kept_options", "options_of"),
    "_measure": ("MeasureOptions", "Measured", "measure"),
    "_opening": ("OpenScan", "open_scan"),
    "_reading": ("UNITS", "read_mesh_file", "read_rig_file"),
    "_reconstruct": ("reconstruct",),
    "_reconstruct_options": ("ReconstructOptions",),
    "_report": ("about",),
    "_result": ("ReconstructResult",),
    "_saving": ("ExportOptions", "save"),
    "_stripes": ("ScanStripes",),
    "_targets": ("check_targets",),
    "_calibrate": ("CalibratedRig", "CalibrationPictures", "calibrate"),
    "_calibrate_options": ("CalibrateOptions",),
    "_check": ("CheckedLaser", "CheckedScan", "check"),
    "_check_mesh": ("CheckedMesh",),
    "_design": ("DesignedRig", "design", "published_design"),
    "_design_options": ("DesignOptions", "parse_theta"),
    "_import_options": (
        "AngleSource",
        "EvenSteps",
        "ImportOptions",
        "ListedAngles",
        "MarkerAngles",
        "parse_angles",
    ),
    "_import_pictures": ("ImportedScan", "import_pictures"),
    "_simulate": ("SimulateOptions", "SimulatedScan", "simulate"),
    "_section": ("section",),
    "_sections": ("SECTION_SUFFIXES", "Sections", "cuts_of"),
    "_artefact": ("PAPERS", "TARGET", "artefact"),
    "_verify": (
        "Trend",
        "Verification",
        "Verified",
        "read_artefact",
        "verification_json",
        "verify",
    ),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "PAPERS",
    "SECTION_SUFFIXES",
    "TARGET",
    "UNITS",
    "Agreement",
    "AngleSource",
    "CalibrateOptions",
    "CalibratedRig",
    "CalibrationPictures",
    "CheckedLaser",
    "CheckedMesh",
    "CheckedScan",
    "Comparison",
    "Declared",
    "DesignOptions",
    "DesignedRig",
    "EvenSteps",
    "ExportOptions",
    "Exported",
    "ImportOptions",
    "ImportedScan",
    "ListedAngles",
    "MarkerAngles",
    "MeasureOptions",
    "Measured",
    "OpenScan",
    "ReconstructOptions",
    "ReconstructResult",
    "ScanStripes",
    "Sections",
    "SimulateOptions",
    "SimulatedScan",
    "Trend",
    "Verification",
    "Verified",
    "about",
    "artefact",
    "calibrate",
    "check",
    "check_apart",
    "check_output",
    "check_targets",
    "check_writable",
    "compare",
    "cuts_of",
    "declared",
    "design",
    "export",
    "import_pictures",
    "join",
    "kept_options",
    "measure",
    "open_scan",
    "options_of",
    "parse_angles",
    "parse_theta",
    "published_design",
    "read_artefact",
    "read_mesh_file",
    "read_rig_file",
    "reconstruct",
    "save",
    "section",
    "simulate",
    "verification_json",
    "verify",
    "write_atomically",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__

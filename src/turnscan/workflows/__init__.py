"""The verbs of turnscan as functions, which the command line, the browser and Python call.

Each takes typed options and one `turnscan.progress.Progress`, and returns its result with what was
found. Names are imported when they are used, so that a door waits only for what it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnscan.workflows._calibrate import CalibratedRig, CalibrationPictures, calibrate
    from turnscan.workflows._calibrate_options import CalibrateOptions
    from turnscan.workflows._check import CheckedLaser, CheckedScan, check
    from turnscan.workflows._check_mesh import CheckedMesh
    from turnscan.workflows._declare import Declared, declared
    from turnscan.workflows._design import DesignedRig, design, published_design
    from turnscan.workflows._design_options import DesignOptions, parse_theta
    from turnscan.workflows._import_options import (
        AngleSource,
        EvenSteps,
        ImportOptions,
        ListedAngles,
        MarkerAngles,
        parse_angles,
    )
    from turnscan.workflows._import_pictures import ImportedScan, import_pictures
    from turnscan.workflows._simulate import SimulatedScan, SimulateOptions, simulate

_MODULES = {
    "_calibrate": ("CalibratedRig", "CalibrationPictures", "calibrate"),
    "_calibrate_options": ("CalibrateOptions",),
    "_check": ("CheckedLaser", "CheckedScan", "check"),
    "_check_mesh": ("CheckedMesh",),
    "_declare": ("Declared", "declared"),
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
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "AngleSource",
    "CalibrateOptions",
    "CalibratedRig",
    "CalibrationPictures",
    "CheckedLaser",
    "CheckedMesh",
    "CheckedScan",
    "Declared",
    "DesignOptions",
    "DesignedRig",
    "EvenSteps",
    "ImportOptions",
    "ImportedScan",
    "ListedAngles",
    "MarkerAngles",
    "SimulateOptions",
    "SimulatedScan",
    "calibrate",
    "check",
    "declared",
    "design",
    "import_pictures",
    "parse_angles",
    "parse_theta",
    "published_design",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__

"""turnscan: laser-line turntable 3-D scanning.

>>> import turnscan as ts
>>> part = ts.reconstruct("cup.turnscan", close=True)
>>> part.save("cup.dxf")
[]

Names are imported when they are used, so that ``import turnscan`` takes no time. Rooms of the
house are imported by their own path, as in ``from turnscan.rig import Camera``; where a verb has
the name of a room (``calibrate``, ``simulate``), ``ts.calibrate`` is the verb.
"""

from __future__ import annotations

import sys

__version__ = "0.1.0"

TYPE_CHECKING = False
if not TYPE_CHECKING:
    ModuleType = type(sys)
else:
    from types import ModuleType
    from typing import Any

    from turnscan.errors import InputError, TurnscanError
    from turnscan.findings import Finding
    from turnscan.formats import ExportOptions
    from turnscan.mesh import Mesh
    from turnscan.points import RangeGrid
    from turnscan.progress import Progress
    from turnscan.rig import Rig
    from turnscan.stripes import Stripe
    from turnscan.workflows import (
        CalibrateOptions,
        CalibrationPictures,
        EvenSteps,
        ImportOptions,
        ListedAngles,
        MarkerAngles,
        MeasureOptions,
        OpenScan,
        ReconstructOptions,
        ReconstructResult,
        SimulateOptions,
        batch,
        calibrate,
        check,
        compare,
        design,
        export,
        find_shapes,
        import_pictures,
        join,
        measure,
        open_scan,
        options_of,
        read_mesh_file,
        read_rig_file,
        reconstruct,
        refine,
        revolve,
        section,
        simulate,
        verify,
    )

_ROOMS = {
    "errors": ("InputError", "TurnscanError"),
    "findings": ("Finding",),
    "formats": ("ExportOptions",),
    "mesh": ("Mesh",),
    "points": ("RangeGrid",),
    "progress": ("Progress",),
    "rig": ("Rig",),
    "stripes": ("Stripe",),
    "workflows": (
        *("CalibrateOptions", "CalibrationPictures", "EvenSteps"),
        *("ImportOptions", "ListedAngles", "MarkerAngles", "MeasureOptions", "OpenScan"),
        *("ReconstructOptions", "ReconstructResult", "SimulateOptions"),
        *("batch", "calibrate", "check", "find_shapes"),
        *("compare", "design", "export", "import_pictures", "join", "measure", "open_scan"),
        *("options_of", "read_mesh_file", "read_rig_file", "reconstruct", "section"),
        *("refine", "revolve", "simulate", "verify"),
    ),
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "CalibrateOptions",
    "CalibrationPictures",
    "EvenSteps",
    "ExportOptions",
    "Finding",
    "ImportOptions",
    "InputError",
    "ListedAngles",
    "MarkerAngles",
    "MeasureOptions",
    "Mesh",
    "OpenScan",
    "Progress",
    "RangeGrid",
    "ReconstructOptions",
    "ReconstructResult",
    "Rig",
    "SimulateOptions",
    "Stripe",
    "TurnscanError",
    "batch",
    "calibrate",
    "check",
    "compare",
    "design",
    "export",
    "find_shapes",
    "import_pictures",
    "join",
    "measure",
    "open_scan",
    "options_of",
    "read_mesh_file",
    "read_rig_file",
    "reconstruct",
    "refine",
    "revolve",
    "section",
    "simulate",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


class _Package(ModuleType):
    """The package as a module that no room takes a public name from.

    Python binds a room to its name in the package once it is imported, which would turn the
    function ``ts.simulate`` into the room ``turnscan.simulate``, or not, by the order of imports.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _HOMES or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

"""turnscan: laser-line turntable 3-D scanning.

>>> import turnscan as ts
>>> part = ts.reconstruct("cup.turnscan")
>>> part.save("cup.dxf")
[]

Names are imported when they are used, so that ``import turnscan`` takes no time.
"""

from __future__ import annotations

__version__ = "0.1.0"

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from turnscan.errors import (
        CalibrationError,
        DeviceError,
        ExportError,
        InputError,
        ScanError,
        TurnscanError,
    )
    from turnscan.findings import Finding
    from turnscan.formats import ExportOptions
    from turnscan.mesh import Mesh
    from turnscan.points import RangeGrid
    from turnscan.progress import Cancelled, Progress
    from turnscan.rig import Camera, Design, LaserSheet, Pose, Rig, design_preset
    from turnscan.scan import Frame, Scan
    from turnscan.workflows import (
        Comparison,
        Exported,
        Measured,
        MeasureOptions,
        ReconstructOptions,
        ReconstructResult,
        compare,
        export_mesh,
        join,
        measure,
        open_scan,
        options_of,
        read_mesh_file,
        read_rig_file,
        reconstruct,
        save,
    )

_ROOMS = {
    "errors": (
        *("CalibrationError", "DeviceError", "ExportError", "InputError", "ScanError"),
        "TurnscanError",
    ),
    "formats": ("ExportOptions",),
    "findings": ("Finding",),
    "points": ("RangeGrid",),
    "progress": ("Cancelled", "Progress"),
    "rig": ("Camera", "Design", "LaserSheet", "Pose", "Rig", "design_preset"),
    "scan": ("Frame", "Scan"),
    "mesh": ("Mesh",),
    "workflows": (
        *("Comparison", "Exported", "MeasureOptions", "Measured", "ReconstructOptions"),
        *("ReconstructResult", "compare", "export_mesh", "join", "measure", "open_scan"),
        *("options_of", "read_mesh_file", "read_rig_file", "reconstruct", "save"),
    ),
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "CalibrationError",
    "Camera",
    "Cancelled",
    "Comparison",
    "Design",
    "DeviceError",
    "ExportError",
    "ExportOptions",
    "Exported",
    "Finding",
    "Frame",
    "InputError",
    "LaserSheet",
    "MeasureOptions",
    "Measured",
    "Mesh",
    "Pose",
    "Progress",
    "RangeGrid",
    "ReconstructOptions",
    "ReconstructResult",
    "Rig",
    "Scan",
    "ScanError",
    "TurnscanError",
    "compare",
    "design_preset",
    "export_mesh",
    "join",
    "measure",
    "open_scan",
    "options_of",
    "read_mesh_file",
    "read_rig_file",
    "reconstruct",
    "save",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]

"""Units and kinds of files, as the doors name them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""mm in each unit that a file without a unit of its own may be in."""
SECTION_SUFFIXES = (".dxf", ".svg", ".pdf", ".json")
"""Of drawings and figures of sections."""
STEP_SUFFIXES = (".step", ".stp")
IGES_SUFFIXES = (".igs", ".iges")
DIMENSION_SUFFIXES = (".html", ".pdf", ".json", ".csv")
"""Of reports that hold dimensions: pages with pictures, figures, or a table."""


def is_step(path: Path) -> bool:
    """Whether a file's name is that of a STEP file."""
    return path.suffix.lower() in STEP_SUFFIXES


def is_iges(path: Path) -> bool:
    """Whether a file's name is that of an IGES file."""
    return path.suffix.lower() in IGES_SUFFIXES


def check_step(paths: Iterable[Path]) -> bool:
    """Whether a solid is wanted.

    Raises InputError, before work is spent, where none can be made.
    """
    wanted = any(is_step(path) or is_iges(path) for path in paths)
    if wanted:
        from turnscan.drawings import check_opencascade

        check_opencascade()
    return wanted


def check_suffixes(paths: Sequence[Path]) -> bool:
    """As `check_step`, for files that hold a surface: InputError for an unknown suffix, too."""
    from turnscan.formats import exporter_for

    for path in paths:
        if not is_step(path):
            exporter_for(path.suffix, beside=STEP_SUFFIXES[:1])
    return check_step(paths)

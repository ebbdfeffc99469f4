"""The files that a workflow is to write, checked before work is spent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from turnscan.workflows._files._writing import check_apart, check_output
from turnscan.workflows._importing._range_scans import placed_scans
from turnscan.workflows._options._units import check_suffixes


def check_targets(
    outputs: Sequence[Path],
    inputs: Sequence[Path],
    reports: Sequence[Path] = (),
    unit: str = "m",
) -> None:
    """Check the names of the files to write a surface to, before work is spent.

    Raises InputError for an unknown format, a name given twice, a file that is read (also one that
    a .conf file names), and STEP where OpenCASCADE is not installed; ExportError where no file can
    be written.
    """
    read = list(inputs)
    for path in inputs:
        if path.suffix.lower() == ".conf" and path.is_file():
            read += placed_scans(path, unit)
    check_apart([*outputs, *reports])
    check_suffixes(outputs)
    for path in outputs:
        check_output(path, inputs=read)
    for report in reports:
        check_output(report, (".html", ".json"), read)

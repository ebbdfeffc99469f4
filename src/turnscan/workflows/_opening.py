"""Opening a scan file to look at it."""

from __future__ import annotations

from pathlib import Path

from turnscan.scan import Scan


def open_scan(path: str | Path) -> Scan:
    """Open a scan file for reading, also while it is being written.

    Parameters
    ----------
    path
        The scan file (.turnscan).

    Returns
    -------
    Scan
        Its frames, angles, rig, settings and edits; use it as a context manager.

    Raises
    ------
    InputError
        Where no such file, or it is something else.
    ScanError
        Where it is damaged, or was written by a later turnscan.

    >>> import turnscan as ts
    >>> with ts.open_scan("cup.turnscan") as scan:
    ...     len(scan), scan.frame(5).lit.shape
    (24, (240, 320))
    """
    return Scan.open(path)

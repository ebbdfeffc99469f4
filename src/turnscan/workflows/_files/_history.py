"""Where the edits of a reconstruction come from: the scan itself, another scan, or a file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from turnscan.edit import (
    ChangeSettings,
    Entry,
    History,
    SetEdit,
    history_from_json,
    history_from_log,
)
from turnscan.errors import FormatError, InputError
from turnscan.scan import Scan, is_scan
from turnscan.workflows._files._reading import read_bytes

_MOST_BYTES = 64 << 20


def history_of(scan: Scan) -> History:
    """The edits kept in a scan file. Raises ScanCorrupt and FormatError, ScanNewer."""
    return history_from_log((entry.text for entry in scan.edits()), str(scan.path))


def repairs(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """The edits of grid and mesh, and the measurements: all but those of settings."""
    return tuple(e for e in entries if not isinstance(e.edit, ChangeSettings | SetEdit))


def refuse_over_repairs(path: Path) -> None:
    """Raise InputError where a scan with repairs by hand stands at ``path``, which a new scan of
    that name would take with it. A file that is no scan is left to whoever writes."""
    if not path.is_file() or not is_scan(path):
        return
    with Scan.open(path) as scan:
        count = len(repairs(history_of(scan).enabled))
    if count:
        raise InputError(
            f"{path}: holds {count} repair{'s' * (count > 1)} by hand, which would be lost",
            hint="write to another name, and copy them with turnscan edits; or remove that file",
        )


def wanted_history(scan: Scan, asked: str) -> History:
    """``own``, ``none``, or the edits of another scan file or of a JSON file.

    Raises InputError where no such file, FormatError, ScanNewer, ScanCorrupt.
    """
    if asked == "none":
        return History()
    return history_of(scan) if asked == "own" else read_history(Path(asked))


def read_history(path: Path) -> History:
    """The edits of a scan file, or of a file that ``turnscan edits -o`` wrote.

    Raises InputError where no such file, FormatError, ScanNewer, ScanCorrupt.
    """
    if path.suffix.lower() != ".json":
        with Scan.open(path) as other:
            return history_of(other)
    try:
        text = read_bytes(path, _MOST_BYTES).decode()
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint="give a file of edits") from None
    return history_from_json(text, str(path))

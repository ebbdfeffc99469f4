"""The settings that a scan file keeps: those of its last reconstruction, for every door."""

from __future__ import annotations

import json
import os
import stat
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

from turnscan.errors import FormatError, InputError, ScanError, ScanNewer, TurnscanError
from turnscan.findings import Finding
from turnscan.json_text import strict_json
from turnscan.scan import Scan
from turnscan.workflows._declare import chosen, declared
from turnscan.workflows._reconstruct_options import ReconstructOptions

DEFAULT_SET = "default"
"""Name of the set that is opened with the scan."""
_LONGEST_NAME = 80
_VERSION = 1
_WRITABLE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def kept_options(scan: Scan, name: str = DEFAULT_SET) -> ReconstructOptions:
    """The options that a scan was last reconstructed with; the usual ones where it never was.

    ``name`` is that of a set of settings in the file. Raises InputError for a set that there is
    not, FormatError naming what is wrong with it, ScanNewer where only a later turnscan knows it.
    """
    sets = _kept_sets(scan)
    where = f"{scan.path}: settings"
    if name not in sets and name != DEFAULT_SET:
        there = ", ".join(sorted({DEFAULT_SET, *sets}))
        raise InputError(f"{where}: no set {name!r}", hint=f"there is {there}")
    held = sets.get(name, {})
    if not isinstance(held, dict):
        raise FormatError(f"{where}: not in the expected form", hint="choose them again")
    if set(held) - set(declared(ReconstructOptions)):
        raise _newer(where)
    try:
        return ReconstructOptions(**held)
    except InputError as e:
        raise FormatError(f"{where}: {e.message}", hint="choose them again") from None


def kept_names(scan: Scan) -> list[str]:
    """Names of the sets of settings in a scan file. Raises as `kept_options`."""
    return sorted(_kept_sets(scan))


def _kept_sets(scan: Scan) -> dict[str, Any]:
    if not scan.settings:
        return {}
    where = f"{scan.path}: settings"
    body = strict_json(scan.settings, where)
    version = body.get("version") if isinstance(body, dict) else None
    if isinstance(version, int) and version > _VERSION:
        raise _newer(where)
    sets = body.get("sets") if isinstance(body, dict) else None
    if version != _VERSION or not isinstance(sets, dict):
        raise FormatError(f"{where}: not in the expected form", hint="choose them again")
    return sets


def keep_options(scan: Scan, options: ReconstructOptions, name: str = DEFAULT_SET) -> None:
    """Keep these options as a set of a scan that is open for writing; its other sets stay.

    Sets that cannot be read are replaced.
    """
    try:
        sets = _kept_sets(scan)
    except TurnscanError:
        sets = {}
    body: Any = {"version": _VERSION, "sets": {**sets, name: asdict(options)}}
    scan.keep_settings(json.dumps(body, sort_keys=True))


def check_name(name: str) -> None:
    """Raise InputError for what is no name of a set."""
    if not name.strip() or len(name) > _LONGEST_NAME or not name.isprintable():
        hint = f"give 1 to {_LONGEST_NAME} printable characters"
        raise InputError(f"{name!r}: not a name of a set of settings", hint=hint)


def options_of(
    source: Scan | str | PathLike[str], /, name: str = DEFAULT_SET, **changes: Any
) -> ReconstructOptions:
    """The settings of a scan, with these options changed.

    Parameters
    ----------
    source
        A scan file, or an open scan.
    name
        Set of settings in the file.
    changes
        Options to change, by name.

    Returns
    -------
    ReconstructOptions
        Those the scan was last reconstructed with, or the usual ones, changed.

    Raises
    ------
    InputError
        Where there is no such file, or no such option, or an option has no such value.
    FormatError
        Where the settings in the file are damaged.

    >>> import turnscan as ts
    >>> ts.options_of("cup.turnscan", denoise=2.0).changed()
    {'denoise': 2.0}
    """
    if not isinstance(source, Scan):
        with Scan.open(source) as scan:
            return options_of(scan, name, **changes)
    return chosen(ReconstructOptions, kept_options(source, name), changes)


def store_options(
    path: Path, options: ReconstructOptions, name: str = DEFAULT_SET
) -> Finding | None:
    """Keep the options of a reconstruction in the scan file, where it has others.

    Returns a note where the file cannot be changed: it is read-only, or open elsewhere.
    """
    with Scan.open(path) as scan:
        if _has(scan, options, name):
            return None
    if not path.stat().st_mode & _WRITABLE or not os.access(path, os.W_OK):
        return _note(path, "the file is read-only")
    try:
        with Scan.resume(path) as scan:
            keep_options(scan, options, name)
    except ScanError as e:
        return _note(path, e.message)
    return None


def _has(scan: Scan, options: ReconstructOptions, name: str) -> bool:
    try:
        return kept_options(scan, name) == options
    except TurnscanError:
        return False


def _note(path: Path, why: str) -> Finding:
    text = f"these settings are not kept in the scan: {why}"
    return Finding("scan.settings-not-kept", "note", text, path.name, "give them again next time")


def _newer(where: str) -> ScanNewer:
    return ScanNewer(
        f"{where}: from a later version of turnscan", hint="update turnscan, or choose them again"
    )

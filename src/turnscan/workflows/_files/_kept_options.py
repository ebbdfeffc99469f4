"""The settings that a scan file keeps: those of its last reconstruction, for every door.

They are named sets in the file. Over them stand the edits that change settings, and those that
keep, rename and delete sets, so that all of it can be undone."""

from __future__ import annotations

import json
import os
import stat
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from typing import Any

from turnscan.edit import (
    ChangeSettings,
    DeleteSet,
    Edit,
    Entry,
    KeepSet,
    RenameSet,
    SetEdit,
    action_to_json,
    describe,
    settings_in,
)
from turnscan.errors import FormatError, InputError, ScanError, ScanNewer, TurnscanError
from turnscan.findings import Finding
from turnscan.json_text import strict_json
from turnscan.scan import Scan
from turnscan.workflows._files._history import history_of
from turnscan.workflows._options._declare import chosen, declared
from turnscan.workflows._options._reconstruct import ReconstructOptions, idle_options

DEFAULT_SET = "default"
"""Name of the set that is opened with the scan."""
OWN_SETTINGS = "own"
"""What the settings of a scan are called where ``default`` are those of turnscan."""
_LONGEST_NAME = 80
_VERSION = 1
_ONCE_IDLE = ("voxel", "spacing_by")
"""Options that earlier versions kept where they had no effect."""
_WRITABLE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def kept_options(
    scan: Scan, name: str = DEFAULT_SET, edits: Iterable[Entry] | None = None
) -> ReconstructOptions:
    """The options that a scan was last reconstructed with; the usual ones where it never was.

    ``name`` is that of a set of settings in the file. Over them stands what ``edits`` change of
    the settings and of the sets (None: those kept in the scan). Raises InputError for a set that
    there is not, FormatError naming what is wrong with it, ScanNewer where only a later turnscan
    knows it.
    """
    made = history_of(scan).enabled if edits is None else tuple(edits)
    if name == DEFAULT_SET:
        edited = settings_in(made)
        if edited is not None:
            entry, settings = edited
            return _options_from(settings.options, f"{scan.path}: {entry.place}")
    sets = _sets_after(_kept_sets(scan), made)
    where = f"{scan.path}: settings"
    if name not in sets and name != DEFAULT_SET:
        there = ", ".join(sorted({DEFAULT_SET, *sets}))
        raise InputError(f"{where}: no set {name!r}", hint=f"there is {there}")
    return _options_from(sets.get(name, {}), where)


def _options_from(held: Any, where: str) -> ReconstructOptions:
    if not isinstance(held, Mapping):
        raise FormatError(f"{where}: not in the expected form", hint="choose them again")
    if set(held) - set(declared(ReconstructOptions)):
        raise _newer(where)
    try:
        return ReconstructOptions(**_as_now(held))
    except InputError as e:
        raise FormatError(f"{where}: {e.message}", hint="choose them again") from None


def _as_now(held: Mapping[str, Any]) -> dict[str, Any]:
    """Options as earlier versions kept them, too: with some that had no effect, and with
    tolerances without a unit."""
    idle = idle_options(held)
    out = {name: v for name, v in held.items() if name not in idle or name not in _ONCE_IDLE}
    fewer = out.get("decimate")
    if isinstance(fewer, str) and not fewer.strip().isdecimal():
        with suppress(ValueError):  # it has a unit, or is none
            out["decimate"] = f"{float(fewer):g}mm"
    return out


def kept_names(scan: Scan, edits: Iterable[Entry] | None = None) -> list[str]:
    """Names of the sets of settings in a scan file, after ``edits`` (None: those kept in it).

    Raises as `kept_options`.
    """
    made = history_of(scan).enabled if edits is None else edits
    return sorted(_sets_after(_kept_sets(scan), made))


def named_options(scan: Scan | str | PathLike[str], name: str) -> ReconstructOptions | None:
    """The options that a name stands for: ``default`` for the usual ones, or a named set.

    None for ``own``, those of the scan. Raises as `kept_options`.
    """
    if name == OWN_SETTINGS:
        return None
    return ReconstructOptions() if name == DEFAULT_SET else options_of(scan, name)


def _sets_after(sets: Mapping[str, Any], entries: Iterable[Entry]) -> dict[str, Any]:
    """Named sets after the edits that keep, rename and delete some; one there is not is left out.

    An edit before it may have been switched off.
    """
    out = dict(sets)
    for entry in entries:
        match entry.edit:
            case KeepSet(name, options):
                out[name] = dict(options)
            case RenameSet(name, to) if name in out:
                out[to] = out.pop(name)
            case DeleteSet(name):
                out.pop(name, None)
    return out


def check_set_edit(scan: Scan, entries: Iterable[Entry], wanted: Edit) -> None:
    """Raise InputError for an edit of a named set that cannot be made after these edits."""
    if not isinstance(wanted, SetEdit):
        return
    made = tuple(entries)
    names = kept_names(scan, made)
    if isinstance(wanted, KeepSet):
        same = wanted.name in names and kept_options(scan, wanted.name, made)
        if same == ReconstructOptions(**wanted.options):  # type: ignore[arg-type]
            raise InputError(f"{wanted.name!r} holds these settings already", hint="change one")
        return
    if wanted.name not in names:
        there = ", ".join(n for n in names if n != DEFAULT_SET) or "none"
        raise InputError(f"no set of settings {wanted.name!r}", hint=f"named sets: {there}")
    if isinstance(wanted, RenameSet) and wanted.to in names:
        hint = "choose another name, or delete that set first"
        raise InputError(f"there is a set {wanted.to!r} already", hint=hint)


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


def settings_edit(options: ReconstructOptions, name: str = DEFAULT_SET) -> ChangeSettings:
    """The edit that makes a surface with these options, taken from the set ``name``.

    Lengths and angles are real numbers in it, however they were written.
    """
    kinds = declared(options)
    held = {
        key: float(value) if kinds[key].kind == "number" and value is not None else value
        for key, value in asdict(options).items()
    }
    return ChangeSettings(held, name)


def checked_edit(wanted: Edit) -> Edit:
    """An edit as it is kept: one of settings holds every option, those left out at their default.

    Raises InputError for an option that there is not, or that has no such value, and for a name
    that no set can have.
    """
    if isinstance(wanted, SetEdit):
        name = _own_name(wanted.name)
        wanted = replace(wanted, name=name) if isinstance(wanted, KeepSet) else wanted
    if isinstance(wanted, RenameSet):
        wanted = replace(wanted, to=_own_name(wanted.to))
    if not isinstance(wanted, ChangeSettings | KeepSet):
        return wanted
    check_name(wanted.name)
    whole = settings_edit(chosen(ReconstructOptions, None, wanted.options), wanted.name)
    return whole if isinstance(wanted, ChangeSettings) else KeepSet(whole.name, whole.options)


def _own_name(name: str) -> str:
    """A name without blanks at its ends. Raises InputError where it is none."""
    check_name(name)
    name = name.strip()
    if name in (DEFAULT_SET, OWN_SETTINGS):
        raise InputError(f"{name!r}: not the name of a set of one's own", hint="choose another")
    return name


def edit_in_words(edit: Edit) -> str:
    """What an edit does, in a few words; of settings, those that are not the usual ones."""
    if not isinstance(edit, ChangeSettings | KeepSet):
        return describe(edit)
    usual = {name: option.default for name, option in declared(ReconstructOptions).items()}
    other = [f"{k} {v}" for k, v in edit.options.items() if v != usual.get(k)]
    if isinstance(edit, KeepSet):
        return f"{describe(edit)}: {', '.join(other) or 'all default'}"
    of = "" if edit.name == DEFAULT_SET else f" of set {edit.name!r}"
    return f"settings{of}: {', '.join(other) or 'all default'}"


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

    Where an edit says what this set is, another edit says so from now on: undo leads back.
    Returns a note where the file cannot be changed: it is read-only, or open elsewhere.
    """
    with Scan.open(path) as scan:
        if _has(scan, options, name):
            return None
    if not path.stat().st_mode & _WRITABLE or not os.access(path, os.W_OK):
        return _note(path, "the file is read-only")
    try:
        with Scan.resume(path) as scan:
            history = history_of(scan)
            if _is_edited(history.enabled, name):
                edit = settings_edit(options)
                kept = edit if name == DEFAULT_SET else KeepSet(name, edit.options)
                scan.append_edit(action_to_json(history.add(kept)), time.time())
            else:
                keep_options(scan, options, name)
    except ScanError as e:
        return _note(path, e.message)
    return None


def _is_edited(entries: Iterable[Entry], name: str) -> bool:
    """Whether an edit that counts says what a set of settings is."""
    made = tuple(entries)
    if name == DEFAULT_SET:
        return settings_in(made) is not None
    sets = (e.edit for e in made if isinstance(e.edit, SetEdit))
    return any(name in (s.name, getattr(s, "to", None)) for s in sets)


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

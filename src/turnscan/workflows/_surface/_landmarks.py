"""Points picked by hand in several poses, from CSV or JSON."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import FormatError
from turnscan.workflows._files._reading import read_bytes

_MOST_BYTES = 2**20
_HINT = "rows `point,pose,x,y,z` in CSV, or JSON {point: {pose: [x, y, z]}}; mm"
_COLUMNS = ["point", "pose", "x", "y", "z"]


def read_landmarks(path: Path) -> dict[str, dict[str, Floats]]:
    """Name of a point → name of a pose (its file, without the suffix) → (3,) mm in its own frame.

    Raises InputError where no such file, FormatError naming the line or the point.
    """
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint=_HINT) from None
    return _from_json(text, path) if path.suffix.lower() == ".json" else _from_csv(text, path)


def _from_csv(text: str, path: Path) -> dict[str, dict[str, Floats]]:
    out: dict[str, dict[str, Floats]] = {}
    for number, row in enumerate(csv.reader(text.splitlines()), start=1):
        words = [w.strip() for w in row]
        if not any(words) or words == _COLUMNS:
            continue
        where = f"{path}, line {number}"
        if len(words) != len(_COLUMNS):
            raise FormatError(f"{where}: {len(words)} columns, not {len(_COLUMNS)}", hint=_HINT)
        _add(out, words[0], words[1], words[2:], where)
    return out


def _from_json(text: str, path: Path) -> dict[str, dict[str, Floats]]:
    try:
        held = json.loads(text)
    except (ValueError, RecursionError) as e:
        raise FormatError(f"{path}: not JSON ({e})", hint=_HINT) from None
    out: dict[str, dict[str, Floats]] = {}
    for name, seen in held.items() if isinstance(held, dict) else [("", None)]:
        if not isinstance(seen, dict):
            raise FormatError(f"{path}: {name or 'the file'} is not an object", hint=_HINT)
        for pose, place in seen.items():
            _add(out, name, pose, place, f"{path}: {name}, {pose}")
    return out


def _add(
    out: dict[str, dict[str, Floats]], name: str, pose: str, place: object, where: str
) -> None:
    try:
        values = [float(x) for x in place]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        values = []
    if len(values) != 3 or not all(math.isfinite(x) for x in values):
        raise FormatError(f"{where}: {place!r} is not three numbers", hint=_HINT)
    seen = out.setdefault(name, {})
    if pose in seen:
        raise FormatError(f"{where}: point {name} given twice for {pose}", hint="keep one")
    seen[pose] = np.array(values)

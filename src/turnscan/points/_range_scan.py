"""Range scans of other scanners: Cyberware-style PLY and generic PLY."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints, frozen
from turnscan.errors import FormatError, LimitExceeded
from turnscan.points._grid import RangeGrid
from turnscan.rig import Pose

_MAX_POINTS = 50_000_000
_MAX_CELLS = 200_000_000
_MAX_HEADER = 64 * 1024
_FAR = 1e5
"""mm: where the eye of a scanner with parallel rays is put, along its viewing direction."""
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_HINT = "the file is damaged or not a PLY range scan; fetch it again"


@dataclass(frozen=True)
class RangeScan:
    """Points of one view of another scanner, in that scan's own frame, mm."""

    name: str
    points: Floats
    """(v, 3) mm."""
    grid: Ints | None
    """(rows, columns) index into ``points``, −1 where nothing was measured; None for loose points
    or a mesh."""
    faces: Ints | None = None
    """(f, 3) triangles where the file has them, else None."""

    def __post_init__(self) -> None:
        v = len(self.points)
        put = object.__setattr__
        put(self, "points", frozen(self.points, (v, 3), "RangeScan.points"))
        for name, shape in (("grid", (None, None)), ("faces", (None, 3))):
            index = getattr(self, name)
            if index is not None:
                index = frozen(index, shape, f"RangeScan.{name}", np.int32)
                if index.size and (index.min() < -1 or index.max() >= v):
                    raise ValueError(f"RangeScan.{name}: index outside 0 to {v - 1}")
                put(self, name, index)

    def range_grid(self, placement: Pose | None = None) -> RangeGrid:
        """The scan as a range grid, placed in the common frame: columns are steps, rows lines.

        The rays of these scanners are taken as parallel to the scan's z axis, from +z. Raises
        FormatError for a scan without a grid.
        """
        if self.grid is None:
            raise FormatError(f"{self.name}: the points of this file are not ordered in a grid")
        place = placement or Pose()
        index = self.grid.T
        there = index >= 0
        points = np.full((*index.shape, 3), np.nan)
        points[there] = place.apply(self.points)[index[there]]
        s, n = index.shape
        nothing = np.full((s, n), np.nan)
        return RangeGrid(
            laser=self.name,
            steps=np.arange(s, dtype=np.int32),
            angles=np.zeros(s),
            points=points,
            sigma=nothing,
            amplitude=nothing,
            flags=np.where(there, 0, 1).astype(np.uint16),
            closed=False,
            eyes=np.broadcast_to(place.apply([0.0, 0.0, _FAR]), (s, 3)),
        )


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    length: str | None
    """Type of the count of a list property; None for a single number."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True)
class _Header:
    form: Literal["ascii", "binary_little_endian", "binary_big_endian"]
    elements: tuple[_Element, ...]
    rows: int | None
    columns: int | None
    body: int
    """Where the numbers begin, bytes."""


def range_scan_from_ply(data: bytes, name: str = "scan", *, scale: float = 1.0) -> RangeScan:
    """Read one range scan from the bytes of a PLY file, ascii or binary.

    Understood are Cyberware scans (``obj_info num_cols`` / ``num_rows`` and a ``range_grid``
    element) and plain vertices with or without faces. ``scale`` turns the file's unit into mm
    (1000 for metres). Raises FormatError for anything else, LimitExceeded for sizes beyond reason.
    """
    head = _header(data, name)
    tables = _ascii(data, head, name) if head.form == "ascii" else _binary(data, head, name)
    vertices = tables.get("vertex")
    if vertices is None or not {"x", "y", "z"} <= set(vertices):
        raise FormatError(f"{name}: no element vertex with x, y, z", hint=_HINT)
    xyz = np.stack([np.asarray(vertices[c], dtype=np.float64) for c in "xyz"], axis=-1)
    if not np.isfinite(xyz).all():
        bad = int(np.argwhere(~np.isfinite(xyz))[0, 0])
        raise FormatError(f"{name}: vertex {bad} is not a finite point", hint=_HINT)
    try:
        return RangeScan(name, xyz * scale, _cells(tables, head, name), _triangles(tables))
    except ValueError as e:
        raise FormatError(f"{name}: {e}", hint=_HINT) from None


Table = dict[str, npt.NDArray[np.float64] | tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]


def _cells(tables: dict[str, Table], head: _Header, name: str) -> Ints | None:
    cells = tables.get("range_grid")
    if cells is None:
        return None
    if head.rows is None or head.columns is None:
        raise FormatError(f"{name}: range_grid without num_rows and num_cols", hint=_HINT)
    lists = [v for v in cells.values() if isinstance(v, tuple)]
    if len(lists) != 1 or len(lists[0][0]) != head.rows * head.columns:
        raise FormatError(
            f"{name}: range_grid is not {head.rows} × {head.columns} lists of vertices", hint=_HINT
        )
    counts, values = lists[0]
    if counts.max(initial=0) > 1:
        raise FormatError(f"{name}: a cell of range_grid holds {counts.max()} points", hint=_HINT)
    index = np.full(len(counts), -1, dtype=np.int32)
    index[counts == 1] = values
    return index.reshape(head.rows, head.columns)


def _triangles(tables: dict[str, Table]) -> Ints | None:
    faces = tables.get("face")
    lists = [v for v in (faces or {}).values() if isinstance(v, tuple)]
    if not lists:
        return None
    counts, values = lists[0]
    if (counts != 3).any():
        raise ValueError("faces that are not triangles")
    return values.reshape(-1, 3).astype(np.int32)


def _header(data: bytes, name: str) -> _Header:
    end = re.search(rb"^end_header[ \t]*\r?\n", data[:_MAX_HEADER], re.MULTILINE)
    if not re.match(rb"ply\s*\n", data) or end is None:
        raise FormatError(f"{name}: not a PLY file (no 'ply' … 'end_header')", hint=_HINT)
    lines = data[: end.start()].decode("ascii", "replace").splitlines()[1:]
    form, info = "", {}
    elements: list[tuple[str, int, list[_Property]]] = []
    for text in lines:
        match text.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as f, "1.0"]:
                form = f
            case ["obj_info", key, value]:
                info[key] = value
            case ["element", element, count] if count.isascii() and count.isdigit():
                elements.append((element, int(count), []))
            case ["property", "list", length, kind, prop] if elements:
                elements[-1][2].append(_Property(prop, _kind(kind, name), _kind(length, name)))
            case ["property", kind, prop] if elements:
                elements[-1][2].append(_Property(prop, _kind(kind, name), None))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise FormatError(f"{name}: header line {text[:60]!r}", hint=_HINT)
    rows, columns = _size(info, name)
    if not form:
        raise FormatError(f"{name}: no line 'format ascii|binary_… 1.0'", hint=_HINT)
    _check_sizes(elements, (rows or 0) * (columns or 0), len(data), name)
    return _Header(
        form,  # type: ignore[arg-type]
        tuple(_Element(e, c, tuple(p)) for e, c, p in elements),
        rows,
        columns,
        end.end(),
    )


def _check_sizes(
    elements: list[tuple[str, int, list[_Property]]], cells: int, size: int, name: str
) -> None:
    most = max((c for _, c, _ in elements), default=0)
    if max(most, cells) > _MAX_CELLS:
        raise LimitExceeded(f"{name}: {max(most, cells)} entries; at most {_MAX_CELLS} are read")
    if any(e == "vertex" and c > _MAX_POINTS for e, c, _ in elements):
        raise LimitExceeded(f"{name}: more than {_MAX_POINTS} points")
    if most > size:
        raise FormatError(f"{name}: {most} entries announced in {size} bytes", hint=_HINT)


def _size(info: dict[str, str], name: str) -> tuple[int | None, int | None]:
    size = [info.get(k) for k in ("num_rows", "num_cols")]
    if any(v is not None and not (v.isascii() and v.isdigit()) for v in size):
        raise FormatError(f"{name}: num_rows, num_cols are {size}", hint=_HINT)
    rows, columns = (None if v is None else int(v) for v in size)
    return rows, columns


def _kind(word: str, name: str) -> str:
    if word not in _TYPES:
        raise FormatError(f"{name}: unknown number type {word[:20]!r}", hint=_HINT)
    return _TYPES[word]


def _ascii(data: bytes, head: _Header, name: str) -> dict[str, Table]:
    try:
        numbers = np.array(data[head.body :].split(), dtype=np.float64)
    except ValueError as e:
        raise FormatError(f"{name}: {e}", hint=_HINT) from None
    tables: dict[str, Table] = {}
    at = 0
    for element in head.elements:
        width = len(element.properties)
        if all(p.length is None for p in element.properties):
            end = at + element.count * width
            if end > len(numbers):
                raise FormatError(_short(name, element), hint=_HINT)
            block = numbers[at:end].reshape(element.count, width)
            tables[element.name] = {p.name: block[:, i] for i, p in enumerate(element.properties)}
        elif width == 1:
            counts, values, end = _lists(numbers, at, element, name)
            tables[element.name] = {element.properties[0].name: (counts, values)}
        else:
            raise FormatError(f"{name}: element {element.name} mixes lists and numbers", hint=_HINT)
        at = end
    return tables


def _lists(
    numbers: Floats, at: int, element: _Element, name: str
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]:
    """Counts and values of lists that stand one after another from ``at``."""
    counts = np.empty(element.count, dtype=np.int64)
    places = np.empty(element.count, dtype=np.int64)
    total = len(numbers)
    # One short step for each list: where a list begins is known only from the one before.
    words = numbers.tolist() if element.count else []
    for i in range(element.count):
        if at >= total or not 0 <= words[at] <= total - at - 1 or words[at] % 1:
            raise FormatError(_short(name, element), hint=_HINT)
        counts[i] = words[at]
        places[i] = at
        at += 1 + int(words[at])
    starts = np.repeat(places + 1 - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    values = numbers[starts + np.arange(int(counts.sum()))].astype(np.int64)
    return counts, values, at


def _binary(data: bytes, head: _Header, name: str) -> dict[str, Table]:
    order = "<" if head.form == "binary_little_endian" else ">"
    tables: dict[str, Table] = {}
    at = head.body
    for element in head.elements:
        if all(p.length is None for p in element.properties):
            row = np.dtype([(p.name, order + p.kind) for p in element.properties])
            if at + element.count * row.itemsize > len(data):
                raise FormatError(_short(name, element), hint=_HINT)
            block = np.frombuffer(data, row, element.count, at)
            tables[element.name] = {
                p.name: block[p.name].astype(np.float64) for p in element.properties
            }
            at += element.count * row.itemsize
        elif len(element.properties) == 1:
            counts, values, at = _binary_lists(data, at, element, order, name)
            tables[element.name] = {element.properties[0].name: (counts, values)}
        else:
            raise FormatError(f"{name}: element {element.name} mixes lists and numbers", hint=_HINT)
    return tables


def _binary_lists(
    data: bytes, at: int, element: _Element, order: str, name: str
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]:
    prop = element.properties[0]
    count_type, value_type = np.dtype(order + str(prop.length)), np.dtype(order + prop.kind)
    if count_type.kind == "f" or value_type.kind == "f":
        raise FormatError(f"{name}: element {element.name}: lists of floats", hint=_HINT)
    wide, narrow = count_type.itemsize, value_type.itemsize
    endian: Literal["little", "big"] = "little" if order == "<" else "big"
    counts = np.empty(element.count, dtype=np.int64)
    pieces = []
    for i in range(element.count):
        n = int.from_bytes(data[at : at + wide], endian)
        start, at = at + wide, at + wide + n * narrow
        if at > len(data):
            raise FormatError(_short(name, element), hint=_HINT)
        counts[i] = n
        pieces.append(data[start:at])
    values = np.frombuffer(b"".join(pieces), value_type).astype(np.int64)
    return counts, values, at


def _short(name: str, element: _Element) -> str:
    return f"{name}: the file ends inside its {element.count} entries of {element.name}"

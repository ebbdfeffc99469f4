"""The numbers in a PLY file, as tables of its elements; bounds are checked before they are read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import FormatError, LimitExceeded

_MAX_POINTS = 50_000_000
_MAX_CELLS = 200_000_000
_MAX_HEADER = 64 * 1024
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
HINT = "the file is damaged or not a PLY range scan; fetch it again"

Table = dict[str, npt.NDArray[np.float64] | tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]


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
class Header:
    """What the header says: form, elements, size of the scanner's grid, and where it ends."""

    form: Literal["ascii", "binary_little_endian", "binary_big_endian"]
    elements: tuple[_Element, ...]
    rows: int | None
    columns: int | None
    body: int
    """Where the numbers begin, bytes."""


def read_tables(data: bytes, name: str) -> tuple[Header, dict[str, Table]]:
    """Header and numbers of a PLY file, ascii or binary. Raises FormatError, LimitExceeded."""
    head = _header(data, name)
    return head, _ascii(data, head, name) if head.form == "ascii" else _binary(data, head, name)


def _header(data: bytes, name: str) -> Header:
    end = re.search(rb"^end_header[ \t]*\r?\n", data[:_MAX_HEADER], re.MULTILINE)
    if not re.match(rb"ply\s*\n", data) or end is None:
        raise FormatError(f"{name}: not a PLY file (no 'ply' … 'end_header')", hint=HINT)
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
                raise FormatError(f"{name}: header line {text[:60]!r}", hint=HINT)
    rows, columns = _size(info, name)
    if not form:
        raise FormatError(f"{name}: no line 'format ascii|binary_… 1.0'", hint=HINT)
    _check_sizes(elements, (rows or 0) * (columns or 0), len(data), name)
    return Header(
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
        raise FormatError(f"{name}: {most} entries announced in {size} bytes", hint=HINT)


def _size(info: dict[str, str], name: str) -> tuple[int | None, int | None]:
    size = [info.get(k) for k in ("num_rows", "num_cols")]
    if any(v is not None and not (v.isascii() and v.isdigit()) for v in size):
        raise FormatError(f"{name}: num_rows, num_cols are {size}", hint=HINT)
    rows, columns = (None if v is None else int(v) for v in size)
    return rows, columns


def _kind(word: str, name: str) -> str:
    if word not in _TYPES:
        raise FormatError(f"{name}: unknown number type {word[:20]!r}", hint=HINT)
    return _TYPES[word]


def _ascii(data: bytes, head: Header, name: str) -> dict[str, Table]:
    try:
        numbers = np.array(data[head.body :].split(), dtype=np.float64)
    except ValueError as e:
        raise FormatError(f"{name}: {e}", hint=HINT) from None
    tables: dict[str, Table] = {}
    at = 0
    for element in head.elements:
        width = len(element.properties)
        if all(p.length is None for p in element.properties):
            end = at + element.count * width
            if end > len(numbers):
                raise FormatError(_short(name, element), hint=HINT)
            block = numbers[at:end].reshape(element.count, width)
            tables[element.name] = {p.name: block[:, i] for i, p in enumerate(element.properties)}
        elif width == 1:
            counts, values, end = _lists(numbers, at, element, name)
            tables[element.name] = {element.properties[0].name: (counts, values)}
        else:
            raise FormatError(f"{name}: element {element.name} mixes lists and numbers", hint=HINT)
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
            raise FormatError(_short(name, element), hint=HINT)
        counts[i] = words[at]
        places[i] = at
        at += 1 + int(words[at])
    starts = np.repeat(places + 1 - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    values = numbers[starts + np.arange(int(counts.sum()))].astype(np.int64)
    return counts, values, at


def _binary(data: bytes, head: Header, name: str) -> dict[str, Table]:
    order = "<" if head.form == "binary_little_endian" else ">"
    tables: dict[str, Table] = {}
    at = head.body
    for element in head.elements:
        if all(p.length is None for p in element.properties):
            row = np.dtype([(p.name, order + p.kind) for p in element.properties])
            if at + element.count * row.itemsize > len(data):
                raise FormatError(_short(name, element), hint=HINT)
            block = np.frombuffer(data, row, element.count, at)
            tables[element.name] = {
                p.name: block[p.name].astype(np.float64) for p in element.properties
            }
            at += element.count * row.itemsize
        elif len(element.properties) == 1:
            counts, values, at = _binary_lists(data, at, element, order, name)
            tables[element.name] = {element.properties[0].name: (counts, values)}
        else:
            raise FormatError(f"{name}: element {element.name} mixes lists and numbers", hint=HINT)
    return tables


def _binary_lists(
    data: bytes, at: int, element: _Element, order: str, name: str
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]:
    prop = element.properties[0]
    count_type, value_type = np.dtype(order + str(prop.length)), np.dtype(order + prop.kind)
    if count_type.kind == "f" or value_type.kind == "f":
        raise FormatError(f"{name}: element {element.name}: lists of floats", hint=HINT)
    wide, narrow = count_type.itemsize, value_type.itemsize
    endian: Literal["little", "big"] = "little" if order == "<" else "big"
    counts = np.empty(element.count, dtype=np.int64)
    pieces = []
    for i in range(element.count):
        n = int.from_bytes(data[at : at + wide], endian)
        start, at = at + wide, at + wide + n * narrow
        if at > len(data):
            raise FormatError(_short(name, element), hint=HINT)
        counts[i] = n
        pieces.append(data[start:at])
    values = np.frombuffer(b"".join(pieces), value_type).astype(np.int64)
    return counts, values, at


def _short(name: str, element: _Element) -> str:
    return f"{name}: the file ends inside its {element.count} entries of {element.name}"

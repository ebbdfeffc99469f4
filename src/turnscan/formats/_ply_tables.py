"""A PLY file as tables of its elements: binary of either byte order, and text.

What a reader calls the file in errors is ``name`` throughout.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools
from turnscan.errors import FormatError, InputError
from turnscan.formats._read import (
    MAX_FACES,
    MAX_HEADER,
    complain,
    require,
    text_of,
    triangles,
    within_limit,
)

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_SIZE = ("num_rows", "num_cols")
MEASURED = "measured"
Table = dict[str, npt.NDArray[np.generic]]


@dataclass
class Element:
    """What the header says of an element: its count and the types of its properties."""

    name: str
    count: int
    scalars: list[tuple[str, str]]
    """Name and type of the properties before the list, or of all."""
    list_types: tuple[str, str] | None = None
    after: list[tuple[str, str]] = field(default_factory=list)
    """Name and type of the properties after the list."""


@dataclass
class Header:
    """What the header says: byte order, elements, lasers, and where it ends."""

    order: str
    """``<``, ``>``; empty for text."""
    elements: list[Element]
    lasers: tuple[str, ...]
    grid: tuple[int | None, int | None]
    """Rows and columns of another scanner's grid; None where they are not said."""
    size: int


def read_header(name: str, data: bytes) -> Header:
    """The header of a PLY. Raises FormatError, LimitExceeded; InputError for triangle strips."""
    end = re.compile(rb"(?:^|\n)end_header[ \t]*\r?\n").search(data[:MAX_HEADER])
    require(name, data[:3] == b"ply" and end is not None, "it has no PLY header")
    assert end is not None
    order: str | None = None
    elements: list[Element] = []
    lasers: list[str] = []
    size: dict[str, int] = {}
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        words = line.split()
        if words[:1] == ["format"]:
            order = _FORMATS.get(words[1] if len(words) == 3 and words[2] == "1.0" else "")
        elif words[:1] == ["element"]:
            elements.append(_element(name, line, words))
        elif words[:1] == ["property"]:
            require(name, bool(elements), f"{line!r} appears before any element")
            _property(name, elements[-1], line, words)
        elif words[:2] == ["comment", "laser"] and len(words) > 3:
            lasers.append(" ".join(words[3:]))
        elif words[:1] == ["obj_info"] and len(words) == 3 and words[1] in _SIZE:
            require(name, _is_count(words[2]), f"{line!r} is no count")
            size[words[1]] = int(words[2])
        else:
            known = not words or words[0] in ("comment", "obj_info")
            require(name, known, f"{line!r} is not a header line")
    if order is None:
        raise FormatError(
            f"{name}: its format line is missing or unknown", hint="save as ascii or binary 1.0"
        )
    rows, columns = (size.get(key) for key in _SIZE)
    within_limit(name, "cells of its grid", (rows or 0) * (columns or 0), 3 * MAX_FACES)
    return Header(order, elements, tuple(lasers), (rows, columns), end.end())


def _is_count(word: str) -> bool:
    return re.fullmatch("[0-9]{1,18}", word) is not None


def _element(name: str, line: str, words: list[str]) -> Element:
    require(name, len(words) == 3 and _is_count(words[-1]), f"{line!r} is not an element line")
    if words[1] == "tristrips":
        raise InputError(f"{name}: it holds triangle strips", hint="save it as triangles")
    count = int(words[2])
    within_limit(name, f"of element {words[1]}", count, 3 * MAX_FACES)
    if words[1] == "face":
        within_limit(name, "faces", count)
    return Element(words[1], count, [])


def _property(name: str, element: Element, line: str, words: list[str]) -> None:
    if len(words) == 5 and words[1] == "list":
        types = _TYPES.get(words[2], "f8"), _TYPES.get(words[3], "")
        good = types[0][0] in "iu" and types[1] != "" and element.list_types is None
        require(name, good, f"{line!r} is not a list we can read")
        element.list_types = types
        return
    require(name, len(words) == 3 and words[1] in _TYPES, f"{line!r} is not a property line")
    to = element.scalars if element.list_types is None else element.after
    to.append((words[2], _TYPES[words[1]]))
    names = [known for known, _ in to]
    require(name, len(set(names)) == len(names), f"duplicate property {words[2]!r}")


def read_scalars(
    name: str, data: bytes, at: int, element: Element, order: str
) -> tuple[Table, int]:
    """The columns of an element without lists, and where it ends. Raises FormatError."""
    count, names = element.count, [column for column, _ in element.scalars]
    if order:
        kind = np.dtype([(column, order + t) for column, t in element.scalars])
        need, have = count * kind.itemsize, len(data) - at
        require(name, need <= have, f"{count} of {element.name} need {need} bytes, {have} are left")
        if not names:
            return {}, at
        records = np.frombuffer(data, kind, count, offset=at)
        return {column: records[column] for column in names}, at + need
    from turnscan.formats._read_kernels import read_table

    need, have = 2 * count * len(names), len(data) - at + 1
    require(name, need <= have, f"{count} of {element.name} cannot fit in {have} bytes")
    table = np.empty((count, len(names)))
    code, at = read_table(text_of(data), at, table, False)
    complain(name, data, code, at)
    return {column: table[:, i] for i, column in enumerate(names)}, at


def read_lists(
    name: str, data: bytes, at: int, element: Element, order: str
) -> tuple[npt.NDArray[np.int64], int]:
    """The lists of an element end to end as n i j k …, and where it ends. Raises FormatError."""
    count_type, index_type = _list_types(name, element)
    count, have = element.count, len(data) - at
    if not order:
        from turnscan.formats._read_kernels import read_lists as read_text_lists

        fits = 2 * count <= have + 1
        require(name, fits, f"{count} of {element.name} cannot fit in {have} bytes")
        before = len(element.scalars)
        code, at, lists, n = read_text_lists(text_of(data), at, count, before, MAX_FACES)
    else:
        from turnscan.formats._read_kernels import read_binary_lists

        before, after = _bytes_about(element)
        least = count * (before + np.dtype(count_type).itemsize + after)
        require(
            name, least <= have, f"{count} of {element.name} need more than the {have} bytes left"
        )
        widths = (before, int(count_type[1]), int(index_type[1]), after)
        code, at, lists, n = read_binary_lists(
            text_of(data), at, count, widths, order == "<", MAX_FACES
        )
    complain(name, data, code, at)
    return lists[:n], at


def read_triangles(
    name: str, data: bytes, at: int, element: Element, order: str
) -> tuple[npt.NDArray[np.int64], Bools | None, int]:
    """An element with one list as (t, 3) triangles, which of them were measured, and its end.

    Polygons are cut into fans; None where it is not said what was measured. Raises FormatError.
    """
    quick = _binary_triangles if order else _text_triangles
    found = quick(name, data, at, element, order)
    if found is not None:
        return found
    lists, at = read_lists(name, data, at, element, order)
    return triangles(name, lists), None, at


def _list_types(name: str, element: Element) -> tuple[str, str]:
    assert element.list_types is not None
    whole = element.list_types[1][0] in "iu" or element.name not in ("face", "range_grid")
    require(name, whole, f"the indices of element {element.name} are not integers")
    return element.list_types


def _bytes_about(element: Element) -> tuple[int, int]:
    """Bytes before and after the list of each entry."""
    before, after = (
        sum(np.dtype(t).itemsize for _, t in some) for some in (element.scalars, element.after)
    )
    return before, after


def _text_triangles(
    name: str, data: bytes, at: int, element: Element, _order: str
) -> tuple[npt.NDArray[np.int64], Bools | None, int] | None:
    """Triangles of a text with marks of what was measured; None where it is anything else."""
    names = [column for column, _ in element.after]
    if MEASURED not in names:
        return None
    from turnscan.formats._read_kernels import read_table

    count, before = element.count, len(element.scalars)
    table = np.empty((min(count, len(data) - at), before + 4 + len(names)))
    code, end = read_table(text_of(data), at, table, False)
    if code or len(table) != count or not (table[:, before] == 3).all():
        return None
    marks = table[:, before + 4 + names.index(MEASURED)] != 0
    return table[:, before + 1 : before + 4].astype(np.int64), marks, end


def _binary_triangles(
    name: str, data: bytes, at: int, element: Element, order: str
) -> tuple[npt.NDArray[np.int64], Bools | None, int] | None:
    """Triangles that stand in the file as records of equal length; None where they do not."""
    count_type, index_type = _list_types(name, element)
    before, after = _bytes_about(element)
    sizes = [before, np.dtype(count_type).itemsize, 3 * np.dtype(index_type).itemsize]
    offsets = np.cumsum(sizes + [np.dtype(t).itemsize for _, t in element.after])
    kind = np.dtype(
        {
            "names": ["size", "corners", *(f"after {column}" for column, _ in element.after)],
            "formats": [order + count_type, (order + index_type, 3)]
            + [order + t for _, t in element.after],
            "offsets": offsets[: 2 + len(element.after)].tolist(),
            "itemsize": sum(sizes) + after,
        }
    )
    end = at + element.count * kind.itemsize
    if end > len(data):
        return None
    records = np.frombuffer(data, kind, element.count, offset=at)
    if not (records["size"] == 3).all():
        return None
    here = f"after {MEASURED}"
    marked = records[here] != 0 if here in (kind.names or ()) else None
    return records["corners"].astype(np.int64), marked, end

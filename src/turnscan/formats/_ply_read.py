"""Reads PLY: binary of either byte order, and text; the elements vertex and face."""

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
    checked,
    complain,
    indexed,
    require,
    text_of,
    triangles,
    within_limit,
)
from turnscan.mesh import Mesh, Provenance

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
_MEASURED = "measured"
_Table = dict[str, npt.NDArray[np.generic]]


@dataclass
class _Element:
    name: str
    count: int
    scalars: list[tuple[str, str]]
    """Name and type of the properties before the list, or of all."""
    list_types: tuple[str, str] | None = None
    after: list[tuple[str, str]] = field(default_factory=list)
    """Name and type of the properties after the list."""


@dataclass
class _Header:
    order: str
    elements: list[_Element]
    lasers: tuple[str, ...]
    size: int


def read_ply(data: bytes) -> Mesh:
    """Return a PLY as a mesh, without faces where it has none; polygons are cut into fans.

    Colour (red, green, blue) and our sigma, laser, step and row are kept where all are there, and
    ``measured`` of the faces where all of these are triangles.

    Raises FormatError where it is not in form or announces more than it holds;
    LimitExceeded; InputError for triangle strips.
    """
    header = _header(data)
    at = header.size
    table: _Table = {}
    faces: npt.NDArray[np.int64] = np.empty((0, 3), np.int64)
    known: Bools | None = None
    for element in header.elements:
        if element.list_types is None:
            values, at = _scalars(data, at, element, header.order)
            table = values if element.name == "vertex" else table
        else:
            lists, marks, at = _lists(data, at, element, header.order)
            if element.name == "face":
                faces, known = lists, marks
    require("PLY", {"x", "y", "z"} <= table.keys(), "its vertices have no x, y, z")
    points = checked("PLY", np.stack([table[c].astype(np.float64) for c in "xyz"], axis=1))
    mesh = indexed("PLY", points, faces)
    origin, colour = _origin(table, header.lasers), _colour(table)
    return Mesh(mesh.vertices, mesh.faces, origin, colour, known)


def _header(data: bytes) -> _Header:
    end = re.compile(rb"(?:^|\n)end_header[ \t]*\r?\n").search(data[:MAX_HEADER])
    require("PLY", data[:3] == b"ply" and end is not None, "it has no PLY header")
    assert end is not None
    order: str | None = None
    elements: list[_Element] = []
    lasers: list[str] = []
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        words = line.split()
        if words[:1] == ["format"]:
            order = _FORMATS.get(words[1] if len(words) > 1 else "")
        elif words[:1] == ["element"]:
            elements.append(_element(line, words))
        elif words[:1] == ["property"]:
            require("PLY", bool(elements), f"{line!r} stands before any element")
            _property(elements[-1], line, words)
        elif words[:2] == ["comment", "laser"] and len(words) > 3:
            lasers.append(" ".join(words[3:]))
        else:
            known = not words or words[0] in ("comment", "obj_info")
            require("PLY", known, f"{line!r} is not a header line")
    if order is None:
        raise FormatError(
            "PLY: its format line is missing or unknown", hint="save as ascii or binary 1.0"
        )
    return _Header(order, elements, tuple(lasers), end.end())


def _element(line: str, words: list[str]) -> _Element:
    require(
        "PLY",
        len(words) == 3 and re.fullmatch("[0-9]{1,18}", words[-1]) is not None,
        f"{line!r} is not an element line",
    )
    if words[1] == "tristrips":
        raise InputError("PLY: it holds triangle strips", hint="save it as triangles")
    count = int(words[2])
    within_limit("PLY", f"of element {words[1]}", count, 3 * MAX_FACES)
    if words[1] == "face":
        within_limit("PLY", "faces", count)
    return _Element(words[1], count, [])


def _property(element: _Element, line: str, words: list[str]) -> None:
    if len(words) == 5 and words[1] == "list":
        types = _TYPES.get(words[2], "f8"), _TYPES.get(words[3], "")
        good = types[0][0] in "iu" and types[1] != "" and element.list_types is None
        require("PLY", good, f"{line!r} is not a list we can read")
        element.list_types = types
        return
    require("PLY", len(words) == 3 and words[1] in _TYPES, f"{line!r} is not a property line")
    if element.list_types is None:
        element.scalars.append((words[2], _TYPES[words[1]]))
        names = [name for name, _ in element.scalars]
        require("PLY", len(set(names)) == len(names), f"property {words[2]!r} stands twice")
    else:
        element.after.append((words[2], _TYPES[words[1]]))
        names = [name for name, _ in element.after]
        require("PLY", len(set(names)) == len(names), f"property {words[2]!r} stands twice")


def _scalars(data: bytes, at: int, element: _Element, order: str) -> tuple[_Table, int]:
    """Read an element without lists; returns its columns and where it ends."""
    count, names = element.count, [name for name, _ in element.scalars]
    if order:
        kind = np.dtype([(name, order + t) for name, t in element.scalars])
        need, have = count * kind.itemsize, len(data) - at
        require(
            "PLY", need <= have, f"{count} of {element.name} need {need} bytes, {have} are left"
        )
        if not names:
            return {}, at
        records = np.frombuffer(data, kind, count, offset=at)
        return {name: records[name] for name in names}, at + need
    from turnscan.formats._read_kernels import read_table

    need, have = 2 * count * len(names), len(data) - at + 1
    require("PLY", need <= have, f"{count} of {element.name} cannot fit in {have} bytes")
    table = np.empty((count, len(names)))
    code, at = read_table(text_of(data), at, table, False)
    complain("PLY", data, code, at)
    return {name: table[:, i] for i, name in enumerate(names)}, at


def _lists(
    data: bytes, at: int, element: _Element, order: str
) -> tuple[npt.NDArray[np.int64], Bools | None, int]:
    """Read an element with one list as triangles; returns them, which were measured (None where
    that is not said), and where it ends."""
    assert element.list_types is not None
    count_type, index_type = element.list_types
    count, have = element.count, len(data) - at
    if not order:
        from turnscan.formats._read_kernels import read_lists, read_table

        if _MEASURED in [name for name, _ in element.after]:
            before = len(element.scalars)
            table = np.empty((min(count, have), before + 4 + len(element.after)))
            code, end = read_table(text_of(data), at, table, False)
            if code == 0 and len(table) == count and (table[:, before] == 3).all():
                names = [name for name, _ in element.after]
                marks = table[:, before + 4 + names.index(_MEASURED)] != 0
                return table[:, before + 1 : before + 4].astype(np.int64), marks, end
        require("PLY", 2 * count <= have + 1, f"{count} faces cannot fit in {have} bytes")
        code, at, lists, n = read_lists(text_of(data), at, count, len(element.scalars), MAX_FACES)
        complain("PLY", data, code, at)
        return triangles("PLY", lists[:n]), None, at
    require("PLY", index_type[0] in "iu" or element.name != "face", "face indices are not integers")
    before = sum(np.dtype(t).itemsize for _, t in element.scalars)
    after = sum(np.dtype(t).itemsize for _, t in element.after)
    least = before + np.dtype(count_type).itemsize + after
    require("PLY", count * least <= have, f"{count} faces need more than the {have} bytes left")
    kind = np.dtype(
        {
            "names": ["size", "corners", *(f"after {name}" for name, _ in element.after)],
            "formats": [order + count_type, (order + index_type, 3)]
            + [order + t for _, t in element.after],
            "offsets": np.cumsum(
                [before, np.dtype(count_type).itemsize, 3 * np.dtype(index_type).itemsize]
                + [np.dtype(t).itemsize for _, t in element.after]
            )[: 2 + len(element.after)].tolist(),
            "itemsize": least + 3 * np.dtype(index_type).itemsize,
        }
    )
    if count * kind.itemsize <= have:
        records = np.frombuffer(data, kind, count, offset=at)
        if (records["size"] == 3).all():
            here = f"after {_MEASURED}"
            marked = records[here] != 0 if here in (kind.names or ()) else None
            return records["corners"].astype(np.int64), marked, at + count * kind.itemsize
    from turnscan.formats._read_kernels import read_binary_lists

    widths = (before, int(count_type[1]), int(index_type[1]), after)
    code, at, lists, n = read_binary_lists(
        text_of(data), at, count, widths, order == "<", MAX_FACES
    )
    complain("PLY", data, code, at)
    return triangles("PLY", lists[:n]), None, at


def _colour(table: _Table) -> npt.NDArray[np.uint8] | None:
    names = ("red", "green", "blue")
    if not all(name in table for name in names):
        return None
    columns = np.stack([table[name].astype(np.float64) for name in names], axis=1)
    whole = ((columns >= 0) & (columns <= 255) & (columns == np.rint(columns))).all()
    return columns.astype(np.uint8) if whole else None


def _origin(table: _Table, lasers: tuple[str, ...]) -> Provenance | None:
    if not all(name in table for name in ("sigma", "laser", "step", "row")):
        return None
    numbers = [table[name].astype(np.float64) for name in ("laser", "step", "row")]
    good = all((np.abs(n) < 2**31).all() for n in numbers)
    sigma = table["sigma"].astype(np.float64)
    require("PLY", good and not np.isinf(sigma).any(), "sigma, laser, step or row is out of range")
    laser, step, row = (n.astype(np.int32) for n in numbers)
    return Provenance(sigma, laser, step, row, lasers)

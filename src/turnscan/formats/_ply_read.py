"""Reads PLY: meshes, points, and the range grids of other scanners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.formats._ply_tables import (
    Element,
    Header,
    Table,
    read_header,
    read_lists,
    read_scalars,
    read_triangles,
)
from turnscan.formats._read import checked, indexed, require
from turnscan.mesh import Mesh, Provenance

_AXES = ("x", "y", "z")


def read_ply(data: bytes) -> Mesh:
    """Return a PLY as a mesh, without faces where it has none; polygons are cut into fans.

    Colour (red, green, blue) and our sigma, laser, step and row are kept where all are there, and
    ``measured`` of the faces where all of these are triangles.

    Raises FormatError where it is not in form or announces more than it holds;
    LimitExceeded; InputError for triangle strips.
    """
    read = _read("PLY", data)
    mesh = indexed("PLY", read.points, read.faces)
    origin, colour = _origin(read.vertices, read.header.lasers), _colour(read.vertices)
    return Mesh(mesh.vertices, mesh.faces, origin, colour, read.measured)


@dataclass(frozen=True)
class RangePly:
    """What the PLY of another scanner holds, in the file's own unit."""

    points: Floats
    """(v, 3)."""
    faces: Ints
    """(f, 3) triangles; f is 0 where the file has none."""
    grid: Ints | None
    """(rows, columns) index into ``points``, −1 where nothing was measured; None without one."""


def read_range_ply(data: bytes, name: str) -> RangePly:
    """Return a range scan: vertices with faces, or ordered by a ``range_grid`` element.

    That element, and ``obj_info num_cols`` and ``num_rows``, are Cyberware's way. ``name`` is what
    errors call the file. Raises FormatError, InputError and LimitExceeded as `read_ply`.
    """
    read = _read(name, data)
    mesh = indexed(name, read.points, read.faces)
    return RangePly(mesh.vertices, mesh.faces, _grid(name, read))


@dataclass(frozen=True)
class _Read:
    """The elements that we know."""

    header: Header
    points: Floats
    vertices: Table
    faces: npt.NDArray[np.int64]
    measured: Bools | None
    cells: npt.NDArray[np.int64] | None


def _read(name: str, data: bytes) -> _Read:
    header = read_header(name, data)
    at = header.size
    vertices: Table = {}
    faces: npt.NDArray[np.int64] = np.empty((0, 3), np.int64)
    measured: Bools | None = None
    cells: npt.NDArray[np.int64] | None = None
    for element in header.elements:
        if element.list_types is None:
            values, at = read_scalars(name, data, at, element, header.order)
            vertices = values if element.name == "vertex" else vertices
        elif element.name == "face":
            faces, measured, at = read_triangles(name, data, at, element, header.order)
        else:
            lists, at = read_lists(name, data, at, element, header.order)
            cells = _cells(name, element, lists) if element.name == "range_grid" else cells
    require(name, vertices.keys() >= set(_AXES), "its vertices have no x, y, z")
    points = checked(name, np.stack([vertices[c].astype(np.float64) for c in _AXES], axis=1))
    return _Read(header, points, vertices, faces, measured, cells)


def _cells(name: str, element: Element, lists: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """(c,) the vertex in each cell of a grid, −1 for none."""
    from turnscan.formats._read_kernels import cells

    found: npt.NDArray[np.int64]
    most, found = cells(lists, element.count)
    require(name, most <= 1, f"a cell of range_grid holds {most} points")
    return found


def _grid(name: str, read: _Read) -> Ints | None:
    if read.cells is None:
        return None
    rows, columns = read.header.grid
    if rows is None or columns is None:
        require(name, False, "range_grid without num_rows and num_cols")
    good = len(read.cells) == (rows or 0) * (columns or 0)
    require(name, good, f"range_grid is not {rows} × {columns} lists of vertices")
    inside = (read.cells < len(read.points)).all() and (read.cells >= -1).all()
    require(name, bool(inside), f"range_grid: index outside 0 to {len(read.points) - 1}")
    return read.cells.astype(np.int32).reshape(rows or 0, columns or 0)


def _colour(table: Table) -> npt.NDArray[np.uint8] | None:
    names = ("red", "green", "blue")
    if not all(name in table for name in names):
        return None
    columns = np.stack([table[name].astype(np.float64) for name in names], axis=1)
    whole = ((columns >= 0) & (columns <= 255) & (columns == np.rint(columns))).all()
    return columns.astype(np.uint8) if whole else None


def _origin(table: Table, lasers: tuple[str, ...]) -> Provenance | None:
    if not all(name in table for name in ("sigma", "laser", "step", "row")):
        return None
    numbers = [table[name].astype(np.float64) for name in ("laser", "step", "row")]
    good = all((np.abs(n) < 2**31).all() for n in numbers)
    sigma = table["sigma"].astype(np.float64)
    require("PLY", good and not np.isinf(sigma).any(), "sigma, laser, step or row is out of range")
    laser, step, row = (n.astype(np.int32) for n in numbers)
    return Provenance(sigma, laser, step, row, lasers)

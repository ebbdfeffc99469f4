"""Reads the faces and polylines of a text DXF, ours or another's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.errors import FormatError, InputError
from turnscan.formats._read import (
    MAX_FACES,
    Text,
    complain,
    indexed,
    require,
    soup,
    text_of,
    triangles,
    within_limit,
    words,
)
from turnscan.mesh import Mesh

_MARKS = ("SECTION", "ENTITIES", "ENDSEC", "EOF")
_WORDS = ("3DFACE", "POLYLINE", "VERTEX", "MESH", "POINT")
_FACE, _POLYLINE, _VERTEX, _MESH, _POINT = range(len(_WORDS))
_FILLED = "_FILLED_"
_CLOSED_M, _LINE, _GRID, _CLOSED_N, _POLYFACE = 1, 8, 16, 32, 64
"""Bits of a polyline's group 70."""
_CONTROL, _PLACE, _RECORD = 16, 64, 128
"""Bits of a vertex's group 70: spline frame, has a position, belongs to a polyface."""
_Triangles = npt.NDArray[np.int64]


@dataclass(frozen=True)
class DxfContent:
    """What the ENTITIES section draws; vertices of triangles in mm, in the order of the file."""

    faces: Floats
    """(3f, 3) of 3DFACEs, a quadrilateral as two triangles."""
    polyfaces: Floats
    """(3f, 3) of polyface meshes and polygon meshes."""
    meshes: Floats
    """(3f, 3) of MESH entities, without subdivision."""
    runs: tuple[Floats, ...]
    """(k, 3) of each 3-D polyline, and of each POINT."""
    filled: Bools
    """(f,) True for triangles, in the order of `corners`, on a layer for what was not measured."""
    entities: int

    @property
    def corners(self) -> Floats:
        """(3f, 3): of all triangles."""
        return np.concatenate([self.faces, self.polyfaces, self.meshes])


def read_dxf(data: bytes) -> Mesh:
    """Return all faces in the ENTITIES section of a text DXF as one mesh.

    Faces on a layer that has _FILLED_ in its name count as not measured.

    Raises FormatError where the file is not a sound text DXF; LimitExceeded; InputError where
    it draws no face.
    """
    content = read_dxf_content(data)
    if not len(content.corners):
        raise InputError(
            f"DXF: none of its {content.entities} entities is a 3DFACE, polyface or MESH",
            hint="export the surface as faces; blocks and solids (ACIS) are not read",
        )
    mesh = soup("DXF", content.corners)
    return replace(mesh, measured=~content.filled) if content.filled.any() else mesh


def read_dxf_content(data: bytes) -> DxfContent:
    """Return what a text DXF draws, form by form; raises as `read_dxf` does."""
    from turnscan.formats._dxf_kernels import find_entities, on_layers

    if data[:22].startswith((b"AutoCAD Binary DXF", b"AC10")):
        raise FormatError(
            "DXF: this is a binary drawing", hint="save it as ASCII DXF, version R12 or later"
        )
    text = text_of(data)
    code, at, kinds, starts, count = find_entities(
        text, words(*_MARKS), words(*_WORDS), 4 * MAX_FACES
    )
    complain("DXF", data, code, at)
    kinds, starts = kinds[:count, 0], starts[:count, 0]
    polylines = _Polylines(data, text, kinds, starts)
    meshes = [_mesh_entity(data, text, int(s)) for s in starts[kinds == _MESH]]
    filled = on_layers(text, starts, words(_FILLED)[0])
    faces, quads = _faces(data, text, starts[kinds == _FACE])
    corners, of = polylines.corners()
    marks = [
        np.repeat(filled[kinds == _FACE], 1 + quads),
        filled[kinds == _POLYLINE][of],
        np.repeat(filled[kinds == _MESH], [len(m) // 3 for m in meshes]),
    ]
    lone, _, _ = _groups(data, text, starts[kinds == _POINT], 1)
    return DxfContent(
        faces=faces,
        polyfaces=corners,
        meshes=np.concatenate([np.empty((0, 3)), *meshes]),
        filled=np.concatenate(marks),
        runs=(*polylines.runs(), *(lone[i : i + 1] for i in range(len(lone)))),
        entities=count,
    )


def _groups(
    data: bytes, text: Text, starts: npt.NDArray[np.int64], corners: int
) -> tuple[Floats, npt.NDArray[np.bool_], _Triangles]:
    """Return (e, 3c) coordinates, which of them are there, and groups 70 to 74, (e, 5)."""
    from turnscan.formats._dxf_kernels import read_groups

    reals = np.zeros((len(starts), 3 * corners))
    seen = np.zeros(reals.shape, np.bool_)
    wholes = np.zeros((len(starts), 5), np.int64)
    complain("DXF", data, *read_groups(text, starts, reals, seen, wholes))
    return reals, seen, wholes


def _faces(data: bytes, text: Text, starts: npt.NDArray[np.int64]) -> tuple[Floats, Bools]:
    """Return the (3f, 3) vertices of 3DFACEs, and (e,) which of them are quadrilaterals."""
    within_limit("DXF", "3DFACEs", len(starts))
    reals, seen, _ = _groups(data, text, starts, 4)
    whole = seen[:, [0, 1, 3, 4, 6, 7]].all(axis=1)
    if not whole.all():
        line = data.count(b"\n", 0, int(starts[~whole][0]))
        require("DXF", False, f"the 3DFACE at line {line} has fewer than three vertices")
    short = ~seen[:, 9:].any(axis=1)
    reals[short, 9:] = reals[short, 6:9]
    corners = reals.reshape(-1, 4, 3)
    quads = (corners[:, 2] != corners[:, 3]).any(axis=1)
    both = np.ones((len(quads), 2), np.bool_)
    both[:, 1] = quads
    chosen: Floats = corners[:, [[0, 1, 2], [0, 2, 3]]][both]
    return chosen.reshape(-1, 3), quads


def _mesh_entity(data: bytes, text: Text, start: int) -> Floats:
    from turnscan.formats._dxf_kernels import read_mesh_entity

    code, at, points, n, lists, k = read_mesh_entity(text, start, MAX_FACES)
    complain("DXF", data, code, at)
    faces = triangles("DXF", lists[:k])
    mesh = indexed("DXF", points[:n], faces)
    return mesh.triangles.reshape(-1, 3)


class _Polylines:
    """The polylines of a file and the vertices that follow each."""

    def __init__(
        self, data: bytes, text: Text, kinds: npt.NDArray[np.int8], starts: npt.NDArray[np.int64]
    ) -> None:
        _, _, self._heads = _groups(data, text, starts[kinds == _POLYLINE], 1)
        here = kinds == _VERTEX
        self._points, _, self._wholes = _groups(data, text, starts[here], 1)
        self._of = np.cumsum(kinds == _POLYLINE)[here] - 1
        owner = np.append(self._heads[:, 0], 0)[self._of]  # -1, before any polyline: no form
        self._record = (owner & _POLYFACE != 0) & (
            self._wholes[:, 0] & (_RECORD | _PLACE) == _RECORD
        )
        control = self._wholes[:, 0] & _CONTROL != 0
        self._corner = (owner & _POLYFACE != 0) & ~self._record
        self._node = (owner & _GRID != 0) & ~control
        self._stop = (owner & _LINE != 0) & ~control

    def runs(self) -> tuple[Floats, ...]:
        """Return the (k, 3) points of each 3-D polyline."""
        points, of = self._points[self._stop], self._of[self._stop]
        cuts = np.flatnonzero(np.diff(of)) + 1
        return tuple(np.split(points, cuts)) if len(points) else ()

    def corners(self) -> tuple[Floats, npt.NDArray[np.int64]]:
        """Return the (3f, 3) vertices of polyfaces, then of polygon meshes, and whose each is."""
        found, of = self._polyface_corners()
        grids = self._grids()
        every = [of, *(np.full(len(corners) // 3, i) for i, corners in grids)]
        return np.concatenate([found, *(corners for _, corners in grids)]), np.concatenate(every)

    def _polyface_corners(self) -> tuple[Floats, npt.NDArray[np.int64]]:
        points = self._points[self._corner]
        counts = np.bincount(self._of[self._corner], minlength=len(self._heads))
        base = np.cumsum(counts) - counts
        of = self._of[self._record]
        numbers = np.abs(self._wholes[self._record, 1:])
        bad = (numbers[:, :3] == 0).any(axis=1) | (numbers > counts[of][:, None]).any(axis=1)
        if bad.any():
            i = int(np.argmax(bad))
            have = int(counts[of[i]])
            require("DXF", False, f"a polyface of {have} vertices has a face {numbers[i].tolist()}")
        both = np.ones((len(numbers), 2), np.bool_)
        both[:, 1] = numbers[:, 3] != 0
        index = numbers - 1 + base[of][:, None]
        chosen: Floats = points[index[:, [[0, 1, 2], [0, 2, 3]]][both]]
        return chosen.reshape(-1, 3), np.repeat(of, both.sum(axis=1))

    def _grids(self) -> list[tuple[int, Floats]]:
        found: list[tuple[int, Floats]] = []
        for i in np.flatnonzero(self._heads[:, 0] & _GRID):
            flags, rows, columns = (int(x) for x in self._heads[i, :3])
            points = self._points[self._node & (self._of == i)]
            if rows > 1 and columns > 1 and rows * columns == len(points):
                found.append((int(i), _cells(points.reshape(rows, columns, 3), flags)))
        return found


def _cells(grid: Floats, flags: int) -> Floats:
    """Return the vertices of two triangles for each cell of an (m, n, 3) polygon mesh."""
    if flags & _CLOSED_M:
        grid = np.concatenate([grid, grid[:1]])
    if flags & _CLOSED_N:
        grid = np.concatenate([grid, grid[:, :1]], axis=1)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners: Floats = np.stack([a, b, c, a, c, d], axis=2)
    return corners.reshape(-1, 3)

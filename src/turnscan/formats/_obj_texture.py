"""The colours of a mesh as a texture image, for programs that read no colours of vertices in OBJ.

Each pair of faces has a cell of 5 × 4 texels, one face in each corner of it: the colour is linear
across a face, so the texels of its half, and those just beyond its long side, which a program also
looks at between texels, hold that linear colour. No face shares a texel with another.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import ExportError
from turnscan.mesh import Mesh
from turnscan.picture import png

_WIDE, _HIGH = 5, 4
"""Texels of a cell."""
_HALF = tuple((i, j) for j in range(4) for i in range(4 - j))
"""Texels of a face in its cell: from its corner along two sides of 2 texels, and one beyond."""
_LARGEST = 16_384
"""Texels on a side that programs read."""


def face_corners(faces: int) -> Floats:
    """(3 f, 2) of 0 to 1: the place of each corner of each face in the texture, v upward."""
    columns, rows = _cells(faces)
    cell = np.arange(faces) // 2
    low = np.arange(faces) % 2 == 0
    corner = np.array([[0, 0], [2, 0], [0, 2]], dtype=np.float64)
    there = np.where(low[:, None, None], corner, [_WIDE - 1, _HIGH - 1] - corner)
    start = np.column_stack([cell % columns * _WIDE, cell // columns * _HIGH])
    texel = there + start[:, None, :] + 0.5
    out = texel / [columns * _WIDE, rows * _HIGH]
    out[..., 1] = 1.0 - out[..., 1]
    return np.asarray(out.reshape(-1, 2))


def material(name: str, picture: str) -> bytes:
    """The MTL: one material, whose colour is the texture."""
    return f"newmtl {name}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {picture}\n".encode()


def texture(mesh: Mesh) -> bytes:
    """The texture of a coloured mesh, PNG of 8 bits, red first.

    Raises ExportError where there are more faces than a texture holds.
    """
    if mesh.colour is None:
        raise ValueError("the mesh has no colours")
    faces = len(mesh.faces)
    columns, rows = _cells(faces)
    if columns * _WIDE > _LARGEST:
        raise ExportError(
            f"OBJ: a texture of {faces} faces is larger than programs read",
            hint="decimate the mesh, or leave the texture out",
        )
    page = np.full((rows * _HIGH, columns * _WIDE, 3), 153, dtype=np.uint8)
    a, b, c = (mesh.colour[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    cell = np.arange(faces) // 2
    x, y = cell % columns * _WIDE, cell // columns * _HIGH
    low = np.arange(faces) % 2 == 0
    for i, j in _HALF:
        level = a + (b - a) * (i / 2) + (c - a) * (j / 2)
        value = np.rint(np.clip(level, 0, 255)).astype(np.uint8)
        page[y + np.where(low, j, _HIGH - 1 - j), x + np.where(low, i, _WIDE - 1 - i)] = value
    return png(page)


def _cells(faces: int) -> tuple[int, int]:
    """Columns and rows of cells, about a square of texels."""
    cells = (faces + 1) // 2
    columns = max(int(np.ceil(np.sqrt(cells * _HIGH / _WIDE))), 1)
    return columns, max(-(-cells // columns), 1)

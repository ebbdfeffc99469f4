"""STL: triangles with a normal each; binary coordinates are 32-bit."""

from __future__ import annotations

import struct

import numpy as np

from turnscan import __version__
from turnscan.arrays import Floats
from turnscan.errors import FormatError, InputError
from turnscan.formats._options import DEFAULTS, ExportOptions
from turnscan.formats._read import MAX_FACES, complain, require, soup, text_of, within_limit, words
from turnscan.formats._text import about_lines, decimals_for, rows_text, scaled
from turnscan.mesh import Mesh

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_NORMAL_DECIMALS = 6


def write_stl(mesh: Mesh, options: ExportOptions = DEFAULTS) -> bytes:
    """Return the mesh as STL, binary or (``options.ascii``) text; the unit is mm by custom.

    Binary STL has room for 80 bytes of header only, so it carries the version and, where
    ``options.about`` has one, the start of ``rig``; the text carries them in the solid's name.

    Raises InputError where the mesh has no faces; ExportError where a coordinate is beyond
    what can be written.
    """
    if not len(mesh.faces):
        raise InputError("STL: the mesh has no faces", hint="check the region of interest")
    decimals = decimals_for(mesh.vertices)
    triangles = mesh.triangles
    normals = _normals(triangles)
    if options.ascii:
        return _text(mesh, normals, decimals, options)
    rig = str(options.about.get("rig", ""))
    header = f"turnscan {__version__} unit=mm{f' rig={rig}' if rig else ''}"
    records = np.zeros(len(triangles), RECORD)
    records["normal"], records["corners"] = normals, triangles
    start = header.encode("ascii", "replace")[:80].ljust(80)
    return b"".join([start, struct.pack("<I", len(triangles)), records.tobytes()])


def _text(mesh: Mesh, normals: Floats, decimals: int, options: ExportOptions) -> bytes:
    name = " ".join(["turnscan unit=mm", *about_lines(options.about)])
    rows = np.concatenate(
        [
            scaled(normals, _NORMAL_DECIMALS),
            scaled(mesh.vertices, decimals)[mesh.faces].reshape(-1, 9),
        ],
        axis=1,
    )
    vertex = ["\nvertex ", " ", " "]
    words = ["facet normal ", " ", " ", "\nouter loop\nvertex ", " ", " ", *vertex, *vertex]
    words.append("\nendloop\nendfacet\n")
    places = [_NORMAL_DECIMALS] * 3 + [decimals] * 9
    body = b"".join(rows_text(rows, places, words))
    return f"solid {name}\n".encode("ascii") + body + b"endsolid turnscan\n"


def _normals(triangles: Floats) -> Floats:
    """Return unit normals (f, 3) of (f, 3, 3) triangles; zero where a triangle has no area."""
    sides = triangles[:, 1:] - triangles[:, :1]
    normals: Floats = np.cross(sides[:, 0], sides[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0, lengths, 1.0)
    return normals


def read_stl(data: bytes) -> Mesh:
    """Return a binary or text STL as a mesh; equal corners become one vertex.

    Raises FormatError where size and content disagree or a number is not finite;
    LimitExceeded.
    """
    from turnscan.formats._read_kernels import read_stl_text

    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) >= 84 and len(data) == 84 + RECORD.itemsize * count:
        within_limit("STL", "triangles", count)
        require("STL", count > 0, "there are no triangles")
        records = np.frombuffer(data, RECORD, count, offset=84)
        return soup("STL", records["corners"].reshape(-1, 3).astype(np.float64))
    if not data[:80].lstrip().lower().startswith(b"solid"):
        need = 84 + RECORD.itemsize * count
        raise FormatError(
            f"STL: {count} triangles need {need} bytes, the file has {len(data)}",
            hint="the file is truncated or not an STL; export it again at its source",
        )
    (word,) = words("VERTEX")
    code, at, corners, n = read_stl_text(text_of(data), word, MAX_FACES)
    complain("STL", data, code, at)
    require("STL", n > 0, "there are no triangles")
    require("STL", n % 3 == 0, f"{n} vertices do not make whole triangles")
    require("STL", b"endsolid" in data[-4096:].lower(), "the file ends without endsolid")
    return soup("STL", corners[:n])

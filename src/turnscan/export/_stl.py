"""STL: triangles with a normal each; binary coordinates are 32-bit."""

from __future__ import annotations

import struct

import numpy as np

from turnscan import __version__
from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.export._options import DEFAULTS, ExportOptions
from turnscan.export._text import about_lines, decimals_for, rows_text, scaled
from turnscan.surface import Mesh

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

"""PLY: a mesh or points with colour, uncertainty and origin of every vertex."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.formats._options import DEFAULTS, ExportOptions
from turnscan.formats._text import Longs, about_lines, decimals_for, rows_text, scaled
from turnscan.mesh import Mesh, PointCloud, Provenance

FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
_MARKED = np.dtype([*FACE.descr, ("measured", "u1")])
_SIGMA_DECIMALS = 9
_NAMES = {"<f8": "double", "<f4": "float", "<i4": "int", "u1": "uchar"}


def write_ply(what: Mesh | PointCloud, options: ExportOptions = DEFAULTS) -> bytes:
    """Return a mesh or points as PLY, binary little-endian or (``options.ascii``) text, in mm.

    Vertices have x, y, z (double, or float with ``options.single``), where known red, green,
    blue, and where measured sigma (mm), laser, step and row. ``comment laser N NAME`` names
    the lasers. Where faces were not measured, ``measured`` is 1 or 0 for each face.

    Raises InputError where there is no vertex; ExportError where a coordinate is beyond what
    can be written.
    """
    points, faces, colour, origin = _parts(what)
    known = what.measured if isinstance(what, Mesh) else None
    if not len(points):
        raise InputError("PLY: there are no vertices", hint="check the region of interest")
    decimals = decimals_for(points)
    real = "<f4" if options.single else "<f8"
    columns: list[tuple[str, str, npt.NDArray[np.generic]]] = [
        (axis, real, points[:, i]) for i, axis in enumerate("xyz")
    ]
    if colour is not None:
        columns += [(n, "u1", colour[:, i]) for i, n in enumerate(("red", "green", "blue"))]
    if origin is not None:
        columns.append(("sigma", real, origin.sigma))
        columns += [("laser", "<i4", origin.laser), ("step", "<i4", origin.step)]
        columns.append(("row", "<i4", origin.line))
    lines = ["ply", f"format {'ascii' if options.ascii else 'binary_little_endian'} 1.0"]
    lines += ["comment unit: millimetre", *(f"comment {t}" for t in about_lines(options.about))]
    if origin is not None:
        lines += [f"comment laser {i} {_word(name)}" for i, name in enumerate(origin.lasers)]
    lines.append(f"element vertex {len(points)}")
    lines += [f"property {_NAMES[kind]} {name}" for name, kind, _ in columns]
    if faces is not None:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        lines += [] if known is None else ["property uchar measured"]
    head = "\n".join([*lines, "end_header\n"]).encode("ascii")
    write = _text if options.ascii else _binary
    return head + write(columns, faces, known, decimals)


_Columns = list[tuple[str, str, npt.NDArray[np.generic]]]


def _parts(
    what: Mesh | PointCloud,
) -> tuple[Floats, Ints | None, npt.NDArray[np.uint8] | None, Provenance | None]:
    if isinstance(what, Mesh):
        return what.vertices, what.faces, what.colour, what.provenance
    origin = Provenance(what.sigma, what.laser, what.step, what.line, what.lasers)
    return what.points, None, None, origin


def _word(name: str) -> str:
    """Return a laser's name as it can stand in a header line."""
    return " ".join(name.encode("ascii", "replace").decode().split())


def _binary(columns: _Columns, faces: Ints | None, known: Bools | None, decimals: int) -> bytes:
    vertices = np.empty(len(columns[0][2]), np.dtype([(name, kind) for name, kind, _ in columns]))
    for name, _, values in columns:
        vertices[name] = values
    if faces is None:
        return vertices.tobytes()
    records = np.empty(len(faces), FACE if known is None else _MARKED)
    records["count"], records["corners"] = 3, faces
    if known is not None:
        records["measured"] = known
    return vertices.tobytes() + records.tobytes()


def _text(columns: _Columns, faces: Ints | None, known: Bools | None, decimals: int) -> bytes:
    def digits(name: str, kind: str) -> int:
        if not kind.startswith("<f"):
            return 0
        return _SIGMA_DECIMALS if name == "sigma" else decimals

    places = [digits(name, kind) for name, kind, _ in columns]
    rows: Longs = np.stack(
        [scaled(v, d) for (_, _, v), d in zip(columns, places, strict=True)], axis=1
    )
    words = ["", *[" "] * (len(columns) - 1), "\n"]
    parts = [*rows_text(rows, places, words)]
    if faces is not None:
        numbers = [faces.astype(np.int64)] + ([] if known is None else [known[:, None]])
        table: Longs = np.concatenate(numbers, axis=1).astype(np.int64)
        blanks = [" "] * (table.shape[1] - 1)
        parts += rows_text(table, [0] * table.shape[1], ["3 ", *blanks, "\n"])
    return b"".join(parts)

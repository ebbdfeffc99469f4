"""OBJ: vertices and faces as text. XYZ: points as text, one a line."""

from __future__ import annotations

import numpy as np

from turnscan.errors import InputError
from turnscan.export._options import DEFAULTS, ExportOptions
from turnscan.export._read import (
    MAX_FACES,
    checked,
    complain,
    indexed,
    require,
    text_of,
    triangles,
    within_limit,
)
from turnscan.export._text import about_lines, decimals_for, rows_text, scaled
from turnscan.points import PointCloud
from turnscan.surface import Mesh, Provenance

SIGMA_DECIMALS = 9


def write_obj(mesh: Mesh, options: ExportOptions = DEFAULTS) -> bytes:
    """Return the mesh as Wavefront OBJ in mm, faces counted from 1; origin as comments.

    Raises InputError where the mesh has no faces; ExportError where a coordinate is beyond
    what can be written.
    """
    if not len(mesh.faces):
        raise InputError("OBJ: the mesh has no faces", hint="check the region of interest")
    d = decimals_for(mesh.vertices)
    words = ["v ", " ", " ", "\n"]
    parts = [_comments(options), *rows_text(scaled(mesh.vertices, d), [d, d, d], words)]
    words = ["f ", " ", " ", "\n"]
    parts += rows_text(mesh.faces.astype(np.int64) + 1, [0, 0, 0], words)
    return b"".join(parts)


def write_xyz(what: Mesh | PointCloud, options: ExportOptions = DEFAULTS) -> bytes:
    """Return points, or a mesh's vertices, as lines of x y z, and sigma where known, all mm.

    An unknown sigma is written ``nan``; where no sigma is known there is no fourth column.

    Raises InputError where there is no point; ExportError where a coordinate is beyond what
    can be written.
    """
    if isinstance(what, Mesh):
        points = what.vertices
        sigma = None if what.provenance is None else what.provenance.sigma
    else:
        points, sigma = what.points, what.sigma
    if not len(points):
        raise InputError("XYZ: there are no points", hint="check the region of interest")
    d = decimals_for(points)
    rows, places, words = scaled(points, d), [d, d, d], ["", " ", " ", "\n"]
    if sigma is not None and not np.isnan(sigma).all():
        rows = np.concatenate([rows, scaled(sigma, SIGMA_DECIMALS)[:, None]], axis=1)
        places, words = [*places, SIGMA_DECIMALS], ["", " ", " ", " ", "\n"]
    return b"".join([_comments(options), *rows_text(rows, places, words)])


def _comments(options: ExportOptions) -> bytes:
    lines = ["unit: millimetre", *about_lines(options.about)]
    return "".join(f"# {line}\n" for line in lines).encode("ascii")


def read_obj(data: bytes) -> Mesh:
    """Return the vertices and faces of a Wavefront OBJ; polygons are cut into fans.

    Raises FormatError with the line, where it is not in form; LimitExceeded; InputError where
    it has no face.
    """
    from turnscan.export import _read_kernels

    code, at, points, v, lists, n = _read_kernels.read_obj(text_of(data), MAX_FACES)
    complain("OBJ", data, code, at)
    faces = triangles("OBJ", lists[:n])
    if not len(faces):
        raise InputError("OBJ: there are no faces", hint="export the surface as polygons")
    return indexed("OBJ", points[:v], faces)


def read_xyz(data: bytes) -> Mesh:
    """Return the points of an XYZ file as a mesh without faces, with sigma where it has one.

    Lines of three numbers or, with sigma, four; # starts a comment.

    Raises FormatError with the line, where it is not in form; LimitExceeded.
    """
    from turnscan.export._read_kernels import read_table, shape_of_table

    rows, columns = shape_of_table(text_of(data))
    require("XYZ", rows > 0, "there are no points")
    within_limit("XYZ", "points", rows, 3 * MAX_FACES)
    require("XYZ", columns in (3, 4), f"the first line has {columns} numbers, not 3 or 4")
    table = np.empty((rows, columns))
    code, at = read_table(text_of(data), 0, table, True)
    complain("XYZ", data, code, at)
    points = checked("XYZ", table[:, :3])
    unknown = np.full(len(points), -1, np.int32)
    origin = None
    if columns == 4:
        origin = Provenance(table[:, 3], unknown, unknown, unknown, ())
    return Mesh(points, np.empty((0, 3), np.int32), origin)

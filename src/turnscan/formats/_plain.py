"""OBJ: vertices and faces as text. XYZ: points as text, one a line."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.formats._obj_texture import face_corners, material, texture
from turnscan.formats._options import DEFAULTS, ExportOptions
from turnscan.formats._read import (
    MAX_FACES,
    checked,
    complain,
    indexed,
    require,
    text_of,
    triangles,
    within_limit,
)
from turnscan.formats._text import about_lines, decimals_for, rows_text, scaled
from turnscan.mesh import Mesh, PointCloud, Provenance

SIGMA_DECIMALS = 9
_COLOUR_DECIMALS = 4
_PLACE_DECIMALS = 7
"""Of places in a texture: a hundredth of a texel of the largest."""


def write_obj(mesh: Mesh, options: ExportOptions = DEFAULTS) -> bytes:
    """Return the mesh as Wavefront OBJ in mm, faces counted from 1; origin as comments.

    Where faces were not measured, the groups ``measured`` and ``filled`` say which. Colours stand
    behind the coordinates of each vertex, 0 to 1; with ``options.material`` the corners of faces
    have their places in the texture, too, which `texture_files` writes.

    Raises InputError where the mesh has no faces; ExportError where a coordinate is beyond
    what can be written.
    """
    if not len(mesh.faces):
        raise InputError("OBJ: the mesh has no faces", hint="check the region of interest")
    d = decimals_for(mesh.vertices)
    rows, places = scaled(mesh.vertices, d), [d, d, d]
    if mesh.colour is not None:
        rows = np.concatenate([rows, scaled(mesh.colour / 255.0, _COLOUR_DECIMALS)], axis=1)
        places += [_COLOUR_DECIMALS] * 3
    words = ["v ", *[" "] * (len(places) - 1), "\n"]
    parts = [_comments(options), *rows_text(rows, places, words)]
    words = ["f ", " ", " ", "\n"]
    textured = options.material and mesh.colour is not None
    if textured:
        corners = scaled(face_corners(len(mesh.faces)), _PLACE_DECIMALS)
        parts.append(f"mtllib {options.material}.mtl\nusemtl coloured\n".encode())
        parts += rows_text(corners, [_PLACE_DECIMALS] * 2, ["vt ", " ", "\n"])
        words = ["f ", "/", " ", "/", " ", "/", "\n"]
    done = 0
    for group, part in _groups(mesh):
        parts.append(group)
        numbers = part.astype(np.int64) + 1
        if textured:
            place = np.arange(3 * done, 3 * (done + len(part))).reshape(-1, 3) + 1
            numbers = np.stack([numbers, place], axis=2).reshape(-1, 6)
        parts += rows_text(numbers, [0] * numbers.shape[1], words)
        done += len(part)
    return b"".join(parts)


def texture_files(mesh: Mesh, material_name: str) -> dict[str, bytes]:
    """What stands beside an OBJ with a material, by the end of its name: .mtl and -texture.png.

    Raises ExportError where there are more faces than a texture holds.
    """
    picture = "-texture.png"
    return {
        ".mtl": material("coloured", f"{material_name}{picture}"),
        picture: texture(mesh),
    }


def _groups(mesh: Mesh) -> list[tuple[bytes, Ints]]:
    """Runs of faces that were measured or not, with the line that begins their group."""
    if mesh.measured is None:
        return [(b"", mesh.faces)]
    cuts = np.flatnonzero(np.diff(mesh.measured)) + 1
    firsts = mesh.measured[np.append(0, cuts)]
    names = [b"g measured\n" if first else b"g filled\n" for first in firsts]
    return list(zip(names, np.split(mesh.faces, cuts), strict=True))


def write_xyz(what: Mesh | PointCloud, options: ExportOptions = DEFAULTS) -> bytes:
    """Return points, or a mesh's vertices, as lines of x y z, and sigma where known, all mm.

    Of a mesh with faces that were not measured only the measured vertices are written. An unknown
    sigma is written ``nan``; where no sigma is known there is no fourth column.

    Raises InputError where there is no point; ExportError where a coordinate is beyond what
    can be written.
    """
    points, sigma = points_to_write(what)
    if not len(points):
        raise InputError("XYZ: there are no points", hint="check the region of interest")
    d = decimals_for(points)
    rows, places, words = scaled(points, d), [d, d, d], ["", " ", " ", "\n"]
    if sigma is not None and not np.isnan(sigma).all():
        rows = np.concatenate([rows, scaled(sigma, SIGMA_DECIMALS)[:, None]], axis=1)
        places, words = [*places, SIGMA_DECIMALS], ["", " ", " ", " ", "\n"]
    return b"".join([_comments(options), *rows_text(rows, places, words)])


def points_to_write(what: Mesh | PointCloud) -> tuple[Floats, Floats | None]:
    """The points (n, 3) that an XYZ holds, and their sigma where there is any."""
    if not isinstance(what, Mesh):
        return what.points, what.sigma
    sigma = None if what.provenance is None else what.provenance.sigma
    if what.measured is None:
        return what.vertices, sigma
    keep = np.zeros(len(what.vertices), dtype=np.bool_)
    keep[what.faces[what.measured]] = True
    if what.provenance is not None:
        keep &= what.provenance.step >= 0
    return what.vertices[keep], None if sigma is None else sigma[keep]


def _comments(options: ExportOptions) -> bytes:
    lines = ["unit: millimetre", *about_lines(options.about)]
    return "".join(f"# {line}\n" for line in lines).encode("ascii")


def read_obj(data: bytes) -> Mesh:
    """Return the vertices and faces of a Wavefront OBJ; polygons are cut into fans.

    Triangles in the group ``filled`` count as not measured. Colours of vertices (``v x y z r g b``)
    are read where every vertex has one.

    Raises FormatError with the line, where it is not in form; LimitExceeded; InputError where
    it has no face.
    """
    from turnscan.formats import _read_kernels

    code, at, points, v, lists, n, colours = _read_kernels.read_obj(text_of(data), MAX_FACES)
    complain("OBJ", data, code, at)
    faces = triangles("OBJ", lists[:n])
    if not len(faces):
        raise InputError("OBJ: there are no faces", hint="export the surface as polygons")
    mesh = indexed("OBJ", points[:v], faces)
    return replace(mesh, measured=_measured(data, len(faces)), colour=_levels(colours[:v]))


def _levels(shares: Floats) -> npt.NDArray[np.uint8] | None:
    """(v, 3) of 0 to 255; None where a vertex has no colour, or they are not 0 to 1."""
    if not ((shares >= 0) & (shares <= 1)).all():
        return None
    return np.rint(255.0 * shares).astype(np.uint8)


def _measured(data: bytes, faces: int) -> Bools | None:
    """(f,) False for the faces in group filled; None where there is none, or faces were cut up."""
    if not re.search(rb"(?m)^g filled\s*$", data):
        return None
    text = text_of(data)
    at = np.flatnonzero((text[:-2] == 10) & (text[1:-1] == ord("f")) & (text[2:] == ord(" "))) + 1
    if len(at) != faces:
        return None
    groups = [(m.start(), m[1] != b"filled") for m in re.finditer(rb"(?m)^g (\S*)", data)]
    which = np.searchsorted([start for start, _ in groups], at, side="right")
    known: Bools = np.array([True, *(good for _, good in groups)], dtype=np.bool_)[which]
    return known


def read_xyz(data: bytes) -> Mesh:
    """Return the points of an XYZ file as a mesh without faces, with sigma where it has one.

    Lines of three numbers or, with sigma, four; # starts a comment.

    Raises FormatError with the line, where it is not in form; LimitExceeded.
    """
    from turnscan.formats._read_kernels import read_table, shape_of_table

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

"""OBJ: vertices and faces as text. XYZ: points as text, one a line."""

from __future__ import annotations

import numpy as np

from turnscan.errors import InputError
from turnscan.export._options import DEFAULTS, ExportOptions
from turnscan.export._text import about_lines, decimals_for, rows_text, scaled
from turnscan.points import PointCloud
from turnscan.surface import Mesh

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

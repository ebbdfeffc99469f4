"""Formats by suffix: one writer and one reader each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import MappingProxyType

from turnscan.errors import InputError
from turnscan.formats._dxf import write_dxf
from turnscan.formats._dxf_read import read_dxf
from turnscan.formats._glb import write_glb
from turnscan.formats._glb_read import read_glb
from turnscan.formats._options import DEFAULTS, ExportOptions, Profiles
from turnscan.formats._plain import read_obj, read_xyz, write_obj, write_xyz
from turnscan.formats._ply import write_ply
from turnscan.formats._ply_read import read_ply
from turnscan.formats._stl import read_stl, write_stl
from turnscan.formats._threemf import read_3mf, write_3mf
from turnscan.mesh import Mesh, PointCloud


@dataclass(frozen=True)
class Exporter:
    """A file format: how a mesh becomes bytes, and back."""

    suffix: str
    write: Callable[[Mesh, ExportOptions], bytes]
    read: Callable[[bytes], Mesh]
    write_points: Callable[[PointCloud, ExportOptions], bytes] | None = None
    """For a format that holds points without faces."""


EXPORTERS = MappingProxyType(
    {
        e.suffix: e
        for e in (
            Exporter(".dxf", write_dxf, read_dxf),
            Exporter(".stl", write_stl, read_stl),
            Exporter(".ply", write_ply, read_ply, write_ply),
            Exporter(".obj", write_obj, read_obj),
            Exporter(".3mf", write_3mf, read_3mf),
            Exporter(".glb", write_glb, read_glb),
            Exporter(".xyz", write_xyz, read_xyz, write_xyz),
        )
    }
)
"""The formats, by suffix in lower case."""


def exporter_for(suffix: str) -> Exporter:
    """Return the format of a suffix such as ``.dxf``, in any case.

    Raises InputError where there is none.
    """
    found = EXPORTERS.get(suffix.lower())
    if found is None:
        known = ", ".join(EXPORTERS)
        raise InputError(f"files ending {suffix!r} are not known", hint=f"use one of {known}")
    return found


def export(
    what: Mesh | PointCloud | Profiles,
    suffix: str,
    *,
    options: ExportOptions = DEFAULTS,
    profiles: Profiles | None = None,
) -> bytes:
    """Return the bytes of a file; ``suffix`` (.dxf .stl .ply .obj .3mf .glb .xyz) names the format.

    ``profiles`` go with a mesh into a DXF whose options ask for form ``profiles``. Profiles by
    themselves can become a DXF. All coordinates are in mm. The same input gives the same bytes.

    Raises InputError where the format cannot hold this, or there is nothing to hold; ExportError
    where a coordinate cannot be written.
    """
    chosen = exporter_for(suffix)
    if isinstance(what, Mesh):
        if chosen.suffix == ".dxf":
            return write_dxf(what, options, profiles)
        return chosen.write(what, options)
    if isinstance(what, PointCloud) and chosen.write_points is not None:
        return chosen.write_points(what, options)
    if isinstance(what, Profiles) and chosen.suffix == ".dxf":
        return write_dxf(None, replace(options, dxf_forms=("profiles",)), what)
    kind = "points" if isinstance(what, PointCloud) else "profiles"
    fit = ".ply or .xyz" if isinstance(what, PointCloud) else ".dxf"
    raise InputError(f"a {chosen.suffix} file cannot hold {kind} alone", hint=f"use {fit}")


def read_mesh(data: bytes, suffix: str) -> Mesh:
    """Return the mesh in a file's bytes, ours or another's; ``suffix`` names the format.

    Lengths are taken as mm where the format states no unit. STL and DXF corners that are equal
    become one vertex. A PLY or XYZ without faces gives a mesh without faces.

    Raises FormatError, naming the place, where the file is damaged; LimitExceeded where it holds
    more than 50 million faces; InputError where there is no such format or nothing in it.
    """
    return exporter_for(suffix).read(data)

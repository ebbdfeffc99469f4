"""Formats by suffix: one writer and one reader each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypeVar

from turnscan.arrays import Floats
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
from turnscan.plugins import Plugin, find_plugin, plugin_names

GROUP = "turnscan.formats"
"""The entry-point group. An entry is an `Exporter`, by its suffix without the dot."""
T = TypeVar("T")


@dataclass(frozen=True)
class Exporter:
    """A file format: how a mesh becomes bytes, and back."""

    suffix: str
    write: Callable[[Mesh, ExportOptions], bytes]
    read: Callable[[bytes], Mesh]
    write_points: Callable[[PointCloud, ExportOptions], bytes] | None = None
    """For a format that holds points without faces."""
    rounding: Callable[[Floats], float] | None = None
    """(n, 3) mm → how far the format may move a coordinate of these, mm; None: it keeps the
    decimals that turnscan's own texts have, at least 6."""


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


def exporter_for(suffix: str, *, beside: Sequence[str] = ()) -> Exporter:
    """Return the format of a suffix such as ``.dxf``, in any case: ours, or an installed one.

    ``beside`` are suffixes that an error names with them, as they may be used, too.

    Raises InputError where there is none, PluginError where an installed one cannot be loaded.
    """
    found = EXPORTERS.get(suffix.lower())
    if found is not None:
        return found
    plugin = find_plugin(GROUP, suffix.lower().removeprefix("."))
    if plugin is not None:
        return _contained(plugin, suffix.lower())
    known = ", ".join([*EXPORTERS, *beside, *(f".{name}" for name in plugin_names(GROUP))])
    raise InputError(f"files ending {suffix!r} are not known", hint=f"use one of {known}")


def _contained(plugin: Plugin, suffix: str) -> Exporter:
    """The format of another package; whatever it does wrong is a PluginError that names it."""
    there = plugin.value
    if not isinstance(there, Exporter):
        raise plugin.failure(f"it gives a {type(there).__name__}, not an Exporter")
    if there.suffix != suffix:
        raise plugin.failure(f"it is for files ending {there.suffix!r}, not {suffix!r}")

    def called(kind: type[T], function: Callable[..., T]) -> Callable[..., T]:
        def call(*args: object) -> T:
            made = plugin.run(function, *args)
            if not isinstance(made, kind):
                raise plugin.failure(f"it gave a {type(made).__name__}, not {kind.__name__}")
            return made

        return call

    points = there.write_points
    return Exporter(
        suffix,
        called(bytes, there.write),
        called(Mesh, there.read),
        None if points is None else called(bytes, points),
        None if there.rounding is None else called(float, there.rounding),
    )


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

"""3MF: what printing programs exchange; decimal text in a zip, with its unit."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from turnscan import __version__
from turnscan.arrays import Bools, Floats
from turnscan.errors import FormatError, InputError
from turnscan.formats._options import DEFAULTS, ExportOptions
from turnscan.formats._read import MAX_FACES, checked, indexed, require, within_limit
from turnscan.formats._text import decimals_for, rows_text, scaled
from turnscan.mesh import Mesh, is_closed

_MODEL = "3D/3dmodel.model"
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_MATERIALS = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
_KINDS = "http://schemas.openxmlformats.org/package/2006/content-types"
_LINKS = "http://schemas.openxmlformats.org/package/2006/relationships"
_START = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
_PACKAGE = {
    "[Content_Types].xml": f'{_XML}<Types xmlns="{_KINDS}">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
    "_rels/.rels": f'{_XML}<Relationships xmlns="{_LINKS}">'
    f'<Relationship Target="/{_MODEL}" Id="rel0" Type="{_START}"/></Relationships>',
}
_UNITS = {
    "micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8,
    "meter": 1e3,
}  # fmt: skip
_GREY = 0x99
_LARGEST = 8 << 30
"""Bytes of a model when unpacked."""
_DEEPEST = 16
_MOST_INSTANCES = 100_000


def write_3mf(mesh: Mesh, options: ExportOptions = DEFAULTS) -> bytes:
    """Return the mesh as 3MF in mm, with its origin as description.

    A closed mesh is an object of type ``model``; 3MF calls an open one ``surface``. Where faces
    were not measured they have the base material ``filled``, the others ``measured``, or where
    the mesh has colours those of their vertices, from a colour group (materials extension 1.2).

    Raises InputError where the mesh has no faces; ExportError where a coordinate is beyond what
    can be written.
    """
    if not len(mesh.faces):
        raise InputError("3MF: the mesh has no faces", hint="check the region of interest")
    about = json.dumps({"turnscan": __version__, **options.about}, sort_keys=True)
    kind = "model" if is_closed(mesh) else "surface"
    marks = "" if mesh.measured is None else ' pid="1" pindex="0"'
    shades, shade = np.zeros((0, 3), np.uint8), None
    if mesh.colour is not None:
        shades, shade = np.unique(mesh.colour, axis=0, return_inverse=True)
        marks = marks or ' pid="3" pindex="0"'
    colours = (
        '<basematerials id="1"><base name="measured" displaycolor="#999999"/>'
        '<base name="filled" displaycolor="#CC5A1A"/></basematerials>'
    )
    head = (
        f'{_XML}<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}"{_space(shade)}>'
        f'<metadata name="Application">turnscan {__version__}</metadata>'
        f'<metadata name="Description">{quoteattr(about)[1:-1]}</metadata>'
        f"<resources>{'' if mesh.measured is None else colours}{_colour_group(shades)}"
        f'<object id="2" type="{kind}"{marks}><mesh><vertices>\n'
    )
    d = decimals_for(mesh.vertices)
    words = ['<vertex x="', '" y="', '" z="', '"/>\n']
    parts = [head.encode(), *rows_text(scaled(mesh.vertices, d), [d, d, d], words)]
    parts.append(b"</vertices><triangles>\n")
    parts += _triangles(mesh, shade)
    end = '</triangles></mesh></object></resources><build><item objectid="2"/></build></model>\n'
    return _packed(b"".join([*parts, end.encode()]))


def _space(shade: object) -> str:
    return "" if shade is None else f' xmlns:m="{_MATERIALS}"'


def _colour_group(shades: npt.NDArray[np.uint8]) -> str:
    """The colours that occur; empty for none."""
    if not len(shades):
        return ""
    each = "".join(f'<m:color color="#{bytes(row).hex().upper()}"/>' for row in shades)
    return f'<m:colorgroup id="3">{each}</m:colorgroup>'


def _triangles(mesh: Mesh, shade: npt.NDArray[np.intp] | None) -> list[bytes]:
    """Runs of faces with what they are made of: material, or colours of their vertices."""
    known = np.ones(len(mesh.faces), np.bool_) if mesh.measured is None else mesh.measured
    cuts = np.flatnonzero(np.diff(known)) + 1
    parts: list[bytes] = []
    for run in np.split(np.arange(len(known)), cuts):
        rows = corners = mesh.faces[run].astype(np.int64)
        words = ['<triangle v1="', '" v2="', '" v3="', '"/>\n']
        if not known[run[0]]:
            words[3:] = ['" pid="1" p1="1"/>\n']
        elif shade is not None:
            rows = np.concatenate([corners, shade.ravel()[corners]], axis=1)
            words[3:] = ['" pid="3" p1="', '" p2="', '" p3="', '"/>\n']
        parts += rows_text(rows, [0] * rows.shape[1], words)
    return parts


def _packed(model: bytes) -> bytes:
    """The zip, without a date, so that the same input gives the same bytes."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        for name, text in {**{k: v.encode() for k, v in _PACKAGE.items()}, _MODEL: model}.items():
            info = zipfile.ZipInfo(name)
            info.create_system = 3
            file.writestr(info, text, zipfile.ZIP_DEFLATED, 6)
    return out.getvalue()


def read_3mf(data: bytes) -> Mesh:
    """Return the triangles of everything that is to be built as one mesh, in mm.

    Faces of a base material called ``filled`` count as not measured. Vertices have the colours of
    faces with a colour group; where only some have one, the others are grey.

    Raises FormatError where it is damaged; LimitExceeded; InputError where it holds no triangles.
    """
    model = _Model()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            name = next((n for n in file.namelist() if n.lower() == _MODEL.lower()), None)
            name = name or next((n for n in file.namelist() if n.endswith(".model")), "")
            require("3MF", bool(name), "there is no model in it")
            info = file.getinfo(name)
            within_limit("3MF", "bytes", info.file_size, _LARGEST)
            plain = info.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            require("3MF", plain, f"compression {info.compress_type} is not one of 3MF")
            with file.open(info) as text:
                model.parser.ParseFile(text)
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError) as e:
        raise _bad(str(e)) from None
    except expat.ExpatError as e:
        raise _bad(str(e)) from None
    except (KeyError, IndexError, ValueError) as e:
        if isinstance(e, InputError):
            raise
        raise _bad(f"line {model.parser.CurrentLineNumber}: {type(e).__name__}: {e}") from None
    return model.mesh()


def _bad(message: str) -> FormatError:
    return FormatError(f"3MF: {message}", hint="export the file again at its source")


@dataclass
class _Object:
    points: list[float] = field(default_factory=list)
    faces: list[int] = field(default_factory=list)
    filled: list[int] = field(default_factory=list)
    """Numbers of faces of the material filled."""
    components: list[tuple[str, Floats]] = field(default_factory=list)
    colours: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    """Of vertices, from the faces that have them."""
    material: tuple[str, str] = ("", "0")


class _Model:
    """What the parser has seen."""

    def __init__(self) -> None:
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.StartDoctypeDeclHandler = self._doctype
        self._unit = 1.0
        self._objects: dict[str, _Object] = {}
        self._materials: dict[str, list[str]] = {}
        self._items: list[tuple[str, Floats]] = []
        self._instances = 0
        self._now = _Object()
        self._bases: list[str] = []
        self._shades: dict[str, list[tuple[int, int, int]]] = {}
        self._group: list[tuple[int, int, int]] = []

    def _doctype(self, *_: object) -> None:
        raise _bad("a document type is declared, which 3MF forbids")

    def _start(self, name: str, at: Mapping[str, str]) -> None:
        space, _, tag = name.rpartition(" ")
        if space == _MATERIALS and tag == "colorgroup":
            self._group = self._shades[at["id"]] = []
        elif space == _MATERIALS and tag == "color":
            red, green, blue = bytes.fromhex(at["color"].removeprefix("#")[:6])
            self._group.append((red, green, blue))
        if space != _CORE:
            return
        if tag == "vertex":
            self._now.points += (float(at["x"]), float(at["y"]), float(at["z"]))
        elif tag == "triangle":
            self._triangle(at)
        elif tag == "object":
            self._now = self._objects[at["id"]] = _Object(
                material=(at.get("pid", ""), at.get("pindex", "0"))
            )
        elif tag == "component":
            self._now.components.append((at["objectid"], _pose(at.get("transform"))))
        elif tag == "item":
            self._items.append((at["objectid"], _pose(at.get("transform"))))
        elif tag == "basematerials":
            self._bases = self._materials[at["id"]] = []
        elif tag == "base":
            self._bases.append(at["name"])
        elif tag == "model":
            unit = at.get("unit", "millimeter")
            require("3MF", unit in _UNITS, f"the unit {unit!r} is unknown")
            self._unit = _UNITS[unit]

    def _triangle(self, at: Mapping[str, str]) -> None:
        now = self._now
        now.faces += (int(at["v1"]), int(at["v2"]), int(at["v3"]))
        if len(now.faces) > 3 * MAX_FACES:
            within_limit("3MF", "triangles", len(now.faces) // 3)
        group, number = at.get("pid", now.material[0]), at.get("p1", now.material[1])
        names = self._materials.get(group)
        if names is not None and names[int(number) : int(number) + 1] == ["filled"]:
            now.filled.append(len(now.faces) // 3 - 1)
        shades = self._shades.get(group)
        if shades is not None:
            for k, corner in enumerate(now.faces[-3:]):
                now.colours[corner] = shades[int(at.get(f"p{k + 1}", number))]

    def mesh(self) -> Mesh:
        """All that is to be built. Raises FormatError and InputError."""
        parts: list[tuple[Floats, Any, Bools, Any]] = []
        for name, pose in self._items:
            self._collect(name, pose, 0, parts)
        if not parts:
            raise InputError("3MF: there are no triangles", hint="export the surface as triangles")
        starts = np.cumsum([0, *(len(part[0]) for part in parts)])
        faces = np.concatenate([part[1] + k for part, k in zip(parts, starts, strict=False)])
        points = checked("3MF", np.concatenate([part[0] for part in parts]) * self._unit)
        measured = np.concatenate([part[2] for part in parts])
        mesh = indexed("3MF", points, faces)
        some = any(one.colours for one in self._objects.values())
        colour = np.concatenate([part[3] for part in parts]) if some else None
        marks = None if measured.all() else measured
        return Mesh(mesh.vertices, mesh.faces, colour=colour, measured=marks)

    def _collect(self, name: str, pose: Floats, depth: int, parts: list[Any]) -> None:
        require("3MF", depth < _DEEPEST, f"objects are nested more than {_DEEPEST} deep")
        require("3MF", name in self._objects, f"object {name!r} does not exist")
        self._instances += 1
        within_limit("3MF", "instances", self._instances, _MOST_INSTANCES)
        that = self._objects[name]
        for inner, within in that.components:
            self._collect(inner, within @ pose, depth + 1, parts)
        if not that.faces:
            return
        points = checked("3MF", np.array(that.points).reshape(-1, 3))
        faces = indexed("3MF", points, np.array(that.faces).reshape(-1, 3)).faces.astype(np.int64)
        done = sum(len(part[1]) for part in parts)
        within_limit("3MF", "triangles", done + len(faces))
        measured = np.ones(len(faces), np.bool_)
        measured[that.filled] = False
        if np.linalg.det(pose[:3, :3]) < 0:
            faces = faces[:, ::-1]
        colour = np.full((len(points), 3), _GREY, np.uint8)
        if that.colours:
            colour[list(that.colours)] = list(that.colours.values())
        parts.append((points @ pose[:3, :3] + pose[3, :3], faces, measured, colour))


def _pose(text: str | None) -> Floats:
    """(4, 4) of a transform: a row of coordinates comes first. Raises ValueError."""
    pose = np.eye(4)
    if text is not None:
        rows = np.array([float(word) for word in text.split()])
        require("3MF", rows.size == 12, f"a transform has {rows.size} numbers, not 12")
        pose[:, :3] = rows.reshape(4, 3)
    return pose

"""GLB: binary glTF 2.0, for the web, phones and museums; in metres, with y up, 32-bit."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan import __version__
from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.formats._options import DEFAULTS, ExportOptions
from turnscan.formats._text import decimals_for
from turnscan.mesh import Mesh

MM = 1000.0
"""mm in glTF's unit."""
_Y_UP = (1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1)
"""Columns of the matrix that turns our z into glTF's y; times the scale, it is a node's."""
_LEVELS = 65535.0
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_POINTS, _INDICES = 34962, 34963
_FLOAT, _UINT, _USHORT = 5126, 5125, 5123


def write_glb(mesh: Mesh, options: ExportOptions = DEFAULTS) -> bytes:
    """Return the mesh as binary glTF; a node scales its mm to metres and turns z into y.

    Vertex colours are turned from sRGB to glTF's linear light. Where faces were not measured they
    stand in a primitive of their own, after the others, with the material ``filled``. Origin in
    ``asset.extras``.

    Raises InputError where the mesh has no faces; ExportError where a coordinate is beyond what
    can be written.
    """
    if not len(mesh.faces):
        raise InputError("GLB: the mesh has no faces", hint="check the region of interest")
    decimals_for(mesh.vertices)  # refuses what no format can hold
    file = _File()
    points = mesh.vertices.astype("<f4")
    attributes = {"POSITION": file.add(points, _FLOAT, "VEC3", _POINTS, bounds=True)}
    if mesh.colour is not None:
        alpha = np.full((len(points), 1), _LEVELS)
        levels = np.rint(np.hstack([linear(mesh.colour / 255.0) * _LEVELS, alpha])).astype("<u2")
        attributes["COLOR_0"] = file.add(levels, _USHORT, "VEC4", _POINTS, normalized=True)
    known = np.ones(len(mesh.faces), np.bool_) if mesh.measured is None else mesh.measured
    parts = [("measured", mesh.faces[known]), ("filled", mesh.faces[~known])]
    parts = [(name, faces) for name, faces in parts if len(faces)]
    primitives = [
        {
            "attributes": attributes,
            "indices": file.add(faces.astype("<u4").reshape(-1, 1), _UINT, "SCALAR", _INDICES),
            "material": number,
            "mode": 4,
        }
        for number, (_, faces) in enumerate(parts)
    ]
    head = {
        "asset": {
            "version": "2.0",
            "generator": f"turnscan {__version__}",
            "extras": {"turnscan": __version__, **options.about},
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": [*(v / MM for v in _Y_UP[:15]), 1]}],
        "meshes": [{"primitives": primitives}],
        "materials": [_material(name, mesh.colour is not None) for name, _ in parts],
    }
    return file.bytes(head)


def linear(seen: Floats) -> Floats:
    """Linear light of sRGB values, both 0 to 1 (IEC 61966-2-1)."""
    light: Floats = np.where(seen <= 0.04045, seen / 12.92, ((seen + 0.055) / 1.055) ** 2.4)
    return light


def srgb(light: Floats) -> Floats:
    """The inverse of `linear`."""
    seen: Floats = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return seen


def _material(name: str, coloured: bool) -> dict[str, Any]:
    grey = [1.0, 1.0, 1.0, 1.0] if coloured else [0.6, 0.6, 0.6, 1.0]
    colour = grey if name == "measured" else [0.8, 0.35, 0.1, 1.0]
    matt = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.9}
    return {"name": name, "pbrMetallicRoughness": matt, "doubleSided": True}


class _File:
    """The binary part while it grows, and the tables that say where things are in it."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def add(
        self,
        values: npt.NDArray[Any],
        component: int,
        kind: str,
        target: int,
        *,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append (n, k) values; return the number of their accessor."""
        data = values.tobytes()
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data), "target": target}
        accessor = {
            "bufferView": len(self._views),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            accessor["min"] = [float(v) for v in values.min(axis=0)]
            accessor["max"] = [float(v) for v in values.max(axis=0)]
        if normalized:
            accessor["normalized"] = True
        self._views.append(view)
        self._accessors.append(accessor)
        self._parts.append(data.ljust(-(-len(data) // 4) * 4, b"\0"))
        self._size += len(self._parts[-1])
        return len(self._accessors) - 1

    def bytes(self, head: dict[str, Any]) -> bytes:
        """The whole file."""
        head = {
            **head,
            "buffers": [{"byteLength": self._size}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(head, separators=(",", ":")).encode("ascii")
        chunks = [_chunk(_JSON, [text.ljust(-(-len(text) // 4) * 4)]), _chunk(_BIN, self._parts)]
        size = 12 + sum(len(c) for c in chunks)
        return b"".join([b"glTF", struct.pack("<II", 2, size), *chunks])


def _chunk(kind: int, parts: Sequence[bytes]) -> bytes:
    return b"".join([struct.pack("<II", sum(map(len, parts)), kind), *parts])

"""Reads binary glTF 2.0, ours or another's: triangles, node by node, in mm with z up."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import FormatError, InputError
from turnscan.formats._glb import MM, srgb
from turnscan.formats._read import MAX_FACES, checked, indexed, require, within_limit
from turnscan.mesh import Mesh

_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_DEEPEST = 64
_MOST_NODES = 100_000
_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""glTF's x, y (up), z to ours."""


def read_glb(data: bytes) -> Mesh:
    """Return the triangles of the file's scene as one mesh; metres become mm, y becomes z.

    Colours become sRGB. Faces of a material called ``filled`` count as not measured.

    Raises FormatError where it is damaged, or compressed in a way that is not read (Draco,
    meshopt); LimitExceeded; InputError where it holds no triangles.
    """
    try:
        return _Reader(*_chunks(data)).mesh()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as e:
        if isinstance(e, InputError):
            raise
        raise FormatError(
            f"GLB: its tables are inconsistent ({type(e).__name__}: {e})",
            hint="export the file again at its source",
        ) from None


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    require(
        "GLB", data[:4] == b"glTF" and len(data) >= 20, "it does not start with the GLB signature"
    )
    version, size = struct.unpack_from("<II", data, 4)
    require("GLB", version == 2, f"version {version}, only 2 is read")
    require("GLB", size <= len(data), f"{size} bytes are announced, the file has {len(data)}")
    length, kind = struct.unpack_from("<I4s", data, 12)
    require("GLB", kind == b"JSON" and 20 + length <= size, "the JSON part is missing or truncated")
    head = json.loads(data[20 : 20 + length])
    require("GLB", isinstance(head, dict), "the JSON part is not an object")
    start = 20 + length
    if start + 8 > size:
        return head, b""
    length, kind = struct.unpack_from("<I4s", data, start)
    require("GLB", kind == b"BIN\0", "the second part is not the binary one")
    require("GLB", start + 8 + length <= size, "the binary part is truncated")
    return head, data[start + 8 : start + 8 + length]


class _Reader:
    def __init__(self, head: dict[str, Any], binary: bytes) -> None:
        self._head, self._binary = head, binary
        self._points: list[Floats] = []
        self._colours: list[npt.NDArray[np.uint8] | None] = []
        self._faces: list[npt.NDArray[np.int64]] = []
        self._filled: list[bool] = []
        self._count = self._total = self._nodes = 0

    def mesh(self) -> Mesh:
        head = self._head
        wanted = head.get("extensionsRequired", [])
        require("GLB", not wanted, f"it needs {', '.join(map(str, wanted))}, which is not read")
        scenes = head.get("scenes")
        roots = scenes[head.get("scene", 0)].get("nodes", []) if scenes else []
        for root in roots:
            self._node(root, np.eye(4), 0)
        if not self._faces:
            raise InputError("GLB: there are no triangles", hint="export the surface as triangles")
        points = checked("GLB", np.concatenate(self._points) @ _Z_UP.T * MM)
        mesh = indexed("GLB", points, np.concatenate(self._faces))
        marks = None
        if any(self._filled):
            marks = np.repeat(np.logical_not(self._filled), [len(f) for f in self._faces])
        return Mesh(mesh.vertices, mesh.faces, None, self._colour(), marks)

    def _colour(self) -> npt.NDArray[np.uint8] | None:
        some = [c for c in self._colours if c is not None]
        return np.concatenate(some) if some and len(some) == len(self._colours) else None

    def _node(self, number: int, above: Floats, depth: int) -> None:
        require("GLB", depth < _DEEPEST, f"nodes are nested more than {_DEEPEST} deep")
        self._nodes += 1
        within_limit("GLB", "nodes", self._nodes, _MOST_NODES)
        node = self._head["nodes"][number]
        pose = above @ _pose(node)
        if "mesh" in node:
            shared: dict[int, int] = {}
            for primitive in self._head["meshes"][node["mesh"]]["primitives"]:
                self._primitive(primitive, pose, shared)
        for child in node.get("children", []):
            self._node(child, pose, depth + 1)

    def _primitive(self, primitive: dict[str, Any], pose: Floats, shared: dict[int, int]) -> None:
        """``shared``: where the points of an accessor begin that this mesh has used before."""
        if primitive.get("mode", 4) != 4 or "POSITION" not in primitive["attributes"]:
            return  # points and lines are no surface
        where = primitive["attributes"]["POSITION"]
        if where not in shared:
            points = checked("GLB", self._accessor(where, "VEC3"))
            within_limit("GLB", "vertices", self._count + len(points), 3 * MAX_FACES)
            shared[where] = self._count
            self._points.append(points @ pose[:3, :3].T + pose[:3, 3])
            self._colours.append(self._levels(primitive["attributes"].get("COLOR_0"), len(points)))
            self._count += len(points)
        count = self._head["accessors"][where]["count"]
        corners = np.arange(count)
        if "indices" in primitive:
            given = self._accessor(primitive["indices"], "SCALAR")[:, 0]
            require("GLB", given.dtype.kind == "u", "vertex indices are not whole numbers from 0")
            corners = given.astype(np.int64)
        require(
            "GLB", len(corners) % 3 == 0, f"{len(corners)} vertex indices do not make triangles"
        )
        require("GLB", not len(corners) or int(corners.max()) < count, "a vertex does not exist")
        self._total += len(corners) // 3
        within_limit("GLB", "triangles", self._total)
        faces = corners.reshape(-1, 3) + shared[where]
        self._faces.append(faces if np.linalg.det(pose[:3, :3]) > 0 else faces[:, ::-1])
        materials = self._head.get("materials", [])
        material = primitive.get("material")
        name = "" if material is None else materials[material].get("name", "")
        self._filled.append(name == "filled")

    def _levels(self, number: int | None, count: int) -> npt.NDArray[np.uint8] | None:
        if number is None:
            return None
        about = self._head["accessors"][number]
        values = self._accessor(number, about["type"])[:count, :3]
        require("GLB", bool(np.isfinite(values).all()), "a colour is not a finite number")
        full = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
        return np.rint(255.0 * srgb(np.clip(values / full, 0.0, 1.0))).astype(np.uint8)

    def _accessor(self, number: int, kind: str) -> npt.NDArray[Any]:
        """(n, k) values."""
        about = self._head["accessors"][number]
        require("GLB", about["type"] == kind, f"accessor {number} is {about['type']}, not {kind}")
        require("GLB", "sparse" not in about, f"accessor {number} is sparse, which is not read")
        view = self._head["bufferViews"][about["bufferView"]]
        require("GLB", view["buffer"] == 0, "it refers to another file")
        dtype, width, count = (
            np.dtype(_KINDS[about["componentType"]]),
            _WIDTHS[kind],
            about["count"],
        )
        begin = view.get("byteOffset", 0) + about.get("byteOffset", 0)
        stride = view.get("byteStride", width * dtype.itemsize)
        end = begin + (count - 1) * stride + width * dtype.itemsize if count else begin
        good = count >= 0 and begin >= 0 and stride > 0 and end <= len(self._binary)
        require("GLB", good, f"accessor {number} reaches beyond the binary part")
        last = view.get("byteOffset", 0) + view.get("byteLength", len(self._binary))
        require("GLB", end <= last, f"accessor {number} reaches beyond its buffer view")
        shape, strides = (count, width), (stride, dtype.itemsize)
        return np.ndarray(shape, dtype, self._binary, begin, strides)


def _pose(node: dict[str, Any]) -> Floats:
    """(4, 4) of a node, from its matrix (by columns) or from scale, rotation, translation."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose = np.eye(4)
    pose[:3, :3] = np.array(turn) * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    pose[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return pose

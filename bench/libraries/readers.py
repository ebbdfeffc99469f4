"""Readers of mesh files: time, what comes back, and what becomes of files that are damaged."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare, table
from bench.libraries._part import clean, closed, scanned
from turnscan.errors import TurnscanError
from turnscan.formats import export, read_mesh
from turnscan.mesh import Mesh

PAGE = "0031-readers-libraries.md"
COLUMNS = ["faces", "off at most, mm", "sigma, origin", "damaged: said / other error / taken"]
_DAMAGED = 40
Read = Callable[[bytes, str], Mesh]


def ours(data: bytes, suffix: str) -> Mesh:
    return read_mesh(data, suffix)


def trimesh(data: bytes, suffix: str) -> Mesh:
    import trimesh as library

    found: Any = library.load(io.BytesIO(data), file_type=suffix[1:], force="mesh", process=False)
    return Mesh(found.vertices, found.faces)


def _from_path(data: bytes, suffix: str, read: Callable[[str], Mesh]) -> Mesh:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"part{suffix}"
        path.write_bytes(data)
        return read(str(path))


def meshio(data: bytes, suffix: str) -> Mesh:
    import meshio as library

    def read(path: str) -> Mesh:
        found: Any = library.read(path)
        return Mesh(found.points.astype(np.float64), found.cells_dict["triangle"])

    return _from_path(data, suffix, read)


def open3d(data: bytes, suffix: str) -> Mesh:
    import open3d as library

    def read(path: str) -> Mesh:
        found = library.io.read_triangle_mesh(path)
        if not found.has_triangles():
            raise ValueError("an empty mesh")
        return Mesh(np.asarray(found.vertices), np.asarray(found.triangles))

    return _from_path(data, suffix, read)


def vtk(data: bytes, suffix: str) -> Mesh:
    import pyvista

    def read(path: str) -> Mesh:
        found: Any = pyvista.read(path)
        if isinstance(found, pyvista.MultiBlock):
            found = found.combine().extract_surface()
        return Mesh(np.asarray(found.points, np.float64), found.triangulate().regular_faces)

    return _from_path(data, suffix, read)


def lib3mf(data: bytes, suffix: str) -> Mesh:
    import lib3mf as library

    model = library.get_wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromBuffer(data)
    objects = model.GetMeshObjects()
    if not objects.MoveNext():
        raise ValueError("no mesh")
    one = objects.GetCurrentMeshObject()
    points = [list(v.Coordinates) for v in one.GetVertices()]
    return Mesh(np.array(points), np.array([list(t.Indices) for t in one.GetTriangleIndices()]))


def ezdxf(data: bytes, suffix: str) -> Mesh:
    import ezdxf as library

    document: Any = library.filemanagement.read(io.StringIO(data.decode("ascii")))
    corners = [
        [list(e.dxf.vtx0), list(e.dxf.vtx1), list(e.dxf.vtx2)]
        for e in document.modelspace().query("3DFACE")
    ]
    points = np.array(corners).reshape(-1, 3)
    return Mesh(points, np.arange(len(points), dtype=np.int32).reshape(-1, 3))


_WAYS: dict[str, Read] = {
    "ours": ours, "trimesh": trimesh, "meshio": meshio, "open3d": open3d, "vtk": vtk,
    "lib3mf": lib3mf, "ezdxf": ezdxf,
}  # fmt: skip


def _read(way: str, given: Arrays) -> Arrays:
    mesh = _WAYS[way](given["data"].tobytes(), str(given["suffix"]))
    out = {"vertices": mesh.vertices, "faces": mesh.faces}
    if mesh.provenance is not None:
        out["sigma"] = mesh.provenance.sigma
    return out


def do_ours(given: Arrays) -> Arrays:
    return _read("ours", given)


def do_trimesh(given: Arrays) -> Arrays:
    return _read("trimesh", given)


def do_meshio(given: Arrays) -> Arrays:
    return _read("meshio", given)


def do_open3d(given: Arrays) -> Arrays:
    return _read("open3d", given)


def do_vtk(given: Arrays) -> Arrays:
    return _read("vtk", given)


def do_lib3mf(given: Arrays) -> Arrays:
    return _read("lib3mf", given)


def do_ezdxf(given: Arrays) -> Arrays:
    return _read("ezdxf", given)


def damaged(data: bytes, seed: int = 0) -> list[bytes]:
    """Files cut short, and files with bytes that somebody changed, from the start on."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(_DAMAGED):
        if k % 2:
            out.append(data[: int(rng.integers(1, len(data)))])
        else:
            other = bytearray(data)
            for at in rng.integers(0, min(len(data), 4000), 5):
                other[at] = int(rng.integers(0, 256))
            out.append(bytes(other))
    return out


def _survive(way: str, given: Arrays) -> Arrays:
    """How many damaged files are refused by an error that says so, by another, or taken."""
    count = np.zeros(3, dtype=np.int64)
    plain = (ValueError, OSError) if way != "ours" else (TurnscanError,)
    for data in damaged(given["data"].tobytes()):
        try:
            _WAYS[way](data, str(given["suffix"]))
        except plain:
            count[0] += 1
        except (Exception, SystemExit):
            count[1] += 1
        else:
            count[2] += 1
    return {"count": count}


def survive_ours(given: Arrays) -> Arrays:
    return _survive("ours", given)


def survive_trimesh(given: Arrays) -> Arrays:
    return _survive("trimesh", given)


def survive_meshio(given: Arrays) -> Arrays:
    return _survive("meshio", given)


def survive_open3d(given: Arrays) -> Arrays:
    return _survive("open3d", given)


def survive_vtk(given: Arrays) -> Arrays:
    return _survive("vtk", given)


def survive_lib3mf(given: Arrays) -> Arrays:
    return _survive("lib3mf", given)


def survive_ezdxf(given: Arrays) -> Arrays:
    return _survive("ezdxf", given)


_LICENCES = {
    "ours": ("", "Apache-2.0"), "trimesh": ("trimesh", "MIT"), "meshio": ("meshio", "MIT"),
    "open3d": ("open3d-cpu", "MIT"), "vtk": ("pyvista", "BSD-3, MIT"),
    "lib3mf": ("lib3mf", "BSD-2"), "ezdxf": ("ezdxf", "MIT"),
}  # fmt: skip
_FILES = {
    ".ply": ("ours", "trimesh", "meshio", "open3d", "vtk"),
    ".glb": ("ours", "trimesh", "open3d", "vtk"),
    ".3mf": ("ours", "trimesh", "lib3mf"),
    ".dxf": ("ours", "ezdxf"),
}


def _contenders(suffix: str, job: str) -> list[Contender]:
    return [Contender(way, globals()[f"{job}_{way}"], *_LICENCES[way]) for way in _FILES[suffix]]


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Faces, how far the vertices are off, and whether the origin of the vertices came along."""
    if "count" in made:
        return {COLUMNS[3]: " / ".join(str(n) for n in made["count"])}
    old, new = judge.mesh_of(given), judge.mesh_of(made)
    same = len(old.faces) == len(new.faces)
    off = float(np.abs(old.triangles - new.triangles).max()) if same else float("nan")
    values = [str(len(new.faces)), f"{off:.1e}", "yes" if "sigma" in made else "no"]
    return dict(zip(COLUMNS[:3], values, strict=True))


def _cells(lines: list[str]) -> list[list[str]]:
    return [[cell.strip() for cell in line[1:-1].split("|")] for line in lines]


def measure(quick: bool = False) -> list[str]:
    """The lines of the tables."""
    part = scanned(clean(*(100, 120) if quick else (300, 320)))
    few = closed(scanned(clean(24, 30)))
    out = list[str]()
    for suffix in _FILES:
        data = export(part, suffix)
        given = {
            "data": np.frombuffer(data, np.uint8), "suffix": np.str_(suffix),
            "vertices": part.vertices, "faces": part.faces,
        }  # fmt: skip
        print(suffix, flush=True)
        read = compare(_contenders(suffix, "do"), given, figures, COLUMNS[:3])
        small = np.frombuffer(export(few, suffix), np.uint8)
        broken = {"data": small, "suffix": np.str_(suffix)}
        torn = compare(_contenders(suffix, "survive"), broken, figures, COLUMNS[3:])
        rows = [[*a[:7], b[4], *a[8:]] for a, b in zip(_cells(read), _cells(torn), strict=True)]
        rows[0][7] = COLUMNS[3]
        out += [
            f"{suffix}, {len(part.faces)} faces, {len(data) / 1e6:.1f} MB; {_DAMAGED} damaged:",
            "",
        ]
        out += [*table(rows[0], rows[2:]), ""]
    return out[:-1]

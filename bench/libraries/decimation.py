"""Decimation of a torn scan: to a tenth of its faces, and to what a tolerance allows."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean, scanned, torn
from turnscan.mesh import Mesh
from turnscan.surface.decimation import decimate

PAGE = "0025-decimation-libraries.md"
TOLERANCE = 0.05
"""mm that no place of either surface may be off."""
_HALVINGS = 7
COLUMNS = [
    "faces", "off at most, mm", "rms, mm", "border off, mm", "vertices that were measured",
    "crowded / crossing",
]  # fmt: skip
Reduce = Callable[[Mesh, int], Mesh]


def ours(mesh: Mesh, faces: int) -> Mesh:
    return decimate(mesh, faces=faces)


def fast_simplification(mesh: Mesh, faces: int) -> Mesh:
    import fast_simplification as library

    points, corners = mesh.vertices.astype(np.float32), mesh.faces.copy()
    return Mesh(*library.simplify(points, corners, target_count=faces)[:2])


def pyfqmr(mesh: Mesh, faces: int) -> Mesh:
    import pyfqmr as library

    job = library.Simplify()
    job.setMesh(mesh.vertices.copy(), mesh.faces.copy())
    job.simplify_mesh(target_count=faces, preserve_border=True, verbose=False)
    vertices, left, _ = job.getMesh()
    return Mesh(vertices, left)


def open3d(mesh: Mesh, faces: int) -> Mesh:
    import open3d as library

    given = library.geometry.TriangleMesh(
        library.utility.Vector3dVector(mesh.vertices.copy()),
        library.utility.Vector3iVector(mesh.faces.copy()),
    )
    left = given.simplify_quadric_decimation(faces, boundary_weight=100.0)
    return Mesh(np.asarray(left.vertices), np.asarray(left.triangles))


def libigl(mesh: Mesh, faces: int) -> Mesh:
    import igl

    made: Any = igl.qslim(
        np.asfortranarray(mesh.vertices), np.asfortranarray(mesh.faces, np.int32), faces
    )
    return Mesh(made[0], made[1])


def vtk(mesh: Mesh, faces: int) -> Mesh:
    import pyvista

    given = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    left = given.decimate(
        1 - faces / len(mesh.faces), boundary_constraints=True, boundary_weight=100.0
    )
    return Mesh(np.asarray(left.points, dtype=np.float64), left.regular_faces)


_WAYS: dict[str, Reduce] = {
    "ours": ours, "fast_simplification": fast_simplification, "pyfqmr": pyfqmr, "open3d": open3d,
    "libigl": libigl, "vtk": vtk,
}  # fmt: skip


def _tenth(way: str, given: Arrays) -> Arrays:
    mesh = judge.mesh_of(given)
    left = _WAYS[way](mesh, len(mesh.faces) // 10)
    return {"vertices": left.vertices, "faces": left.faces}


def do_ours(given: Arrays) -> Arrays:
    return _tenth("ours", given)


def do_fast_simplification(given: Arrays) -> Arrays:
    return _tenth("fast_simplification", given)


def do_pyfqmr(given: Arrays) -> Arrays:
    return _tenth("pyfqmr", given)


def do_open3d(given: Arrays) -> Arrays:
    return _tenth("open3d", given)


def do_libigl(given: Arrays) -> Arrays:
    return _tenth("libigl", given)


def do_vtk(given: Arrays) -> Arrays:
    return _tenth("vtk", given)


def within_ours(given: Arrays) -> Arrays:
    """Ours is asked for the tolerance itself."""
    left = decimate(judge.mesh_of(given), tolerance=TOLERANCE)
    return {"vertices": left.vertices, "faces": left.faces}


def _within(way: str, given: Arrays) -> Arrays:
    """The fewest faces with which a way that knows no tolerance stays inside it, by bisection."""
    mesh = judge.mesh_of(given)
    low, high, best, seconds = 0, len(mesh.faces), mesh, float("nan")
    for _ in range(_HALVINGS):
        half = (low + high) // 2
        start = time.process_time()
        left = _WAYS[way](mesh, half)
        spent = time.process_time() - start
        if judge.hausdorff(mesh, left)[0] <= TOLERANCE:
            high, best, seconds = half, left, spent
        else:
            low = half
    return {"vertices": best.vertices, "faces": best.faces, "_seconds": np.float64(seconds)}


def within_fast_simplification(given: Arrays) -> Arrays:
    return _within("fast_simplification", given)


def within_pyfqmr(given: Arrays) -> Arrays:
    return _within("pyfqmr", given)


def within_open3d(given: Arrays) -> Arrays:
    return _within("open3d", given)


def within_libigl(given: Arrays) -> Arrays:
    return _within("libigl", given)


def within_vtk(given: Arrays) -> Arrays:
    return _within("vtk", given)


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """How far off, what became of the border and of the vertices, what is unsound."""
    old, new = judge.mesh_of(given), judge.mesh_of(made)
    most, rms = judge.hausdorff(old, new)
    found = [
        f"{len(new.faces)}", f"{most:.3f}", f"{rms:.4f}", f"{judge.border_shift(old, new):.3f}",
        f"{judge.kept(old, new):.0%}", judge.faults(new),
    ]  # fmt: skip
    return dict(zip(COLUMNS, found, strict=True))


def _contenders(job: str) -> list[Contender]:
    return [
        Contender("ours", globals()[f"{job}_ours"]),
        Contender("fast-simplification", globals()[f"{job}_fast_simplification"],
                  "fast-simplification", "MIT"),
        Contender("pyfqmr", globals()[f"{job}_pyfqmr"], "pyfqmr", "MIT", "preserve_border"),
        Contender("Open3D quadric", globals()[f"{job}_open3d"], "open3d-cpu", "MIT",
                  "boundary_weight 100"),
        Contender("libigl qslim", globals()[f"{job}_libigl"], "libigl", "MPL-2.0"),
        Contender("VTK quadric", globals()[f"{job}_vtk"], "pyvista", "BSD-3, MIT",
                  "boundary_weight 100"),
    ]  # fmt: skip


def measure(quick: bool = False) -> list[str]:
    """The lines of both tables."""
    large = torn(scanned(clean(*(200, 250) if quick else (450, 446))), 12 if quick else 33)
    small = torn(scanned(clean(120, 150)), 6)
    given = {"vertices": large.vertices, "faces": large.faces}
    out = [f"{len(large.faces)} faces to a tenth:", ""]
    out += compare(_contenders("do"), given, figures, COLUMNS)
    given = {"vertices": small.vertices, "faces": small.faces}
    head = (
        f"{len(small.faces)} faces to the fewest within {TOLERANCE} mm: ours is asked for that, "
        "all others by bisection with this measure (s: of the call that reached it):"
    )
    out += ["", head, ""]
    return out + compare(_contenders("within"), given, figures, COLUMNS)

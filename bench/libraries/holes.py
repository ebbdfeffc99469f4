"""Holes of a torn scan filled: how near to what was there, how soundly, with what marks."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from bench.libraries import _judge as judge
from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean, scanned, torn
from turnscan.mesh import Mesh, boundary_loops
from turnscan.surface.holes import fill_soundly, holes

PAGE = "0028-holes-libraries.md"
COLUMNS = [
    "holes left", "faces added", "off at most, mm", "rms, mm", "median hole, mm", "vertices kept",
    "crowded / crossing",
]  # fmt: skip
_WIDE = 40.0
"""mm: holes wider than this are the ends of the part, which stay open."""


def _made(vertices: object, faces: object) -> Arrays:
    return {
        "vertices": np.asarray(vertices, dtype=np.float64),
        "faces": np.asarray(faces, dtype=np.int32),
    }


def do_ours(given: Arrays) -> Arrays:
    mesh = judge.mesh_of(given)
    small = [h for h in holes(mesh) if np.ptp(mesh.vertices[h.loop], axis=0).max() < _WIDE / 2]
    done = fill_soundly(mesh, small)
    return _made(done.mesh.vertices, done.mesh.faces)


def do_open3d(given: Arrays) -> Arrays:
    import open3d

    mesh = open3d.t.geometry.TriangleMesh(
        open3d.core.Tensor(given["vertices"].astype(np.float32)),
        open3d.core.Tensor(given["faces"].astype(np.int64)),
    )
    done = mesh.fill_holes(hole_size=_WIDE / 4)
    return _made(done.vertex.positions.numpy(), done.triangle.indices.numpy())


def do_vtk(given: Arrays) -> Arrays:
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(given["vertices"], given["faces"])
    done = mesh.fill_holes(_WIDE / 4)
    return _made(done.points, done.regular_faces)


def do_trimesh(given: Arrays) -> Arrays:
    import trimesh

    mesh = trimesh.Trimesh(given["vertices"], given["faces"], process=False)
    trimesh.repair.fill_holes(mesh)
    return _made(mesh.vertices, mesh.faces)


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Holes that are left, and how far the added faces lie from the surface that was torn out."""
    old, new = judge.mesh_of(given), _welded(judge.mesh_of(made))
    truth = judge.mesh_of(given, "true_")
    left = sum(np.ptp(new.vertices[loop], axis=0).max() < _WIDE / 2 for loop in boundary_loops(new))
    known = {t.tobytes() for t in np.sort(_corners(old), axis=1)}
    added = np.array([t.tobytes() not in known for t in np.sort(_corners(new), axis=1)])
    filled = Mesh(new.vertices, new.faces[added])
    away = judge.distances(judge.samples(filled), truth) if added.any() else np.full(1, np.nan)
    middles = [old.vertices[h].mean(axis=0) for h in boundary_loops(old)]
    middles = [m for m in middles if np.linalg.norm(m[:2]) > 5.0]
    nearest = cKDTree(middles).query(judge.samples(filled))[1] if added.any() else [0]
    each = [away[nearest == k].max() for k in np.unique(nearest)]
    there = {p.tobytes() for p in new.vertices.astype(np.float32)}
    stay = np.mean([p.tobytes() in there for p in old.vertices.astype(np.float32)])
    found = [
        str(left), str(int(added.sum())), f"{away.max():.3f}",
        f"{np.sqrt((away**2).mean()):.3f}", f"{np.median(each):.3f}", f"{stay:.0%}",
        judge.faults(new),
    ]  # fmt: skip
    return dict(zip(COLUMNS, found, strict=True))


def _welded(mesh: Mesh) -> Mesh:
    """Corners at one place are one: some libraries put faces beside the border, not on it."""
    places, which = np.unique(mesh.vertices.astype(np.float32), axis=0, return_inverse=True)
    return Mesh(places.astype(np.float64), which.ravel()[mesh.faces].astype(np.int32))


def _corners(mesh: Mesh) -> judge.Floats:
    """(f, 3) a number for each corner's place, whatever its number in the mesh is."""
    x = mesh.vertices.astype(np.float32).astype(np.float64)
    place: judge.Floats = x @ np.array([1.0, np.pi * 1e3, np.e * 1e6])
    return place[mesh.faces]


def measure(quick: bool = False) -> list[str]:
    """The lines of the table."""
    true = clean(*(200, 250) if quick else (450, 446))
    part = torn(scanned(true), 12 if quick else 33)
    given = {
        "vertices": part.vertices, "faces": part.faces,
        "true_vertices": true.vertices, "true_faces": true.faces,
    }  # fmt: skip
    count = len(boundary_loops(part)) - 2
    contenders = [
        Contender("ours", do_ours, note="fill_soundly, auto"),
        Contender("Open3D", do_open3d, "open3d-cpu", "MIT", "fill_holes"),
        Contender("VTK", do_vtk, "pyvista", "BSD-3, MIT", "fill_holes"),
        Contender("trimesh", do_trimesh, "trimesh", "MIT", "repair.fill_holes"),
    ]
    head = f"{len(part.faces)} faces, {count} holes of 2 to 10 mm across, both ends to stay open:"
    return [head, "", *compare(contenders, given, figures, COLUMNS)]

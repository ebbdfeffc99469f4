"""Rays: from inside a closed part, where each must hit, and from a camera beside it."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from bench.libraries._contest import Arrays, Contender, compare
from bench.libraries._part import clean, closed, scanned
from turnscan.mesh._ray_tree import TreeScene

PAGE = "0026-rays-libraries.md"
COLUMNS = ["building, s", "rays a second", "went through", "other face", "off at most, mm"]


def _done(built: float, spent: float, face: Any) -> Arrays:
    return {
        "face": np.asarray(face, dtype=np.int64), "_seconds": np.float64(built + spent),
        "_built": np.float64(built), "_spent": np.float64(spent),
    }  # fmt: skip


def do_tree(given: Arrays) -> Arrays:
    start = time.process_time()
    scene = TreeScene(given["vertices"], given["faces"])
    built = time.process_time()
    face = scene.run(given["origins"], given["ways"])
    return _done(built - start, time.process_time() - built, face)


def do_embree(given: Arrays) -> Arrays:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    start = time.process_time()
    scene = EmbreeScene()
    TriangleMesh(scene, given["vertices"].astype(np.float32), given["faces"].astype(np.int32))
    # Embree builds its tree with the first ray.
    scene.run(given["origins"][:1], given["ways"][:1])
    built = time.process_time()
    face = scene.run(given["origins"], given["ways"])
    return _done(built - start, time.process_time() - built, face)


def do_open3d(given: Arrays) -> Arrays:
    import open3d

    start = time.process_time()
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(given["vertices"].astype(np.float32), given["faces"].astype(np.uint32))
    rays = np.concatenate([given["origins"], given["ways"]], axis=1)
    scene.cast_rays(rays[:1])
    built = time.process_time()
    face = scene.cast_rays(rays)["primitive_ids"].numpy().astype(np.int64)
    spent = time.process_time() - built
    return _done(built - start, spent, np.where(face == scene.INVALID_ID, -1, face))


def _few(given: Arrays) -> Arrays:
    return {**given, "origins": given["origins"][:_FEW], "ways": given["ways"][:_FEW]}


_FEW = 2_000
"""Rays for those that take milliseconds for each."""


def do_trimesh(given: Arrays) -> Arrays:
    import trimesh
    from trimesh.ray.ray_triangle import RayMeshIntersector

    few = _few(given)
    start = time.process_time()
    scene = RayMeshIntersector(trimesh.Trimesh(few["vertices"], few["faces"], process=False))
    built = time.process_time()
    face = scene.intersects_first(few["origins"].astype(np.float64), few["ways"].astype(np.float64))
    return _done(built - start, time.process_time() - built, face)


def figures(given: Arrays, made: Arrays) -> dict[str, str]:
    """Rate, rays that missed though the part is closed, and how the hits differ from the exact."""
    face = made["face"]
    n = len(face)
    o, d = given["origins"][:n].astype(np.float64), given["ways"][:n].astype(np.float64)
    hit = face >= 0
    through = int((given["inside"][:n] & ~hit).sum())
    same = face == given["exact"][:n]
    both = hit & (given["exact"][:n] >= 0) & ~same
    corners = given["vertices"][given["faces"]]

    def away(which: Any) -> Any:
        t = corners[which[both]]
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        return ((t[:, 0] - o[both]) * normal).sum(axis=1) / (d[both] * normal).sum(axis=1)

    gap = np.abs(away(face) - away(given["exact"][:n])).max(initial=0.0)
    found = [
        f"{made['_built']:.2f}", f"{n / made['_spent'] / 1e6:.3f} M", str(through),
        f"{(~same).mean():.1e}", f"{gap:.3f}",
    ]  # fmt: skip
    return dict(zip(COLUMNS, found, strict=True))


def measure(quick: bool = False) -> list[str]:
    """The lines of the table."""
    part = closed(scanned(clean(*(200, 250) if quick else (450, 446))))
    rng = np.random.default_rng(0)
    n = 100_000 if quick else 500_000
    inside = np.tile([2.0, 1.0, 60.0], (n, 1))
    ways = rng.normal(size=(n, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    # From a camera at 400 mm to places on the part, most of them hidden behind others.
    eye = np.array([400.0, 0.0, 120.0])
    goals = part.triangles.mean(axis=1)[rng.integers(0, len(part.faces), n)]
    seen = goals - eye
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    origins = np.concatenate([inside, np.tile(eye, (n, 1))]).astype(np.float32)
    both = np.concatenate([ways, seen]).astype(np.float32)
    order = rng.permutation(2 * n)
    given = {
        "vertices": part.vertices, "faces": part.faces,
        "origins": origins[order], "ways": both[order], "inside": order < n,
    }  # fmt: skip
    # What is exact: our tree computes with 64 bits; the others are judged by how far they differ.
    given["exact"] = TreeScene(part.vertices, part.faces).run(origins[order], both[order])
    contenders = [
        Contender("our tree", do_tree),
        Contender("Embree", do_embree, "embreex", "BSD-2, Apache-2.0", "core where its wheel is"),
        Contender("Open3D", do_open3d, "open3d-cpu", "MIT", "Embree inside"),
        Contender("trimesh with rtree", do_trimesh, "trimesh", "MIT", f"{_FEW} rays"),
    ]  # fmt: skip
    out = [f"{len(part.faces)} faces, {2 * n} rays in no order (s: building and casting all):", ""]
    return out + compare(contenders, given, figures, COLUMNS)

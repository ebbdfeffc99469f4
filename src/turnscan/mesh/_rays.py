"""Rays against triangles: Intel Embree where its wheel exists, else our own tree."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Singles

_LIFT = 2e-3
"""mm that a ray to the light starts off its surface, lest it hit its own triangle."""


class Caster:
    """Nearest hits and occlusion of many rays against one fixed set of triangles."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        self._origin = vertices.mean(axis=0)
        self._scene = _scene(vertices - self._origin, faces)

    def first_hits(self, origin: Floats, directions: Floats | Singles) -> Ints:
        """Rays from one point (3,) along (n, 3) → (n,) face that each meets first, −1 for none."""
        d = np.ascontiguousarray(directions, dtype=np.float32)
        o = np.broadcast_to((origin - self._origin).astype(np.float32), d.shape)
        return np.asarray(self._scene.run(np.ascontiguousarray(o), d), dtype=np.int32)

    def first_hits_between(self, origins: Floats, directions: Floats) -> Ints:
        """Rays from points (n, 3) along (n, 3) → (n,) face that each meets first, −1 for none."""
        o = np.ascontiguousarray(origins - self._origin, dtype=np.float32)
        d = np.ascontiguousarray(directions, dtype=np.float32)
        return np.asarray(self._scene.run(o, d), dtype=np.int32)

    def visible(self, points: Floats, normals: Floats, light: npt.ArrayLike) -> Bools:
        """(n,) True where nothing stands between the points (n, 3) and the light (3,) or (n, 3)."""
        o = points - self._origin
        o += _LIFT * normals
        way = (np.asarray(light, dtype=np.float64) - self._origin) - o
        ones = np.full(len(o), 1.0 - 1e-4, dtype=np.float32)
        blocked = self._scene.run(
            np.ascontiguousarray(o, dtype=np.float32),
            np.ascontiguousarray(way, dtype=np.float32),
            ones,
            query="OCCLUDED",
        )
        return np.asarray(blocked) < 0


def _scene(vertices: Floats, faces: Ints) -> Any:
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        from turnscan.mesh._ray_tree import TreeScene

        return TreeScene(vertices, faces)
    scene = EmbreeScene()
    TriangleMesh(scene, vertices.astype(np.float32), np.ascontiguousarray(faces, dtype=np.int32))
    return scene

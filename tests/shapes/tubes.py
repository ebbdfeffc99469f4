"""A tube with noise, whose sizes are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnscan.mesh import Mesh, Provenance

NOISE = 0.05


def cylinder(radius: float, height: float, n: int = 40, m: int = 15) -> Mesh:
    """Closed: a wall of n × m points and two fans."""
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    z = np.linspace(0, height, m)
    wall = np.stack(
        [np.tile(radius * np.cos(a), m), np.tile(radius * np.sin(a), m), np.repeat(z, n)], axis=-1
    )
    v = np.concatenate([wall, [(0, 0, 0), (0, 0, height)]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    faces = []
    for r in range(m - 1):
        lo, hi = r * n, (r + 1) * n
        faces += [np.stack([lo + k, lo + after, hi + after], axis=-1)]
        faces += [np.stack([lo + k, hi + after, hi + k], axis=-1)]
    low, top = np.full(n, n * m), np.full(n, n * m + 1)
    faces += [np.stack([low, after, k], axis=-1)]
    faces += [np.stack([top, (m - 1) * n + k, (m - 1) * n + after], axis=-1)]
    return Mesh(v, np.concatenate(faces))


def noisy(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    v = len(mesh.vertices)
    zero = np.zeros(v, np.int32)
    p = Provenance(np.full(v, NOISE), zero, zero, zero, ("left",))
    return replace(mesh, vertices=mesh.vertices + rng.normal(0, NOISE, (v, 3)), provenance=p)


def wall_of(mesh: Mesh) -> np.ndarray:
    return mesh.faces.max(axis=1) < len(mesh.vertices) - 2

"""Surfaces for the tests of the editor: small, of known shape, with noise where wanted."""

from __future__ import annotations

import numpy as np

from turnscan.mesh import Mesh, Provenance


def sheet(n: int = 24, seed: int = 0, noise: float = 0.0, size: float = 40.0) -> Mesh:
    """A wavy rectangle of 2(n − 1)² faces, ``size`` mm wide, at a height of about 10 mm."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    x, y = (k.ravel() * size / (n - 1) for k in (i, j))
    vertices = np.stack([x, y, 10 + np.sin(x / 6) + np.cos(y / 5)], axis=-1)
    vertices += np.random.default_rng(seed).normal(0, noise, vertices.shape) if noise else 0.0
    q = (i[:-1, :-1] * n + j[:-1, :-1]).ravel()
    upper = np.stack([q, q + n, q + 1], axis=-1)
    lower = np.stack([q + 1, q + n, q + n + 1], axis=-1)
    faces = np.stack([upper, lower], axis=1).reshape(-1, 3)
    v = n * n
    provenance = Provenance(
        np.full(v, 0.02), np.zeros(v, int), i.ravel(), j.ravel(), lasers=("left",)
    )
    return Mesh(vertices, faces, provenance)


def around(mesh: Mesh, centre: tuple[float, float], radius: float) -> np.ndarray:
    """Numbers of the faces whose centroid is within a circle seen from above."""
    c = mesh.triangles.mean(axis=1)[:, :2] - centre
    return np.flatnonzero(np.hypot(*c.T) < radius)

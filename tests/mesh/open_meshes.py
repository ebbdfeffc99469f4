"""Open meshes: a plate with missing squares, a ball with a cap cut off."""

from __future__ import annotations

import numpy as np

from turnscan.mesh import Mesh, submesh


def plate(n: int, missing=(), spacing: float = 1.0) -> Mesh:
    """n × n squares in the plane z = 0, without those that ``missing`` names (column, row)."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    vertices = spacing * np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    faces = []
    for j in range(n):
        for i in range(n):
            if (i, j) not in missing:
                a = j * (n + 1) + i
                faces += [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    return Mesh(vertices, np.array(faces))


def ball(n: int, noise: float = 0.0, seed: int = 0) -> Mesh:
    """A ball of radius 10 in n rings, closed."""
    rng = np.random.default_rng(seed)
    theta = np.pi * np.arange(1, n) / n
    phi = 2 * np.pi * np.arange(2 * n) / (2 * n)
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), 0 * phi + 1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    faces = []
    for i in range(n - 2):
        for j in range(2 * n):
            a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
            faces += [[a, a + 2 * n, b + 2 * n], [a, b + 2 * n, b]]
    top, bottom = len(ring), len(ring) + 1
    for j in range(2 * n):
        a, b = j, (j + 1) % (2 * n)
        faces += [[top, a, b], [bottom, b + (n - 2) * 2 * n, a + (n - 2) * 2 * n]]
    unit = np.concatenate([ring, [[0, 0, 1], [0, 0, -1.0]]])
    vertices = unit * (10.0 + noise * rng.standard_normal((len(unit), 1)))
    return Mesh(vertices, np.array(faces), None)


def opened(mesh: Mesh, direction, angle: float) -> Mesh:
    """The mesh without the faces within an angle of a direction."""
    middle = mesh.triangles.mean(axis=1)
    cosine = middle @ np.asarray(direction) / np.linalg.norm(middle, axis=1)
    return submesh(mesh, cosine < np.cos(angle))


def same_measured(before: Mesh, after: Mesh) -> bool:
    return bool(
        np.array_equal(after.vertices[: len(before.vertices)], before.vertices)
        and np.array_equal(after.faces[: len(before.faces)], before.faces)
        and after.measured[: len(before.faces)].all()
        and not after.measured[len(before.faces) :].any()
    )

"""Dense meshes of exact bodies, as a scan gives them: even vertices, noise along the normal."""

from __future__ import annotations

import itertools

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance, vertex_normals


def lines(corners: list[tuple[float, float]], step: float) -> Floats:
    """Points (n, 2) along a polyline, about ``step`` apart, each corner one of them."""
    out = [np.asarray(corners[0], dtype=float)]
    for a, b in itertools.pairwise(corners):
        d = np.subtract(b, a)
        n = max(1, round(float(np.hypot(*d)) / step))
        out += [np.asarray(a) + d * (k / n) for k in range(1, n + 1)]
    return np.array(out)


def turned(corners: list[tuple[float, float]], step: float, around: int) -> Mesh:
    """A profile (r, z) from bottom to top, outside to the right, turned about z; no caps."""
    p = lines(corners, step)
    t = np.arange(around) * (2 * np.pi / around)
    grid = np.stack(
        [
            p[:, None, 0] * np.cos(t),
            p[:, None, 0] * np.sin(t),
            np.repeat(p[:, 1:], around, axis=1),
        ],
        axis=-1,
    )
    return wrapped(grid)


def prism(outline: list[tuple[float, float]], height: float, step: float) -> Mesh:
    """The walls of a closed outline (counter-clockwise) from z = 0 up; no caps."""
    p = lines([*outline, outline[0]], step)[:-1]
    z = np.arange(0, height + step / 2, step)
    grid = np.stack([np.column_stack([p, np.full(len(p), h)]) for h in z])
    return wrapped(grid)


def closed_box() -> Mesh:
    """24 × 16 × 12 mm from z = 0 up, with vertices a millimetre apart on all sides."""
    walls = prism([(0.0, 0.0), (24.0, 0.0), (24.0, 16.0), (0.0, 16.0)], 12.0, 1.0)
    x, y = np.arange(0, 25.0), np.arange(0, 17.0)
    flat = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(24), np.arange(16), indexing="ij"))
    a = i * 17 + j
    up = np.concatenate([np.column_stack([a, a + 17, a + 18]), np.column_stack([a, a + 18, a + 1])])
    X, F = [walls.vertices], [walls.faces]
    for height, faces in ((12.0, up), (0.0, up[:, ::-1])):
        F.append(faces + sum(map(len, X)))
        X.append(np.column_stack([flat, np.full(len(flat), height)]))
    every = np.round(np.concatenate(X), 6)
    once, back = np.unique(every, axis=0, return_inverse=True)
    return Mesh(once, back.reshape(-1)[np.concatenate(F)])


def wrapped(grid: Floats) -> Mesh:
    """Triangles of a grid (rows, columns, 3) whose columns close; rows go up, columns around."""
    rows, columns, _ = grid.shape
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a = (i * columns + j).ravel()
    b = (i * columns + (j + 1) % columns).ravel()
    faces = np.concatenate(
        [np.column_stack([a, b, b + columns]), np.column_stack([a, b + columns, a + columns])]
    )
    return Mesh(grid.reshape(-1, 3), faces)


def noisy(mesh: Mesh, sigma: float, seed: int) -> Mesh:
    """Each vertex moved along its normal by independent noise, mm."""
    dice = np.random.default_rng(seed)
    n = np.nan_to_num(vertex_normals(mesh))
    return Mesh(mesh.vertices + n * dice.normal(0, sigma, len(n))[:, None], mesh.faces)


def averaged(mesh: Mesh, sigma: float, seed: int, rounds: int = 1) -> Mesh:
    """Noise that neighbours share, as a merge leaves it that averages them; each says its sigma."""
    dice = np.random.default_rng(seed)
    off = dice.normal(size=len(mesh.vertices))
    a, b = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).T
    for _ in range(rounds):
        total, count = off.copy(), np.ones(len(off))
        for one, other in ((a, b), (b, a)):
            np.add.at(total, one, off[other])
            np.add.at(count, one, 1)
        off = total / count
    off *= sigma / off.std()
    none = np.zeros(len(off), dtype=np.int32)
    origin = Provenance(np.full(len(off), sigma), none, none - 1, none, ("red", "green"))
    n = vertex_normals(mesh)
    return Mesh(mesh.vertices + n * off[:, None], mesh.faces, provenance=origin)

"""Closed parts made from numbers, and what is in a zip."""

from __future__ import annotations

import io
import zipfile

import numpy as np

from turnscan.mesh import Mesh, Provenance


def torus(n: int, m: int, large: float = 40.0, small: float = 15.0) -> Mesh:
    """A torus about z of 2·n·m triangles."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    out = large + small * np.cos(v)
    points = np.stack([out * np.cos(u), out * np.sin(u), small * np.sin(v)], axis=-1)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Mesh(points.reshape(-1, 3), faces)


def box_with_hole(n: int = 48, side: float = 31.7, height: float = 12.3, hole: float = 9.1) -> Mesh:
    """A square plate with a round hole, off the axis; n is a multiple of 4."""
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = round_ / np.abs(round_).max(axis=1, keepdims=True) * side / 2
    rings = [(square, 0.0), (square, height), (round_ * hole, height), (round_ * hole, 0.0)]
    points = np.concatenate([np.column_stack([xy, np.full(n, z)]) for xy, z in rings])
    i = np.arange(n)
    k = (i + 1) % n
    faces = []
    for ring in range(4):
        low, high = ring * n, (ring + 1) % 4 * n
        faces += [
            np.stack([low + i, low + k, high + k], axis=1),
            np.stack([low + i, high + k, high + i], axis=1),
        ]
    return Mesh(points + [3.3, -7.7, 1.1], np.concatenate(faces))


def measured(mesh: Mesh) -> Mesh:
    """The mesh with made-up values at each vertex, some of them missing."""
    rng = np.random.default_rng(5)
    v = len(mesh.vertices)
    sigma = rng.uniform(0.001, 0.2, v)
    sigma[:: max(v // 3, 1)] = np.nan
    origin = Provenance(
        sigma,
        rng.integers(-1, 2, v).astype(np.int32),
        rng.integers(-1, 400, v).astype(np.int32),
        rng.integers(-1, 2048, v).astype(np.int32),
        ("left", "right hand"),
    )
    return Mesh(mesh.vertices, mesh.faces, origin, rng.integers(0, 256, (v, 3)).astype(np.uint8))


MODEL = "3D/3dmodel.model"


def inside(data: bytes, suffix: str) -> bytes:
    """The text of the file, unpacked where it is a zip."""
    if suffix != ".3mf":
        return data
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        return file.read(MODEL)


def outside(text: bytes, suffix: str) -> bytes:
    """The file with this text."""
    if suffix != ".3mf":
        return text
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        file.writestr(MODEL, text)
    return out.getvalue()

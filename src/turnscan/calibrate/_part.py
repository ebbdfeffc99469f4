"""A drawn part as a body: how far points are from its triangles, and ways in which it may stand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.errors import InputError
from turnscan.rig import Pose

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_SAMPLES, _COARSE = 60_000, 3000
"""Places on the surface: those near which the nearest triangle is looked for, and those that points
are brought onto at first."""
_NEAR = 4
"""Places near a point whose triangles are looked at."""
_TURNS, _ROUNDS, _FEW = 480, 4, 150
"""Rotations that are tried, rounds for each, and points that are looked at."""
_MORE, _MORE_ROUNDS = 80, 20
"""The best of them, and further rounds for each."""
_UNLIKE = np.radians(15.0)
"""Rotations that differ by less are one way to stand."""
_GOLDEN = 1.533751168755204288118041
"""ψ⁴ = ψ + 4."""


@dataclass(frozen=True, eq=False)
class Part:
    """A surface of triangles in a frame of its own; its one size is its scale, nominally 1."""

    vertices: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3), outward counter-clockwise."""

    def __post_init__(self) -> None:
        if not len(self.faces) or not self._areas.sum() > 0:
            raise InputError("the drawn part has no surface", hint="give a mesh with triangles")

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return "part"

    @property
    def size_names(self) -> tuple[str, ...]:
        """Of its one size."""
        return ("scale",)

    @property
    def moves(self) -> Floats:
        """As of `Balls`; what turns or shifts it within itself is found by the adjustment."""
        return np.eye(6)

    @cached_property
    def _corners(self) -> Floats:
        """(f, 3, 3)"""
        corners: Floats = np.asarray(self.vertices, dtype=np.float64)[self.faces]
        return corners

    @cached_property
    def _normals(self) -> Floats:
        """(f, 3), as long as twice the area."""
        c = self._corners
        return np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])

    @cached_property
    def _areas(self) -> Floats:
        areas: Floats = np.linalg.norm(self._normals, axis=1) / 2
        return areas

    @cached_property
    def _samples(self) -> tuple[Floats, Ints]:
        """Places on the surface (m, 3), evenly spread, and their triangles (m,)."""
        share = self._areas / self._areas.sum()
        face = np.searchsorted(np.cumsum(share), (np.arange(_SAMPLES) + 0.5) / _SAMPLES)
        face = np.minimum(face, len(share) - 1)
        face = np.concatenate([face, np.flatnonzero(share > 0)])
        # A sequence of low discrepancy (Roberts, 2018), folded into the triangle.
        a, b = (
            np.arange(1, len(face) + 1)[:, None] * (0.7548776662466927, 0.5698402909980532) % 1
        ).T
        over = a + b > 1
        a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
        c = self._corners[face]
        at: Floats = c[:, 0] + a[:, None] * (c[:, 1] - c[:, 0]) + b[:, None] * (c[:, 2] - c[:, 0])
        return at, face.astype(np.int32)

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self._samples[0])

    def nearest(self, points: Floats, sizes: Floats) -> tuple[Floats, Floats, Floats]:
        """As of `Balls`: positive outside, by the normal of the nearest triangle."""
        scale = float(sizes[0])
        local = points / scale
        _, near = self._tree.query(local, _NEAR)
        face = self._samples[1][near]
        foot = np.stack([_foot(local, self._corners[face[:, k]]) for k in range(_NEAR)], axis=1)
        off = local[:, None, :] - foot
        far = np.linalg.norm(off, axis=2)
        best = far.argmin(axis=1)
        rows = np.arange(len(points))
        face, off, far = face[rows, best], off[rows, best], far[rows, best]
        normal = self._normals[face] / np.maximum(2 * self._areas[face], 1e-300)[:, None]
        side = np.where(np.einsum("ni,ni->n", off, normal) < 0, -1.0, 1.0)
        clear = far > 1e-6
        unit = np.where(
            clear[:, None], side[:, None] * off / np.maximum(far, 1e-300)[:, None], normal
        )
        away = scale * side * far
        by_scale = (away - np.einsum("ni,ni->n", unit, points)) / scale
        return away, unit, by_scale[:, None]

    def placements(self, points: Floats, count: int) -> list[Pose]:
        """Ways (part's frame → that of the points (n, 3)) in which the part may stand, the best
        first: rotations all over, each brought nearer by its nearest points (Besl & McKay, A method
        for registration of 3-D shapes, 1992)."""
        from scipy.spatial import cKDTree

        surface = self._samples[0][:: max(1, len(self._samples[0]) // _COARSE)]
        tree = cKDTree(surface)
        some = points[np.unique(np.linspace(0, len(points) - 1, _FEW).astype(np.intp))]
        middle = (surface.min(axis=0) + surface.max(axis=0)) / 2

        def brought(to_part: Pose, rounds: int) -> tuple[float, Pose]:
            for _ in range(rounds):
                _, near = tree.query(to_part.apply(some))
                to_part = _moved_onto(some, surface[near])
            away, _ = tree.query(to_part.apply(some))
            return float(np.mean(away**2)), to_part

        tried = []
        for R in _rotations(_TURNS):
            turned = some @ R
            shift = middle - (turned.min(axis=0) + turned.max(axis=0)) / 2
            tried.append(brought(Pose(R.T, shift), _ROUNDS))
        tried.sort(key=lambda one: one[0])
        best = sorted((brought(p, _MORE_ROUNDS) for _, p in tried[:_MORE]), key=lambda one: one[0])
        out = list[Pose]()
        for _, to_part in best:
            pose = to_part.inverse()
            if all(_angle(pose, other) > _UNLIKE for other in out):
                out.append(pose)
        return out[:count]


def _foot(points: Floats, corners: Floats) -> Floats:
    """(n, 3) the place on each triangle (n, 3, 3) that is nearest to its point (Ericson, Real-time
    collision detection, 2005, §5.1.5, by the four candidates at once)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("ni,ni->n", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ni,ni->n", w, u), np.einsum("ni,ni->n", w, v)
    size = np.maximum(uu * vv - uv * uv, 1e-300)
    s, t = (vv * wu - uv * wv) / size, (uu * wv - uv * wu) / size
    inside = (s >= 0) & (t >= 0) & (s + t <= 1)
    best = a + s[:, None] * u + t[:, None] * v
    least = np.where(inside, 0.0, np.inf)
    for start, along in ((a, u), (a, v), (b, c - b)):
        length = np.maximum(np.einsum("ni,ni->n", along, along), 1e-300)
        share = np.clip(np.einsum("ni,ni->n", points - start, along) / length, 0.0, 1.0)
        on_edge = start + share[:, None] * along
        far = np.einsum("ni,ni->n", points - on_edge, points - on_edge)
        closer = ~inside & (far < least)
        best = np.where(closer[:, None], on_edge, best)
        least = np.where(closer, far, least)
    nearest: Floats = best
    return nearest


def _moved_onto(points: Floats, places: Floats) -> Pose:
    """The motion that brings points (n, 3) nearest to their places (Kabsch, 1976)."""
    p, q = points.mean(axis=0), places.mean(axis=0)
    u, _, vt = np.linalg.svd((points - p).T @ (places - q))
    d = np.sign(np.linalg.det(vt.T @ u.T))
    R: Floats = vt.T @ np.diag([1.0, 1.0, d]) @ u.T
    return Pose(R, q - R @ p)


def _rotations(count: int) -> npt.NDArray[np.float64]:
    """(count, 3, 3) spread evenly (Alexa, Super-Fibonacci spirals, 2022)."""
    s = np.arange(count) + 0.5
    r, big = np.sqrt(s / count), np.sqrt(1 - s / count)
    a, b = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / _GOLDEN
    x, y, z, w = r * np.sin(a), r * np.cos(a), big * np.sin(b), big * np.cos(b)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _angle(one: Pose, other: Pose) -> float:
    turn = one.rotation.T @ other.rotation
    return float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))

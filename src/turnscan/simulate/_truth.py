"""Exact signed distances to simple shapes: what a measured point should be compared with.

Every function takes points (..., 3) mm and returns (...,) mm, positive outside.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats

Distance = Callable[[Floats], Floats]


def sphere(radius: float, centre: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Distance:
    """Distance from a sphere."""
    c = np.asarray(centre, dtype=np.float64)
    return lambda p: np.linalg.norm(p - c, axis=-1) - radius


def torus(major: float, minor: float, height: float) -> Distance:
    """Distance from a torus about z whose centre circle lies at ``height``."""

    def distance(p: Floats) -> Floats:
        ring = np.hypot(p[..., 0], p[..., 1]) - major
        return np.asarray(np.hypot(ring, p[..., 2] - height) - minor)

    return distance


def box(low: npt.ArrayLike, high: npt.ArrayLike) -> Distance:
    """Distance from a box with sides along the axes."""
    a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)

    def distance(p: Floats) -> Floats:
        q = np.abs(p - (a + b) / 2) - (b - a) / 2
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(q.max(axis=-1), 0.0))

    return distance


def polygon(outline: npt.ArrayLike) -> Callable[[Floats], Floats]:
    """Signed distance of points (..., 2) from a closed polygon (n, 2)."""
    a = np.asarray(outline, dtype=np.float64)
    b = np.roll(a, -1, axis=0)

    def distance(p: Floats) -> Floats:
        flat = p.reshape(-1, 2)
        out = np.empty(len(flat))
        for i in range(0, len(flat), 4096):
            out[i : i + 4096] = _to_edges(flat[i : i + 4096], a, b)
        return out.reshape(p.shape[:-1])

    return distance


def _to_edges(p: Floats, a: Floats, b: Floats) -> Floats:
    e = b - a
    w = p[:, None] - a
    t = np.clip((w * e).sum(-1) / np.maximum((e * e).sum(-1), 1e-300), 0.0, 1.0)
    nearest = np.linalg.norm(w - t[..., None] * e, axis=-1).min(axis=1)
    x, y = p[:, :1], p[:, 1:]
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(all="ignore"):
        at = a[:, 0] + (y - a[:, 1]) * e[:, 0] / e[:, 1]
    inside = (crosses & (x < at)).sum(axis=1) % 2 == 1
    return np.asarray(np.where(inside, -nearest, nearest))


def revolved(profile: npt.ArrayLike) -> Distance:
    """Distance from a solid of revolution; ``profile`` (n, 2) as in `_solids.revolved`."""
    half = np.asarray(profile, dtype=np.float64)
    # The mirrored half closes the section, so that the axis itself is not an edge.
    section = polygon(np.concatenate([half, (half * (-1.0, 1.0))[::-1]]))
    return lambda p: section(np.stack([np.hypot(p[..., 0], p[..., 1]), p[..., 2]], axis=-1))


def prism(outline: npt.ArrayLike, z0: float, z1: float) -> Distance:
    """Distance from an extruded polygon."""
    section = polygon(outline)

    def distance(p: Floats) -> Floats:
        side = section(p[..., :2])
        end = np.abs(p[..., 2] - (z0 + z1) / 2) - (z1 - z0) / 2
        outside = np.hypot(np.maximum(side, 0.0), np.maximum(end, 0.0))
        return np.asarray(outside + np.minimum(np.maximum(side, end), 0.0))

    return distance


def ribbon(across: npt.ArrayLike, top: npt.ArrayLike, base: float, length: float) -> Distance:
    """Distance from `_solids.ribbon`."""
    x, z = np.asarray(across, dtype=np.float64), np.asarray(top, dtype=np.float64)
    outline = np.concatenate([[[x[0], base], [x[-1], base]], np.column_stack([x, z])[::-1]])
    solid = prism(outline, -length / 2, length / 2)
    return lambda p: solid(p[..., [0, 2, 1]])


def union(*parts: Distance) -> Distance:
    """Distance from several bodies together (exact outside, a bound inside overlaps)."""
    return lambda p: np.asarray(np.min([d(p) for d in parts], axis=0))


def difference(body: Distance, hole: Distance) -> Distance:
    """Distance from a body with a hole in it (exact on its surface away from the hole's rim)."""
    return lambda p: np.asarray(np.maximum(body(p), -hole(p)))

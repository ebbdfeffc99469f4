"""Outlines of known lines and arcs, as chains of points and as walls of triangles."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance
from turnscan.shapes import Chain


def chain_of(points: Floats, sigma: float | None = None, closed: bool = True) -> Chain:
    """A chain of points (m, 2), each a vertex of its own."""
    m = len(points)
    ways = np.zeros(m if closed else m - 1, dtype=np.bool_)
    ends = np.stack([np.arange(m)] * 2, axis=1).astype(np.int32)
    known = np.full(m, np.nan if sigma is None else sigma)
    return Chain(points, closed, ways, known, np.zeros((m, 2)), ends, np.tile([1.0, 0.0], (m, 1)))


def along(corners: Floats, step: float) -> Floats:
    """(m, 2) points every ``step`` mm or less round a closed polygon."""
    rows = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        n = max(int(np.ceil(np.linalg.norm(b - a) / step)), 1)
        rows.append(a + (b - a) * np.arange(n)[:, None] / n)
    return np.concatenate(rows)


def arc(centre: Floats, radius: float, begin: float, sweep: float, step: float) -> Floats:
    """(m, 2) points on an arc, its ends among them."""
    n = max(int(np.ceil(abs(sweep) * radius / step)), 2)
    t = begin + sweep * np.linspace(0, 1, n + 1)
    return np.asarray(centre) + radius * np.stack([np.cos(t), np.sin(t)], axis=1)


def rounded_polygon(corners: Floats, radius: float, step: float) -> Floats:
    """(m, 2) points round a convex counter-clockwise polygon whose corners are rounded."""
    rows = []
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    for a, p, b in zip(before, corners, after, strict=True):
        u, v = (p - a) / np.linalg.norm(p - a), (b - p) / np.linalg.norm(b - p)
        turn = np.arccos(np.clip(u @ v, -1, 1))
        out = (v - u) / np.linalg.norm(v - u)
        centre = p + radius / np.cos(turn / 2) * out
        begin = np.arctan2(-u[0], u[1])
        rows.append(arc(centre, radius, begin, turn, step))
    every = np.concatenate(rows)
    return along(every, step)


def regular(count: int, radius: float, turn: float = 0.1) -> Floats:
    """(count, 2) vertices of a regular polygon."""
    t = turn + 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(t), np.sin(t)], axis=1)


def wall(outline: Floats, heights: Floats, sigma: float | None, seed: int = 0) -> Mesh:
    """The mantle over a closed outline (m, 2), each vertex off across it by noise of ``sigma``."""
    m, k = len(outline), len(heights)
    ahead = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    out = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
    out /= np.linalg.norm(out, axis=1)[:, None]
    noise = np.random.default_rng(seed).normal(0, sigma or 0.0, (k, m))
    xy = outline + noise[:, :, None] * out
    z = np.broadcast_to(heights[:, None, None], (k, m, 1))
    vertices = np.concatenate([xy, z], axis=2).reshape(-1, 3)
    i = np.arange(m)
    rows = []
    for h in range(k - 1):
        a, b = h * m + i, h * m + np.roll(i, -1)
        c, d = a + m, b + m
        rows += [np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]
    none = np.zeros(m * k, np.int32)
    known = None
    if sigma is not None:
        known = Provenance(np.full(m * k, sigma), none, none, none, ("laser",))
    return Mesh(vertices, np.concatenate(rows).astype(np.int32), known)


def seen_from_the_axis(corners: Floats, steps: int, phase: float) -> Floats:
    """(steps, 2) where the stripes of a turn meet a convex polygon (k, 2) about the axis.

    The first lies ``phase`` of a step from x.
    """
    turn = 2 * np.pi * (np.arange(steps) + phase) / steps
    way = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    side = np.roll(corners, -1, axis=0) - corners
    out = np.stack([side[:, 1], -side[:, 0]], axis=1)
    far = np.einsum("ij,ij->i", corners, out)
    with np.errstate(divide="ignore"):
        reach = far / np.maximum(way @ out.T, 0.0)
    return way * reach.min(axis=1)[:, None]

"""Compiled kernels: pairs of oriented points and their votes, and what a view saw to be empty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs, Singles
from turnscan.compiled import njit

ANGLES = 15
"""Bins of an angle from 0 to π (12° each)."""
TURNS = 30
"""Bins of the turn about a normal (12° each)."""


class Samples(NamedTuple):
    """Oriented points of a view."""

    points: Floats
    """(m, 3) mm."""
    normals: Floats
    """(m, 3)."""
    frames: Floats
    """(m, 3, 3) what `frames` says of the normals."""


class Table(NamedTuple):
    """The pairs of a model by their bin: those of bin k are starts[k] to starts[k + 1]."""

    starts: Longs
    """(bins + 1,)."""
    first: Ints
    """(pairs,) the first point of each."""
    turn: Singles
    """(pairs,) radians about its normal."""
    size: int
    """How many points the model has."""


@njit(cache=True, nogil=True)
def _frame(n: Floats) -> Floats:
    """(3, 3) rotation that takes the unit vector n to x."""
    R = np.empty((3, 3))
    # Any direction square to n will do, as long as the same n gives the same one.
    k = 0
    for j in range(1, 3):
        if abs(n[j]) < abs(n[k]):
            k = j
    b = np.zeros(3)
    b[k] = 1.0
    b -= n[k] * n
    b /= np.sqrt((b * b).sum())
    R[0] = n
    R[1] = b
    R[2, 0] = n[1] * b[2] - n[2] * b[1]
    R[2, 1] = n[2] * b[0] - n[0] * b[2]
    R[2, 2] = n[0] * b[1] - n[1] * b[0]
    return R


@njit(cache=True, nogil=True)
def frames(normals: Floats) -> Floats:
    """(n, 3, 3): `_frame` of each normal."""
    out = np.empty((len(normals), 3, 3))
    for i in range(len(normals)):
        out[i] = _frame(normals[i])
    return out


@njit(cache=True, nogil=True)
def _key(d: Floats, length: float, a: Floats, b: Floats, step: float) -> int:
    """The bin of a pair: distance, the angles of both normals to the line, and between them."""
    cos1, cos2, cos3 = 0.0, 0.0, 0.0
    for k in range(3):
        cos1 += a[k] * d[k]
        cos2 += b[k] * d[k]
        cos3 += a[k] * b[k]
    w = ANGLES / np.pi
    i1 = min(int(np.arccos(min(1.0, max(-1.0, cos1 / length))) * w), ANGLES - 1)
    i2 = min(int(np.arccos(min(1.0, max(-1.0, cos2 / length))) * w), ANGLES - 1)
    i3 = min(int(np.arccos(min(1.0, max(-1.0, cos3))) * w), ANGLES - 1)
    return ((int(length / step) * ANGLES + i1) * ANGLES + i2) * ANGLES + i3


@njit(cache=True, nogil=True)
def _turn(R: Floats, d: Floats) -> float:
    """Angle about x at which the line of a pair stands when its first normal lies on x."""
    y = R[1, 0] * d[0] + R[1, 1] * d[1] + R[1, 2] * d[2]
    z = R[2, 0] * d[0] + R[2, 1] * d[1] + R[2, 2] * d[2]
    return float(np.arctan2(z, y))


@njit(cache=True, nogil=True)
def pairs(samples: Samples, step: float, near: float, far: float) -> tuple[Ints, Ints, Singles]:
    """All ordered pairs of points from ``near`` to ``far`` mm apart: bin, first point, turn."""
    points, normals, R = samples
    n = len(points)
    total = 0
    for i in range(n):
        for j in range(n):
            d = points[j] - points[i]
            length = np.sqrt((d * d).sum())
            if near <= length < far:
                total += 1
    key, first = np.empty(total, np.int32), np.empty(total, np.int32)
    turn = np.empty(total, np.float32)
    at = 0
    for i in range(n):
        for j in range(n):
            d = points[j] - points[i]
            length = np.sqrt((d * d).sum())
            if near <= length < far:
                key[at] = _key(d, length, normals[i], normals[j], step)
                first[at] = i
                turn[at] = _turn(R[i], d)
                at += 1
    return key, first, turn


@njit(cache=True, nogil=True)
def vote(
    samples: Samples, asked: Longs, table: Table, reach: tuple[float, float, float], best: int
) -> tuple[Ints, Floats, Floats]:
    """For each asked point, the ``best`` places (point of the model, turn) its pairs vote for.

    ``reach`` is the bin of distances, the least and the largest distance of a pair (mm). A pair
    that is common in the model says less: its votes weigh one over the root of its number.
    Returns (asked, best) model points, turns, votes.
    """
    points, normals, R = samples
    starts, first, turn, size = table
    step, near, far = reach
    models = np.empty((len(asked), best), np.int32)
    turns = np.empty((len(asked), best))
    votes = np.zeros((len(asked), best))
    w = TURNS / (2 * np.pi)
    for a in range(len(asked)):
        i = asked[a]
        found = np.zeros((size, TURNS + 1))
        for j in range(len(points)):
            d = points[j] - points[i]
            length = np.sqrt((d * d).sum())
            if not near <= length < far:
                continue
            key = _key(d, length, normals[i], normals[j], step)
            begin, end = starts[key], starts[key + 1]
            if begin == end:
                continue
            weight = 1.0 / np.sqrt(end - begin)
            here = _turn(R[i], d)
            for e in range(begin, end):
                at = (turn[e] - here) * w  # between -TURNS and TURNS: both are angles from -π to π
                if at < 0.0:
                    at += TURNS
                low = int(at)
                part = at - low
                # Shared between the two nearest bins, whose middles lie at whole numbers; the last
                # column is the first one again.
                if low >= TURNS:
                    low = 0
                found[first[e], low] += weight * (1.0 - part)
                found[first[e], low + 1] += weight * part
        found[:, 0] += found[:, TURNS]
        found[:, TURNS] = 0.0
        for k in range(best):
            flat = int(np.argmax(found))
            m, t = flat // (TURNS + 1), flat % (TURNS + 1)
            models[a, k] = m
            turns[a, k] = t / w
            votes[a, k] = found[m, t]
            for near_turn in range(-2, 3):
                found[m, (t + near_turn) % TURNS] = 0.0
    return models, turns, votes


@njit(cache=True, nogil=True)
def seen_through(
    points: Floats, eyes: Floats, origin: Floats, cell: float, shape: Longs, clear: float
) -> Bools:
    """Cubes (bool) that the rays from eyes to points passed, more than ``clear`` mm before.

    A point that is its own eye was seen from nowhere.
    """
    out = np.zeros((shape[0], shape[1], shape[2]), np.bool_)
    step = 0.7 * cell
    for i in range(len(points)):
        d = eyes[i] - points[i]
        away = np.sqrt((d * d).sum())
        if away == 0.0:
            continue
        d = d / away
        at = clear
        while True:
            x = int(np.floor((points[i, 0] + at * d[0] - origin[0]) / cell))
            y = int(np.floor((points[i, 1] + at * d[1] - origin[1]) / cell))
            z = int(np.floor((points[i, 2] + at * d[2] - origin[2]) / cell))
            if not (0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]):
                break
            out[x, y, z] = True
            at += step
    return out

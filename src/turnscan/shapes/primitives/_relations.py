"""Relations between shapes, adopted only inside their uncertainty.

A relation is one or two conditions c(x) = 0 on the parameters x of the shapes, whose joint
covariance C is known. It may be adopted where cᵀ (A C Aᵀ)⁻¹ c, A = ∂c/∂x, is what its
uncertainty would make it in 95 of 100 cases, and where that uncertainty is small enough for the
relation to say something. The shapes then move by −C Aᵀ (A C Aᵀ)⁻¹ c, which is what a least squares
fit of all points with the condition would give (Mikhail and Ackermann, Observations and Least
Squares, 1976, §9). The moves of all relations together must pass the same test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._shapes import Relation, RelationKind
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, SPHERE, frame

_CHI = {1: 3.84, 2: 5.99, 4: 9.49}
"""95 % of χ² by its degrees of freedom."""
_ANGLE = float(np.radians(1.0))
"""An angle less certain than this says nothing of parallel or square."""
_LOOK = float(np.radians(3.0))
_SHARE = 0.02
"""Of the radius: radii and places less certain than this say nothing."""
_ROUNDS = 4


@dataclass
class Adopted:
    """Shapes with relations: numbers (n, 10), joint covariance, and what was adopted."""

    q: Floats
    covariance: Floats
    relations: list[Relation]


Condition = Callable[[Floats], Floats]


@dataclass(frozen=True)
class _Candidate:
    kind: RelationKind
    shapes: tuple[int, ...]
    of: Condition
    """From the numbers (m, 10) of those shapes."""
    limit: float
    """Standard uncertainty above which it says nothing."""


def adopt(kinds: list[int], sides: list[float], q: Floats, covariance: Floats) -> Adopted:
    """Adopt relations among shapes of these kinds, the closest first."""
    now = Adopted(q.copy(), covariance.copy(), [])
    waiting = list(_candidates(kinds, sides, q))
    order = sorted(range(len(waiting)), key=lambda k: _score(now, waiting[k]))
    total = np.zeros(len(covariance))
    spent = 0
    for k in order:
        c = waiting[k]
        value, A = _linear(now, c)
        S = A @ now.covariance @ A.T
        if not _worth(S, value, c):
            continue
        relation, move, rank = _step(now, c, value, A, S)
        if relation is None:
            continue
        q_new = _moved(now.q, move)
        trial = total + move
        if not _bearable(trial, covariance, spent + rank):
            continue
        now.relations.append(relation)
        if not rank:
            continue
        total, spent = trial, spent + rank
        now.q = q_new
        K = now.covariance @ A.T @ np.linalg.pinv(S, rcond=1e-6, hermitian=True)
        now.covariance = now.covariance - K @ A @ now.covariance
        now.covariance = (now.covariance + now.covariance.T) / 2
        own = np.einsum("ii->i", now.covariance)
        np.maximum(own, 0.0, out=own)  # rounding, where relations leave nothing uncertain
        for _ in range(_ROUNDS):  # the conditions are not linear: what is left goes the same way
            value, A = _linear(now, c)
            now.q = _moved(now.q, -K @ value)
    return now


def _score(now: Adopted, c: _Candidate) -> float:
    value, A = _linear(now, c)
    S = A @ now.covariance @ A.T
    return float(value @ np.linalg.pinv(S, rcond=1e-9) @ value) / len(value)


def _worth(S: Floats, value: Floats, c: _Candidate) -> bool:
    return float(np.sqrt(max(np.linalg.eigvalsh(S)[-1], 0.0))) <= c.limit


def _step(
    now: Adopted, c: _Candidate, value: Floats, A: Floats, S: Floats
) -> tuple[Relation | None, Floats, int]:
    """The relation and the move it asks for, where it is inside its uncertainty."""
    top = float(np.linalg.eigvalsh(S)[-1])
    implied = top < (1e-3 * c.limit) ** 2 * 1e-6
    third = c.shapes[2] if len(c.shapes) > 2 else None
    off = float(np.linalg.norm(value))
    if implied:  # others say so, or contradict it
        fits = off < 1e-3 * c.limit
        relation = Relation(c.kind, c.shapes[0], c.shapes[1], third, off, 0.0)
        return (relation if fits else None), np.zeros(len(now.covariance)), 0
    inverse = np.linalg.pinv(S, rcond=1e-6, hermitian=True)
    rank = int(np.linalg.matrix_rank(S, tol=1e-6 * top))
    if float(value @ inverse @ value) > _CHI[max(len(value), 1)]:
        return None, np.zeros(len(now.covariance)), 0
    move = -now.covariance @ A.T @ inverse @ value
    relation = Relation(c.kind, c.shapes[0], c.shapes[1], third, off, float(np.sqrt(top)))
    return relation, move, rank


def _bearable(move: Floats, covariance: Floats, rank: int) -> bool:
    """Whether all moves together are what the uncertainty would make them."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    free = np.flatnonzero(np.diagonal(covariance) > 0)
    even = (covariance / np.outer(scale, scale))[np.ix_(free, free)]
    z = (move / scale)[free]
    chi = float(z @ np.linalg.pinv(even, rcond=1e-10, hermitian=True) @ z)
    return bool(chi <= rank + 2.33 * np.sqrt(2 * max(rank, 1)) + 1)


def _moved(q: Floats, move: Floats) -> Floats:
    return np.array([surface.moved(one, move[7 * k : 7 * k + 7]) for k, one in enumerate(q)])


def _linear(now: Adopted, c: _Candidate) -> tuple[Floats, Floats]:
    """The conditions' values and their derivatives (m, 7 n), by central differences."""
    some = now.q[list(c.shapes)]
    value = c.of(some)
    A = np.zeros((len(value), len(now.covariance)))
    for i, k in enumerate(c.shapes):
        for j in range(7):
            step = np.zeros(7)
            step[j] = 1e-5
            there = some.copy()
            there[i] = surface.moved(some[i], step)
            back = some.copy()
            back[i] = surface.moved(some[i], -step)
            A[:, 7 * k + j] = (c.of(there) - c.of(back)) / 2e-5
    return value, A


def _candidates(kinds: list[int], sides: list[float], q: Floats) -> Iterator[_Candidate]:
    for i, j in combinations(range(len(kinds)), 2):
        yield from _of_axes(kinds, q, i, j)
        if kinds[i] == kinds[j] and kinds[i] in (SPHERE, CYLINDER) and sides[i] == sides[j]:
            small = min(q[i, 6], q[j, 6])
            yield _Candidate("equal radius", (i, j), _radii, _SHARE * small)
    planes = [k for k, kind in enumerate(kinds) if kind == PLANE]
    rounds = [k for k, kind in enumerate(kinds) if kind in (CYLINDER, CONE)]
    for i, j in combinations(planes, 2):
        if -sides[i] * sides[j] * (q[i, 3:6] @ q[j, 3:6]) < np.cos(_LOOK):
            continue
        apart = abs(float((q[i, :3] - q[j, :3]) @ q[i, 3:6]))
        for k in rounds:
            if abs(q[i, 3:6] @ q[k, 3:6]) < np.sin(_LOOK):
                one, other = sides[i], sides[j]
                yield _Candidate("symmetric", (i, j, k), _symmetric(one, other), _SHARE * apart)


def _of_axes(kinds: list[int], q: Floats, i: int, j: int) -> Iterator[_Candidate]:
    a, b = kinds[i], kinds[j]
    if SPHERE in (a, b):
        return
    dot = abs(float(q[i, 3:6] @ q[j, 3:6]))
    round_both = PLANE not in (a, b)
    crossed = (a == PLANE) != (b == PLANE)  # the axis of a plane is its normal
    if dot > np.cos(_LOOK):
        yield _Candidate("perpendicular" if crossed else "parallel", (i, j), _aligned, _ANGLE)
        if round_both:
            size = min(q[i, 6], q[j, 6])
            away = np.cross(q[i, :3] - q[j, :3], q[j, 3:6])
            if float(np.linalg.norm(away)) < 0.2 * max(size, 1e-9):
                yield _Candidate("coaxial", (i, j), _coaxial, max(_SHARE * size, 1e-9))
    elif dot < np.sin(_LOOK):
        yield _Candidate("parallel" if crossed else "perpendicular", (i, j), _square, _ANGLE)


def _aligned(q: Floats) -> Floats:
    e1, e2 = frame(q[1, 3:6])
    return np.array([q[0, 3:6] @ e1, q[0, 3:6] @ e2])


def _square(q: Floats) -> Floats:
    return np.array([q[0, 3:6] @ q[1, 3:6]])


def _coaxial(q: Floats) -> Floats:
    e1, e2 = frame(q[1, 3:6])
    away = q[0, :3] - q[1, :3]
    return np.array([away @ e1, away @ e2])


def _radii(q: Floats) -> Floats:
    return np.array([q[0, 6] - q[1, 6]])


def _symmetric(one: float, other: float) -> Condition:
    """Both planes as far from the axis' point; ``one``, ``other`` turn their normals outward."""

    def apart(q: Floats) -> Floats:
        a = one * float((q[2, :3] - q[0, :3]) @ q[0, 3:6])
        b = other * float((q[2, :3] - q[1, :3]) @ q[1, 3:6])
        return np.array([a - b])

    return apart

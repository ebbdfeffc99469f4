"""Relations between shapes, adopted only inside their uncertainty.

A relation is one or two conditions c(x) = 0 on the parameters x of the shapes, whose joint
covariance C is known. It may be adopted where cᵀ (A C Aᵀ)⁻¹ c, A = ∂c/∂x, is what its
uncertainty would make it in 95 of 100 cases, and where that uncertainty is small enough for the
relation to say something. The shapes then move by −C Aᵀ (A C Aᵀ)⁻¹ c, which is what a least squares
fit of all points with the condition would give (Mikhail and Ackermann, Observations and Least
Squares, 1976, §9). The moves of all relations together must pass the same test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._patterns import Pattern, patterns
from turnscan.shapes.primitives._shapes import Relation, RelationKind
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, SPHERE, frame

_RARE = 0.05
"""Share of true relations that are refused."""
_ANGLE = float(np.radians(1.0))
"""An angle less certain than this says nothing of parallel or square."""
_LOOK = float(np.radians(3.0))
_SHARE = 0.02
"""Of the radius: radii and places less certain than this say nothing."""
_IMPLIED = 1e-5
"""Of its limit: a relation more certain than this is said by others."""
_ROUNDS = 4
_SAME = 1e-7
"""Share of the variance of conditions that no others say: with less they say the same."""
_TINY = 1e-5
"""rad or mm: step of differences."""


@dataclass
class Adopted:
    """Shapes with relations: numbers (n, 10), joint covariance, and what was adopted.

    `frame` of an axis along z may turn by 90° where the axis moves by an arc second. So until all
    is adopted the local parameters, and their covariance, keep the frames that they began with.
    """

    q: Floats
    covariance: Floats
    relations: list[Relation]
    frames: Floats
    """(n, 2, 3) unit vectors across the axes, of the local parameters."""

    def moved(self, move: Floats) -> Floats:
        """(n, 10) the shapes after a move (7 n,)."""
        steps = move.reshape(-1, 7)
        return np.array(list(map(self._moved_one, range(len(self.q)), self.q, steps)))

    def slope(self, shapes: Sequence[int], of: Callable[[Floats], Floats]) -> Floats:
        """(m, 7 n) how values (m,) of some shapes change with a move, by central differences."""
        some = self.q[list(shapes)]
        A = np.zeros((len(of(some)), len(self.covariance)))
        there, back = some.copy(), some.copy()
        for i, k in enumerate(shapes):
            e1, e2 = self._across(k, some[i, 3:6])
            for j in range(7):
                step = np.zeros(7)
                step[j] = _TINY
                there[i] = surface.moved_across(some[i], e1, e2, step)
                back[i] = surface.moved_across(some[i], e1, e2, -step)
                A[:, 7 * k + j] = (of(there) - of(back)) / (2 * _TINY)
            there[i] = back[i] = some[i]
        return A

    def _moved_one(self, k: int, q: Floats, step: Floats) -> Floats:
        return surface.moved_across(q, *self._across(k, q[3:6]), step)

    def _across(self, k: int, axis: Floats) -> tuple[Floats, Floats]:
        """The frame of a shape, square to its axis as it is now."""
        e1 = self.frames[k, 0] - (self.frames[k, 0] @ axis) * axis
        e1 /= np.linalg.norm(e1)
        return e1, _cross(axis, e1)

    def in_own_frames(self) -> Adopted:
        """The covariance of the parameters in the `frame` of each axis as it is now."""
        frames = np.array([frame(q[3:6]) for q in self.q])
        turn = np.eye(len(self.covariance))
        for k, q in enumerate(self.q):
            across = frames[k] @ np.stack(self._across(k, q[3:6])).T
            for at in (7 * k, 7 * k + 2):
                turn[at : at + 2, at : at + 2] = across
        return Adopted(self.q, turn @ self.covariance @ turn.T, self.relations, frames)


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
    """Adopt relations among shapes of these kinds: axes in line first, then the closest first.

    A plane parallel to two axes that still differ by their noise would be known about them, too.
    """
    start = Adopted(q.copy(), covariance.copy(), [], np.array([frame(one[3:6]) for one in q]))
    now, taken = replace(start, relations=[]), list[_Candidate]()
    waiting = list(_candidates(kinds, sides, q))
    even = {(str(p.kind), p.holes): p for p in patterns(kinds, sides, q)}
    waiting += [_Candidate(p.kind, p.holes, p.off, _SHARE * p.pitch) for p in even.values()]
    crossed = [c.of is _square for c in waiting]
    order = sorted(range(len(waiting)), key=lambda k: (crossed[k], _score(now, waiting[k])))
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
        trial = total + move
        if not _bearable(trial, covariance, spent + rank):
            continue
        now.relations.append(relation)
        if not rank:
            continue
        total, spent = trial, spent + rank
        taken.append(c)
        _take(now, c, move)
    done = _at_once(start, taken, total, now)
    told = [_sized(done, r, even.get((r.kind, r.shapes))) for r in done.relations]
    return replace(done, relations=told).in_own_frames()


def _sized(done: Adopted, relation: Relation, pattern: Pattern | None) -> Relation:
    """A pattern of holes with its sizes, as they are with all relations."""
    if pattern is None:
        return relation
    slope = done.slope(pattern.holes, pattern.sizes)
    variance = np.einsum("ij,jk,ik->i", slope, done.covariance, slope)
    value = pattern.sizes(done.q[list(pattern.holes)])
    sigma = np.sqrt(np.maximum(variance, 0.0))
    sizes = zip(pattern.names, value.tolist(), sigma.tolist(), strict=True)
    return replace(relation, sizes=tuple(sizes))


def _at_once(start: Adopted, taken: list[_Candidate], move: Floats, now: Adopted) -> Adopted:
    """The shapes with all conditions that were taken one after the other, from the beginning.

    What a condition says depends on the shapes. That two planes are square to two others, of which
    one is hardly known, holds these two parallel; until that was taken, too, their difference,
    which is noise, told how the first two are turned. With the derivatives at the end it does not.
    """
    if not taken:
        return now
    C, K, A = start.covariance, np.zeros((len(move), 0)), np.zeros((0, len(move)))
    for _ in range(2 * _ROUNDS):
        value, A = _all(start, taken, move)
        scale = 1 / np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", A, C, A), 1e-300))
        value, A = value * scale, A * scale[:, None]
        K = C @ A.T @ np.linalg.pinv(A @ C @ A.T, rcond=_SAME, hermitian=True)
        move = K @ (A @ move - value)
    left = C - K @ A @ C
    left = (left + left.T) / 2
    np.fill_diagonal(left, np.maximum(np.diagonal(left), 0.0))
    return replace(now, q=start.moved(move), covariance=left)


def _all(start: Adopted, taken: list[_Candidate], move: Floats) -> tuple[Floats, Floats]:
    """The values of all conditions after a move (7 n,), and their derivatives by it."""
    values, slopes = list[Floats](), list[Floats]()
    steps = move.reshape(-1, 7)
    for c in taken:
        q = [start._moved_one(k, start.q[k], steps[k]) for k in c.shapes]
        values.append(c.of(np.array(q)))
        A = np.zeros((len(values[-1]), len(move)))
        for i, k in enumerate(c.shapes):
            for j in range(7):
                there = list[Floats]()
                for step in (_TINY, -_TINY):
                    one = steps[k].copy()
                    one[j] += step
                    moved = [*q[:i], start._moved_one(k, start.q[k], one), *q[i + 1 :]]
                    there.append(c.of(np.array(moved)))
                A[:, 7 * k + j] = (there[0] - there[1]) / (2 * _TINY)
        slopes.append(A)
    return np.concatenate(values), np.concatenate(slopes)


def _take(now: Adopted, c: _Candidate, move: Floats) -> None:
    """Move the shapes, and take what the condition says out of their covariance.

    The conditions are not linear: the rest of the way goes by their derivatives at each place, and
    those at the last one say what is known from then on. Derivatives from before the move would
    leave a little of what two relations say alike, and it would count as knowledge.
    """
    before = now.covariance
    now.q = now.moved(move)
    for _ in range(_ROUNDS):
        value, A = _linear(now, c)
        K = before @ A.T @ np.linalg.pinv(A @ before @ A.T, rcond=1e-6, hermitian=True)
        now.q = now.moved(-K @ value)
    left = before - K @ A @ before
    now.covariance = (left + left.T) / 2
    own = np.einsum("ii->i", now.covariance)
    np.maximum(own, 0.0, out=own)  # rounding, where relations leave nothing uncertain


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
    implied = top < (_IMPLIED * c.limit) ** 2
    third = c.shapes[2] if len(c.shapes) > 2 else None
    off = float(np.linalg.norm(value))
    if implied:  # others say so, or contradict it
        fits = off < 1e-3 * c.limit
        relation = Relation(c.kind, c.shapes[0], c.shapes[1], third, off, 0.0, c.shapes[3:])
        return (relation if fits else None), np.zeros(len(now.covariance)), 0
    from scipy.special import chdtri

    inverse = np.linalg.pinv(S, rcond=1e-6, hermitian=True)
    rank = int(np.linalg.matrix_rank(S, tol=1e-6 * top))
    if float(value @ inverse @ value) > chdtri(len(value), _RARE):
        return None, np.zeros(len(now.covariance)), 0
    move = -now.covariance @ A.T @ inverse @ value
    sigma = float(np.sqrt(top))
    relation = Relation(c.kind, c.shapes[0], c.shapes[1], third, off, sigma, c.shapes[3:])
    return relation, move, rank


def _bearable(move: Floats, covariance: Floats, rank: int) -> bool:
    """Whether all moves together are what the uncertainty would make them."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    free = np.flatnonzero(np.diagonal(covariance) > 0)
    even = (covariance / np.outer(scale, scale))[np.ix_(free, free)]
    z = (move / scale)[free]
    chi = float(z @ np.linalg.pinv(even, rcond=1e-10, hermitian=True) @ z)
    return bool(chi <= rank + 2.33 * np.sqrt(2 * max(rank, 1)) + 1)


def _linear(now: Adopted, c: _Candidate) -> tuple[Floats, Floats]:
    """The conditions' values and their derivatives (m, 7 n)."""
    return c.of(now.q[list(c.shapes)]), now.slope(c.shapes, c.of)


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
    across = np.stack(frame(q[j, 3:6]))
    if dot > np.cos(_LOOK):
        yield _Candidate(
            "perpendicular" if crossed else "parallel", (i, j), _aligned(across), _ANGLE
        )
        if round_both:
            size = min(q[i, 6], q[j, 6])
            away = _cross(q[i, :3] - q[j, :3], q[j, 3:6])
            if float(np.linalg.norm(away)) < 0.2 * max(size, 1e-9):
                yield _Candidate("coaxial", (i, j), _coaxial(across), max(_SHARE * size, 1e-9))
    elif dot < np.sin(_LOOK):
        yield _Candidate("parallel" if crossed else "perpendicular", (i, j), _square, _ANGLE)


def _cross(a: Floats, b: Floats) -> Floats:
    """a × b of single vectors (3,): `numpy.cross` takes twenty times as long to get ready."""
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _aligned(across: Floats) -> Condition:
    """Two axes in line. ``across`` (2, 3) is square to them, nearly, and stays: see `Adopted`."""

    def off(q: Floats) -> Floats:
        return np.asarray(across @ _cross(q[0, 3:6], q[1, 3:6]))

    return off


def _square(q: Floats) -> Floats:
    return np.array([q[0, 3:6] @ q[1, 3:6]])


def _coaxial(across: Floats) -> Condition:
    """The point of one axis on the other, ``across`` as in `_aligned`."""

    def off(q: Floats) -> Floats:
        return np.asarray(across @ _cross(q[0, :3] - q[1, :3], q[1, 3:6]))

    return off


def _radii(q: Floats) -> Floats:
    return np.array([q[0, 6] - q[1, 6]])


def _symmetric(one: float, other: float) -> Condition:
    """Both planes as far from the axis' point; ``one``, ``other`` turn their normals outward."""

    def apart(q: Floats) -> Floats:
        a = one * float((q[2, :3] - q[0, :3]) @ q[0, 3:6])
        b = other * float((q[2, :3] - q[1, :3]) @ q[1, 3:6])
        return np.array([a - b])

    return apart

"""Patterns of holes: even circles, even rows and rectangles of equal holes with parallel axes.

Where the middles p of n holes lie in the plane across them is linear in the few numbers of a
pattern: pₖ = t + R(kδ) a for a circle, t + k a for a row. What is left when the best of these
numbers are taken off, 2n − 4 conditions, is 0 on a true pattern; a rectangle has its diagonals,
too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.shapes.primitives._surface_kernels import CYLINDER, frame

PatternKind = Literal["circle of holes", "row of holes", "rectangle of holes"]
_LOOK = float(np.cos(np.radians(3.0)))
_ALIKE, _NEAR = 0.1, 0.1
"""Holes of a pattern differ by less of their radius, and are less of their pitch beside it."""
_MOST, _FEW = 40, 12
"""Holes of a kind, beyond which patterns, or rectangles, are not looked for: they are too many."""
Index = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Pattern:
    """Holes that may be in a pattern."""

    kind: PatternKind
    holes: tuple[int, ...]
    """Index of the shapes, along the pattern."""
    off: Callable[[Floats], Floats]
    """From the numbers (n, 10) of these: mm by which they are off it, all 0 on a true one."""
    sizes: Callable[[Floats], Floats]
    """The same to the sizes of the pattern, mm."""
    names: tuple[str, ...]
    """What those are."""
    pitch: float
    """mm, about."""


def patterns(kinds: list[int], sides: list[float], q: Floats) -> Iterator[Pattern]:
    """Patterns that cylinders (rows of ``q``, (s, 10)) are near to; larger ones first."""
    left = [k for k, kind in enumerate(kinds) if kind == CYLINDER]
    while left:
        first = left[0]
        group = [
            k
            for k in left
            if sides[k] == sides[first]
            and abs(float(q[k, 3:6] @ q[first, 3:6])) > _LOOK
            and abs(q[k, 6] - q[first, 6]) < _ALIKE * q[first, 6]
        ]
        left = [k for k in left if k not in group]
        if 3 <= len(group) <= _MOST:
            across = np.stack(frame(q[first, 3:6]))
            yield from _of_group(np.array(group), q[group, :3] @ across.T, across, q[first, 6])


def _of_group(group: Index, at: Floats, across: Floats, radius: float) -> Iterator[Pattern]:
    """Of equal holes at places (n, 2): coaxial ones, which are one hole, are left out."""
    alone = [k for k in range(len(at)) if np.all(np.hypot(*(at[:k] - at[k]).T) > radius)]
    group, at = group[alone], at[alone]
    ring = _circle(at)
    if ring is not None:
        turn = np.arange(len(ring)) * (2 * np.pi / len(ring))
        places = np.column_stack([np.cos(turn), np.sin(turn)])
        yield _made("circle of holes", group[ring], at[ring], across, places)
        return
    rows = _rows(at)
    for row in rows:
        places = np.arange(len(row), dtype=np.float64)[:, None]
        yield _made("row of holes", group[row], at[row], across, places)
    if not rows and len(at) <= _FEW:
        for four in _rectangles(at):
            yield _rectangle(group[four], at[four], across)


def _made(kind: PatternKind, holes: Index, at: Floats, across: Floats, places: Floats) -> Pattern:
    """Holes at ``at`` (n, 2) that are places (n, 2) turned, scaled and shifted, or a row (n, 1)."""
    n, ring = len(places), places.shape[1] == 2
    A = np.zeros((2 * n, 4))
    A[:n, 0] = A[n:, 1] = 1.0
    A[:n, 2] = A[n:, 3] = places[:, 0]
    if ring:
        A[:n, 3], A[n:, 2] = -places[:, 1], places[:, 1]
    rest, numbers = np.linalg.svd(A)[0][:, 4:].T, np.linalg.pinv(A)
    name, times = ("pitch circle diameter", 2.0) if ring else ("pitch", 1.0)

    def flat(q: Floats) -> Floats:
        return np.asarray((across @ q[:, :3].T).ravel())

    def sizes(q: Floats) -> Floats:
        return np.array([times * float(np.hypot(*(numbers @ flat(q))[2:]))])

    pitch = float(np.linalg.norm(at[1] - at[0]))
    holes_in = tuple(map(int, holes))
    return Pattern(kind, holes_in, lambda q: np.asarray(rest @ flat(q)), sizes, (name,), pitch)


def _rectangle(holes: Index, at: Floats, across: Floats) -> Pattern:
    """Four holes in their order around: both diagonals have one middle and one length."""

    def sides(q: Floats) -> Floats:
        p = q[:, :3] @ across.T
        return np.array([
            (np.linalg.norm(p[1] - p[0]) + np.linalg.norm(p[3] - p[2])) / 2,
            (np.linalg.norm(p[2] - p[1]) + np.linalg.norm(p[0] - p[3])) / 2,
        ])  # fmt: skip

    def off(q: Floats) -> Floats:
        p = q[:, :3] @ across.T
        middles = (p[0] + p[2] - p[1] - p[3]) / 2
        return np.append(middles, np.linalg.norm(p[2] - p[0]) - np.linalg.norm(p[3] - p[1]))

    pitch = float(min(np.linalg.norm(at[1] - at[0]), np.linalg.norm(at[2] - at[1])))
    names = ("pitch along", "pitch across")
    return Pattern("rectangle of holes", tuple(map(int, holes)), off, sides, names, pitch)


def _circle(at: Floats) -> list[int] | None:
    """The places (n, 2) even on a circle, in their order, of all or all but one in the middle."""
    middle = at.mean(axis=0)
    every = range(len(at))
    central = int(np.hypot(*(at - middle).T).argmin())
    for some in (list(every), [k for k in every if k != central]):
        if len(some) < 3:
            continue
        away = at[some] - at[some].mean(axis=0)
        radius, turn = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
        order = np.argsort(turn)
        pitch = 2 * float(radius.mean()) * np.sin(np.pi / len(some))
        gaps = np.diff(np.append(turn[order], turn[order[0]] + 2 * np.pi))
        uneven = np.abs(gaps - 2 * np.pi / len(some)).max() * radius.mean()
        if max(uneven, np.abs(radius - radius.mean()).max()) < _NEAR * pitch:
            return [some[k] for k in order]
    return None


def _rows(at: Floats) -> list[list[int]]:
    """Places (n, 2) that follow each other in even steps, three or more, none part of another."""
    found = list[list[int]]()
    for i, j in permutations(range(len(at)), 2):
        step = at[j] - at[i]
        near = _NEAR * float(np.linalg.norm(step))
        row = [i, j]
        while True:
            gap = np.linalg.norm(at - (at[row[-1]] + step), axis=1)
            if gap.min() > near or int(gap.argmin()) in row:
                break
            row.append(int(gap.argmin()))
        if len(row) >= 3:
            found.append(row)
    found.sort(key=len, reverse=True)
    whole = list[list[int]]()
    for row in found:
        if not any(set(row) <= set(other) for other in whole):
            whole.append(row)
    return whole


def _rectangles(at: Floats) -> Iterator[list[int]]:
    """Fours of places (n, 2) near the corners of a rectangle, in their order around."""
    for four in combinations(range(len(at)), 4):
        away = at[list(four)] - at[list(four)].mean(axis=0)
        order = [four[k] for k in np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
        p = at[order]
        sides = (float(np.linalg.norm(p[1] - p[0])), float(np.linalg.norm(p[2] - p[1])))
        askew = float(np.linalg.norm(p[0] + p[2] - p[1] - p[3])) / 2
        uneven = abs(float(np.linalg.norm(p[2] - p[0]) - np.linalg.norm(p[3] - p[1])))
        if max(askew, uneven) < _NEAR * min(sides):
            # The longer side comes first.
            yield order if sides[0] >= sides[1] else [*order[1:], order[0]]

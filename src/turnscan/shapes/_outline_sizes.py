"""Sizes of an outline: distances of parallel lines, angles of corners, the box around it."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes._outline_bodies import Body
from turnscan.shapes._outline_curves import Arc, Line, Piece, Size
from turnscan.shapes._outline_places import cut_off
from turnscan.shapes._outline_settled import Settled, corner, derived

_PARALLEL = np.deg2rad(0.2)
"""Lines are parallel within this, or within three standard uncertainties."""
_SIGMAS = 3.0
_MOST_OFF = np.deg2rad(3.0)
"""However uncertain they are."""
_LAST = 5
"""Ways at an open end whose median is the step there."""


def sizes_of(
    s: Settled, pieces: list[Piece], numbers: list[int], known: tuple[bool, ...]
) -> tuple[Size, ...]:
    """Distances of parallel lines that face each other, and angles between lines that meet.

    Of lines that rest on too little to be the part's, and so are not ``known``, none (`supported`).
    """
    lines = [k for k, b in enumerate(s.bodies) if b.kind == "line" and known[k]]
    found = [_distance(s, pieces, numbers, i, j) for i, j in combinations(lines, 2)]
    found += [_angle(s, pieces, numbers, k) for k in lines if s.before(k) in lines]
    return tuple(size for size in found if size is not None)


def _turn(a: Body, b: Body) -> float:
    """Radians, −π to π, from the direction of one line to that of another."""
    p, q = a.direction(a.origin), b.direction(b.origin)
    return float(np.arctan2(p[0] * q[1] - p[1] * q[0], p @ q))


def _distance(s: Settled, pieces: list[Piece], numbers: list[int], i: int, j: int) -> Size | None:
    a, b = s.bodies[i], s.bodies[j]
    first, second = pieces[numbers[i]], pieces[numbers[j]]
    assert isinstance(first, Line)
    assert isinstance(second, Line)
    off = np.pi - abs(_turn(a, b))
    known = _SIGMAS * float(np.hypot(first.angle_sigma, second.angle_sigma))
    if off > min(max(_PARALLEL, known), _MOST_OFF):
        return None
    along = a.direction(a.origin)
    spans = [np.sort((np.stack([x.start, x.end]) - a.origin) @ along) for x in (first, second)]
    low, high = max(x[0] for x in spans), min(x[1] for x in spans)
    if high <= low:
        return None
    middle = (low + high) / 2

    def value() -> float:
        n = np.array([np.cos(a.p[0]), np.sin(a.p[0])])
        at = a.origin + middle * along
        at = at - ((at - a.origin) @ n - a.p[1]) * n
        m = np.array([np.cos(b.p[0]), np.sin(b.p[0])])
        return abs(float((at - b.origin) @ m - b.p[1]))

    at = a.nearest(a.origin + middle * along)
    return Size("distance", value(), derived(s, value, [i, j]), (numbers[i], numbers[j]),
                np.stack([at, b.nearest(at)]), float(off))  # fmt: skip


def _angle(s: Settled, pieces: list[Piece], numbers: list[int], k: int) -> Size:
    j = s.before(k)
    assert j is not None
    a, b = s.bodies[j], s.bodies[k]

    def value() -> float:
        return np.pi - abs(_turn(a, b))

    at = corner(s, k).start
    return Size("angle", value(), derived(s, value, [j, k]), (numbers[j], numbers[k]),
                np.stack([at, at]))  # fmt: skip


def box_of(
    s: Settled, pieces: list[Piece], numbers: list[int], known: tuple[bool, ...]
) -> tuple[Floats, Floats]:
    """(2, 2) mm: least and largest x and y of the pieces, and their standard uncertainties."""
    box, sigma = np.zeros((2, 2)), np.zeros((2, 2))
    for row, sign in enumerate((-1.0, 1.0)):
        for axis in (0, 1):
            u = sign * np.eye(2)[axis]
            reach = [_reach(p, u) for p in pieces]
            k = int(np.argmax([r for r, _ in reach]))
            box[row, axis] = sign * reach[k][0]
            ended = 0.0 if reach[k][1] else _unseen(s, pieces, u, reach[k][0])
            own = _reach_sigma(s, pieces, numbers, k, u, reach[k][1])
            chord = 0.0 if reach[k][1] else _chords(s, pieces, numbers, known, u, reach[k][0])
            sigma[row, axis] = float(np.linalg.norm([own, ended, chord]))
    return box, sigma


def _unseen(s: Settled, pieces: list[Piece], u: Floats, reach: float) -> float:
    """mm along ``u`` that are not known where an open outline reaches furthest with its end.

    The part ends somewhere before the next point would have been: rms of even odds over one step,
    as steps are there.
    """
    if s.closed:
        return 0.0
    steps = s.chain.steps
    out = [0.0]
    for end, way, last in (
        (pieces[0].start, s.chain.points[2::-1], steps[:_LAST]),
        (pieces[-1].end, s.chain.points[-3:], steps[-_LAST:]),
    ):
        step = float(np.median(last))
        if reach - float(end @ u) <= step:
            along = way[-1] - way[0]
            out.append(step * abs(float(along @ u)) / max(float(np.linalg.norm(along)), 1e-300))
    return max(out) / float(np.sqrt(3.0))


def _chords(
    s: Settled, pieces: list[Piece], numbers: list[int], known: tuple[bool, ...], u: Floats,
    reach: float,
) -> float:  # fmt: skip
    """mm along ``u`` that are not known where steps cut off what reaches furthest.

    So much of where it would end at the most that twice the uncertainty of a width covers it where
    it is cut off at both ends.
    """
    out = [0.0]
    for k, piece in enumerate(pieces[n] for n in numbers):
        if not known[k]:
            ends = np.stack([piece.start, piece.end])
            out.append(cut_off(s, k, ends, u) - (reach - float((ends @ u).max())))
    return max(out) / float(np.sqrt(2.0))


def _reach(piece: Piece, u: Floats) -> tuple[float, bool]:
    """How far a piece reaches along ``u``, and whether that is where an arc is round."""
    ends = float(max(piece.start @ u, piece.end @ u))
    if isinstance(piece, Arc):
        turn = float(np.arctan2(u[1], u[0])) - piece.begin
        turn = turn % (2 * np.pi) if piece.sweep > 0 else -((-turn) % (2 * np.pi))
        if piece.full or abs(turn) <= abs(piece.sweep):
            return float(piece.centre @ u) + piece.radius, True
    elif not isinstance(piece, Line):
        return float((piece.sampled(1e-3) @ u).max()), False
    return ends, False


def _reach_sigma(
    s: Settled, pieces: list[Piece], numbers: list[int], k: int, u: Floats, is_round: bool
) -> float:
    piece = pieces[k]
    if k not in numbers:  # a link: its neighbours know
        k += 1
    body = numbers.index(k) if k in numbers else len(numbers) - 1
    b = s.bodies[body]
    if b.kind == "spline" or not len(b.p):
        return float(getattr(pieces[numbers[body]], "sigma", np.nan))
    if is_round:
        return derived(s, lambda: float(b.p[:2] @ u + b.p[2]), [body])
    ends = bool(piece.end @ u > piece.start @ u)
    at = (body + 1) % len(s.bodies) if ends else body
    other = s.before(at)
    if other is None or "spline" in (s.bodies[at].kind, s.bodies[other].kind):
        return derived(s, lambda: float(b.nearest(piece.end if ends else piece.start) @ u), [body])
    return derived(s, lambda: float(corner(s, at).start @ u), [at, other])

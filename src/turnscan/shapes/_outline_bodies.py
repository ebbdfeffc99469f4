"""Lines and circles through stretches of a chain, adjusted together where they are tangent."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.shapes._outline_noise import Noise
from turnscan.shapes._section import Chain

Index = npt.NDArray[np.intp]
_ROUNDS = 30
_HUBER = 2.5
"""Standard deviations beyond which a point's pull no longer grows."""
_NOISE = 4.5
"""Standard uncertainties within which pieces are taken for tangent: theirs leave out that it is not
sure at which point one ends."""
_EXACT = 0.02
"""Of the tolerance: what is nearer than this is tangent whatever the noise."""
_CLEAR = 2.0
"""Standard deviations by which residuals of one body are larger than those of all."""
_WINDOW = 8
"""Neighbouring points whose residuals are added up to see whether they hang together."""
_TURN = np.deg2rad(25.0)
"""Pieces that meet at more than this are not tangent."""


@dataclass(eq=False)
class Body:
    """A line n·(p − origin) = d with n = (cos θ, sin θ), or a circle, through points of a chain."""

    kind: str
    """``line``, ``arc``, or ``spline``, which has no parameters here."""
    rows: Index
    """The points of the chain that it goes through."""
    ways: tuple[int, int]
    """The first and the last of its stretch."""
    origin: Floats
    p: Floats
    """(2,) θ, d of a line; (3,) centre and radius of a circle; (0,) of a spline."""
    turns: float = 1.0
    """+1 where it goes counter-clockwise about its centre; of a line +1."""
    moves: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    """(parameters, v): what one standard deviation of each vertex of the mesh does to them."""

    @property
    def covariance(self) -> Floats:
        """(k, k) of the parameters."""
        return np.asarray(self.moves @ self.moves.T)

    def residuals(self, chain: Chain, p: Floats) -> tuple[Floats, Floats]:
        """(n,) mm off the body with parameters ``p``, and (n, k) their derivatives."""
        x = chain.points[self.rows]
        if self.kind == "line":
            n = np.array([np.cos(p[0]), np.sin(p[0])])
            to = x - self.origin
            return to @ n - p[1], np.stack([to @ np.array([-n[1], n[0]]), -np.ones(len(x))], 1)
        to = x - p[:2]
        apart = np.sqrt((to**2).sum(axis=1) + chain.bulge[self.rows])
        unit = to / np.maximum(apart, 1e-12)[:, None]
        return apart - p[2], np.column_stack([-unit, -np.ones(len(x))])

    def direction(self, at: Floats) -> Floats:
        """(2,) unit: which way it goes at a point near it."""
        if self.kind == "line":
            n = np.array([np.cos(self.p[0]), np.sin(self.p[0])])
            return self.turns * np.array([-n[1], n[0]])
        to = at - self.p[:2]
        to /= max(float(np.linalg.norm(to)), 1e-300)
        return self.turns * np.array([-to[1], to[0]])

    def nearest(self, at: Floats) -> Floats:
        """(2,) mm: its point nearest to one."""
        if self.kind == "line":
            n = np.array([np.cos(self.p[0]), np.sin(self.p[0])])
            return np.asarray(at - ((at - self.origin) @ n - self.p[1]) * n)
        to = at - self.p[:2]
        return np.asarray(self.p[:2] + to * (self.p[2] / max(float(np.linalg.norm(to)), 1e-300)))


@dataclass(frozen=True)
class Tangency:
    """Two bodies that touch: |distance of centres or of line and centre| is fixed by the radii."""

    first: int
    second: int
    sign: float
    """Of a line and a circle: on which side of the line the centre lies. Of two circles: +1 where
    they lie side by side, −1 and −2 where the second or the first lies within the other."""


def line_body(chain: Chain, rows: Index, ways: tuple[int, int], scale: Floats) -> Body:
    """The best line through the points ``rows``, which have the standard deviations ``scale``."""
    w = 1.0 / scale[rows] ** 2
    origin = w @ chain.points[rows] / w.sum()
    to = chain.points[rows] - origin
    normal = np.linalg.eigh((to * w[:, None]).T @ to)[1][:, 0]
    along = chain.points[ways[1]] - chain.points[ways[0]]
    turns = 1.0 if normal[0] * along[1] - normal[1] * along[0] >= 0 else -1.0
    p = np.array([np.arctan2(normal[1], normal[0]), 0.0])
    return Body("line", rows, ways, origin, p, turns)


def arc_body(chain: Chain, rows: Index, ways: tuple[int, int], scale: Floats) -> Body | None:
    """The circle through the points ``rows`` to begin with, or None where there is none."""
    from turnscan.shapes import _outline_kernels as kernels

    x, y = (np.ascontiguousarray(c) for c in chain.points[rows].T)
    found = np.zeros(3)
    if kernels.circle(x, y, 1.0 / scale[rows] ** 2, chain.bulge[rows], found) < 0:
        return None
    to = chain.points[ways[0] : ways[1] + 1] - found[:2]
    turn = (to[:-1, 0] * to[1:, 1] - to[:-1, 1] * to[1:, 0]).sum()
    return Body("arc", rows, ways, np.zeros(2), found, 1.0 if turn >= 0 else -1.0)


def adjust(
    chain: Chain, bodies: list[Body], ties: list[Tangency], scale: Floats, noise: Noise
) -> float:
    """Least squares over all bodies at once under the ties; sets p and moves, returns chi2.

    Huber weights. The covariance follows from the noise of the mesh's vertices (`Noise.vertex`),
    each of which moves all points that hang on it; larger where the residuals are larger than it
    says, of all bodies or of one by more than chance, and by the residuals alone where the mesh
    says nothing.
    """
    total = sum(len(b.p) for b in bodies)
    if not total:
        return 0.0
    for _ in range(_ROUNDS):
        found = weighed(chain, bodies, scale)
        inverse, values = _solved(bodies, ties, found)
        step = (inverse @ np.r_[found.right, -values])[:total]
        for b, at in zip(bodies, found.starts, strict=False):
            b.p = b.p + step[at : at + len(b.p)]
        size = np.sqrt(np.maximum(np.diag(found.normal), 1e-300))
        if float(np.abs(step * size).max()) < 1e-6 and float(np.abs(values).max(initial=0)) < 1e-9:
            break
    _covariances(chain, bodies, found, inverse[:total, :total], noise)
    return found.chi2


@dataclass(frozen=True, eq=False)
class Weighed:
    """The normal equations of all bodies at their present parameters."""

    starts: Index
    """(bodies + 1,) where the parameters of each begin."""
    normal: Floats
    right: Floats
    pulls: list[Floats]
    """(k, n) of each body: what its residuals do to ``right``."""
    chi2: float


def weights(chain: Chain, body: Body, scale: Floats) -> tuple[Floats, Floats, Floats]:
    """(n,) mm off the body, (n, k) their derivatives, and (n,) Huber's weights, 1/mm²."""
    r, J = body.residuals(chain, body.p)
    s = scale[body.rows]
    return r, J, np.minimum(1.0, _HUBER / np.maximum(np.abs(r / s), 1e-12)) / s**2


def weighed(chain: Chain, bodies: list[Body], scale: Floats) -> Weighed:
    """The normal equations without ties."""
    starts = np.r_[0, np.cumsum([len(b.p) for b in bodies])].astype(np.intp)
    total = int(starts[-1])
    normal, right = np.zeros((total, total)), np.zeros(total)
    chi2, pulls = 0.0, list[Floats]()
    for b, at in zip(bodies, starts, strict=False):
        if not len(b.p):
            pulls.append(np.zeros((0, 0)))
            continue
        r, J, w = weights(chain, b, scale)
        chi2 += float((w * r**2).sum())
        pull = J.T * w
        pulls.append(pull)
        k = slice(at, at + len(b.p))
        normal[k, k] = pull @ J
        right[k] = -pull @ r
    return Weighed(starts, normal, right, pulls, chi2)


def solved(bodies: list[Body], ties: list[Tangency], found: Weighed) -> Floats:
    """(k, k) the inverse of the normal equations under the ties: what a pull does to parameters."""
    total = len(found.right)
    return _solved(bodies, ties, found)[0][:total, :total]


def _solved(bodies: list[Body], ties: list[Tangency], found: Weighed) -> tuple[Floats, Floats]:
    values, slopes = _ties(bodies, ties, found.starts)
    whole = np.block([[found.normal, slopes.T], [slopes, np.zeros((len(ties),) * 2)]])
    d = 1.0 / np.sqrt(np.r_[np.maximum(np.diag(found.normal), 1e-300), np.ones(len(ties))])
    return np.linalg.pinv(whole * d[:, None] * d, rcond=1e-13) * d[:, None] * d, values


def _covariances(
    chain: Chain, bodies: list[Body], found: Weighed, inverse: Floats, noise: Noise
) -> None:
    total = len(inverse)
    moved = np.zeros((total, noise.vertex.shape[1]))
    seen, due = np.zeros(len(bodies)), np.zeros(len(bodies))
    for n, b in enumerate(bodies):
        if not len(b.p):
            continue
        r, _ = b.residuals(chain, b.p)
        limit = 4.0 * noise.point[b.rows]
        seen[n] = float((np.clip(r, -limit, limit) ** 2 / noise.point[b.rows] ** 2).sum())
        due[n] = max(len(b.rows) - len(b.p) * noise.shared, 0.3 * len(b.rows))
    ratio = max(seen.sum() / max(due.sum(), 1e-300), _together(chain, bodies, noise))
    factor = max(ratio, 1.0) if noise.known else max(ratio, 1e-12)
    own = seen / np.maximum(due, 1e-300)
    own[own <= factor * (1.0 + _CLEAR * np.sqrt(2.0 / np.maximum(due, 1e-300)))] = factor
    for n, (b, at, pull) in enumerate(zip(bodies, found.starts, found.pulls, strict=False)):
        if len(b.p):
            moved[at : at + len(b.p)] = np.sqrt(own[n]) * (pull @ noise.vertex[b.rows])
    move = inverse @ moved
    for b, at in zip(bodies, found.starts, strict=False):
        b.moves = move[at : at + len(b.p)]


def _together(chain: Chain, bodies: list[Body], noise: Noise) -> float:
    """How many times larger than the noise says sums of neighbouring residuals are, squared.

    That is what counts for a line's place where residuals hang together; 0 where it is within
    chance, or where there are too few points to tell.
    """
    from scipy.sparse import csr_array

    seen = due = blocks = 0.0
    for b in bodies:
        n = len(b.rows)
        wide = min(_WINDOW, n // 6)
        if wide < 3 or not len(b.p):
            continue
        r, _ = b.residuals(chain, b.p)
        limit = 4.0 * noise.point[b.rows]
        sums = np.cumsum(np.r_[0.0, np.clip(r, -limit, limit)])
        rows = noise.vertex[b.rows]
        look = np.arange(n - wide + 1)[:, None] + np.arange(wide)
        shape = (len(look), n)
        index = (np.repeat(np.arange(len(look)), wide), look.ravel())
        moved = csr_array((np.ones(look.size), index), shape=shape) @ rows
        seen += float(((sums[wide:] - sums[:-wide]) ** 2).sum())
        due += float(moved.multiply(moved).sum())
        blocks += n / wide
    if not due > 0:
        return 0.0
    ratio = seen / due
    return ratio if ratio > 1.0 + 2.0 * float(np.sqrt(2.0 / max(blocks, 1.0))) else 0.0


def _ties(
    bodies: list[Body], ties: list[Tangency], starts: Index
) -> tuple[Floats, Floats]:  # fmt: skip
    """Values (t,) mm of the conditions and their derivatives (t, parameters)."""
    values, slopes = np.zeros(len(ties)), np.zeros((len(ties), int(starts[-1])))
    for row, tie in enumerate(ties):
        a, b = bodies[tie.first], bodies[tie.second]
        ka, kb = int(starts[tie.first]), int(starts[tie.second])
        if a.kind == "line":
            n = np.array([np.cos(a.p[0]), np.sin(a.p[0])])
            to = b.p[:2] - a.origin
            values[row] = to @ n - a.p[1] - tie.sign * b.p[2]
            slopes[row, ka : ka + 2] = to @ np.array([-n[1], n[0]]), -1.0
            slopes[row, kb : kb + 3] = n[0], n[1], -tie.sign
            continue
        to = b.p[:2] - a.p[:2]
        apart = max(float(np.linalg.norm(to)), 1e-12)
        sa, sb = {1: (1, 1), -1: (1, -1), -2: (-1, 1)}[int(tie.sign)]
        values[row] = apart - sa * a.p[2] - sb * b.p[2]
        slopes[row, ka : ka + 3] = -to[0] / apart, -to[1] / apart, -sa
        slopes[row, kb : kb + 3] = to[0] / apart, to[1] / apart, -sb
    return values, slopes


def tangencies(
    bodies: list[Body], pairs: list[tuple[int, int]], chain: Chain, tolerance: float
) -> list[Tangency]:
    """Of neighbours (pairs of indices) those that are tangent inside the noise."""
    found = []
    for i, j in pairs:
        a, b = bodies[i], bodies[j]
        if not len(a.p) or not len(b.p) or a.kind == b.kind == "line":
            continue
        at = (chain.points[a.ways[1]] + chain.points[b.ways[0]]) / 2
        gap = float(np.linalg.norm(chain.points[a.ways[1]] - chain.points[b.ways[0]]))
        if float(a.direction(at) @ b.direction(at)) < np.cos(_TURN):
            continue
        tie = _tie(i, j, a, b)
        sizes = np.r_[0, len(a.p), len(a.p) + len(b.p)] if tie.first == i else np.r_[
            0, len(b.p), len(a.p) + len(b.p)]  # fmt: skip
        two = [a, b] if tie.first == i else [b, a]
        value, slope = _ties(two, [Tangency(0, 1, tie.sign)], sizes)
        m = len(two[0].p)
        variance = slope[0, :m] @ two[0].covariance @ slope[0, :m]
        variance += slope[0, m:] @ two[1].covariance @ slope[0, m:]
        touch = touching(bodies, tie)
        # A line that is a little off moves the place of contact far: √(2 r e) along the arc.
        r = min(float(x.p[2]) for x in (a, b) if x.kind == "arc")
        e = max(_NOISE * float(np.sqrt(variance)), _EXACT * tolerance)
        near = gap + 2.0 * float(np.sqrt(2 * r * max(e, tolerance))) + tolerance
        if abs(float(value[0])) <= e and float(np.linalg.norm(touch - at)) <= near:
            found.append(tie)
    return found


def _tie(i: int, j: int, a: Body, b: Body) -> Tangency:
    if a.kind == "line" or b.kind == "line":
        line, arc, order = (a, b, (i, j)) if a.kind == "line" else (b, a, (j, i))
        n = np.array([np.cos(line.p[0]), np.sin(line.p[0])])
        side = float((arc.p[:2] - line.origin) @ n - line.p[1])
        return Tangency(*order, 1.0 if side >= 0 else -1.0)
    if a.turns != b.turns:
        return Tangency(i, j, 1.0)
    return Tangency(i, j, -1.0 if a.p[2] >= b.p[2] else -2.0)


def touching(bodies: list[Body], tie: Tangency) -> Floats:
    """(2,) mm: where two tangent bodies touch."""
    a, b = bodies[tie.first], bodies[tie.second]
    if a.kind == "line":
        return a.nearest(b.p[:2])
    to = b.p[:2] - a.p[:2]
    to = to / max(float(np.linalg.norm(to)), 1e-300)
    return np.asarray(a.p[:2] + (-1.0 if tie.sign == -2 else 1.0) * a.p[2] * to)


def meeting(a: Body, b: Body, at: Floats) -> Floats | None:
    """(2,) mm: where two bodies cross, the place nearest to ``at``; None where they do not."""
    if a.kind == b.kind == "line":
        n = np.array([[np.cos(x.p[0]), np.sin(x.p[0])] for x in (a, b)])
        if abs(float(np.linalg.det(n))) < 1e-6:
            return None
        d = np.array([x.p[1] + y @ x.origin for x, y in zip((a, b), n, strict=True)])
        return np.asarray(np.linalg.solve(n, d))
    if b.kind == "line":
        a, b = b, a
    if a.kind == "line":
        foot, along = a.nearest(b.p[:2]), a.direction(at)
        high = float(np.linalg.norm(foot - b.p[:2]))
        r = float(b.p[2])
    else:
        to = b.p[:2] - a.p[:2]
        apart = float(np.linalg.norm(to))
        if apart < 1e-12:
            return None
        reach = (apart**2 + a.p[2] ** 2 - b.p[2] ** 2) / (2 * apart)
        foot = a.p[:2] + reach * to / apart
        along = np.array([-to[1], to[0]]) / apart
        high, r = abs(reach), float(a.p[2])
    if high > r:
        return None
    half = np.sqrt(r * r - high * high)
    both = [foot + half * along, foot - half * along]
    return np.asarray(min(both, key=lambda q: float(np.linalg.norm(q - at))))


def used(use: Bools, scale: Floats, first: int, last: int) -> Index:
    """The points from ``first`` to ``last`` that count."""
    rows = np.arange(first, last + 1)
    return rows[use[rows] & np.isfinite(scale[rows])]

"""At how many places a line was measured: two lie on any line, as where steps cut off an edge."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.shapes._outline_bodies import Body, Index, meeting
from turnscan.shapes._outline_settled import Settled
from turnscan.shapes._section import Chain

_FEWEST = 3
"""Places, and points, of a line of which anything follows."""
_APART = 0.25
"""Of the longest side of a face that ends in two vertices, from which on they are two places."""
_EXACT = 1e-5
"""Of its length, what a chain is off at the most that was drawn and not measured."""


def place_numbers(chain: Chain) -> Longs:
    """(m, 2) the first and the last place along a chain that say where each of its points lies.

    A section has a point on every side of a face that it crosses. Between two stripes these lie on
    a chord of what is there, and say no more than the stripes do: the vertices of one stripe are
    one place. Points that hang on one vertex each are a place each.
    """
    m = len(chain.points)
    at = np.r_[0.0, np.cumsum(chain.steps)][:m]
    ahead = np.gradient(chain.points, axis=0)
    length = np.linalg.norm(chain.spans, axis=1)
    way = np.copysign(length, np.einsum("ij,ij->i", chain.spans, ahead))
    where = np.stack([at - chain.shares[:, 1] * way, at + chain.shares[:, 0] * way], axis=1)
    counts = chain.shares > 0
    vertex = np.unique(chain.ends, return_inverse=True)[1].reshape(m, 2)
    longest = np.zeros(int(vertex.max()) + 1)
    np.maximum.at(longest, vertex[counts], np.broadcast_to(length[:, None], (m, 2))[counts])
    order = np.argsort(where[counts], kind="stable")
    reach = longest[vertex[counts]][order]
    gaps = np.diff(where[counts][order])
    number = np.zeros(len(order), dtype=np.int64)
    number[order[1:]] = np.cumsum(gaps > _APART * np.maximum(reach[1:], reach[:-1]))
    first, last = np.full((m, 2), m, dtype=np.int64), np.full((m, 2), -1, dtype=np.int64)
    first[counts] = last[counts] = number
    return np.stack([first.min(axis=1), last.max(axis=1)], axis=1)


def _stripes(chain: Chain, rows: Index) -> int:
    """How many stripes lie from the first to the last of those that the points hang on."""
    if chain.stripes is None:
        return 0
    return chain.stripes.spanned(chain.ends[rows][chain.shares[rows] > 0].astype(np.int64))


def supported(s: Settled) -> tuple[bool, ...]:
    """Of each body, whether it is no line, or one that the part has and not its sampling alone.

    What decimation took away counts: those stripes measured the line, too. Of a mesh that does not
    know its sigma, nobody says that it was sampled: its sides are its own, those of two points
    where it is exact.
    """
    number = place_numbers(s.chain) if s.noise.known else None
    exact = number is None and s.noise.tolerance <= _EXACT * s.chain.length

    def enough(body: Body) -> bool:
        if body.kind != "line":
            return True
        if number is None:
            return exact or len(body.rows) >= _FEWEST
        places = len(np.unique(number[body.rows]))
        return max(places, _stripes(s.chain, body.rows)) >= _FEWEST

    return tuple(map(enough, s.bodies))


def cut_off(s: Settled, k: int, ends: Floats, u: Floats) -> float:
    """mm by which the part may reach further along ``u`` (2,) than line ``k``, a chord.

    ``ends`` (2, 2) mm are where it begins and ends. At the most to where its neighbours meet, if
    they go on; a quarter turn over the chord where they do not meet.
    """
    m = len(s.bodies)
    least = float(np.linalg.norm(ends[1] - ends[0])) / 2
    before, after = s.before(k), (k + 1) % m if s.closed or k + 1 < m else None
    if before is None or after is None or before == after:
        return least
    a, b = s.bodies[before], s.bodies[after]
    if "spline" in (a.kind, b.kind):
        return least
    middle = ends.mean(axis=0)
    apex = meeting(a, b, middle)
    if apex is None or float(np.linalg.norm(apex - middle)) > 4 * least:
        return least
    return max(float(apex @ u) - float((ends @ u).max()), 0.0)

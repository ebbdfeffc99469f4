"""Rounded corners that are too short to differ from chamfers by their points alone."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.shapes._outline_bodies import Body, meeting, used
from turnscan.shapes._outline_splines import Span
from turnscan.shapes._section import Chain

_SHORT = 0.4
"""Of its neighbours' length, what a piece at a vertex may be long."""
_LEAST_TURN = np.deg2rad(25.0)
_ROOM = 0.8
"""Of its neighbours, the most that a rounding takes."""
_FEWEST = 4
"""Places of such an arc."""
_CAP = 25.0
"""chi2 of a point at the most: a point that fits nothing decides nothing."""


def rounded(
    chain: Chain, scale: Floats, bodies: list[Body], price: float, places: Longs
) -> list[tuple[Span, Floats | None]]:
    """The spans of the bodies, those between two lines as a tangent arc where that says it better.

    A tangent arc between two given lines has one parameter, its radius; a chamfer has two, at
    ``price`` each. Such an arc was measured at four of the ``places`` of the points (m, 2) at least
    (`place_numbers`): those where it touches the lines say nothing of it. With each span
    (3,) centre and radius of such an arc, or None.
    """
    spans: list[tuple[Span, Floats | None]] = [((b.kind, *b.ways), None) for b in bodies]
    for k in range(1, len(bodies) - 1):
        a, x, b = bodies[k - 1 : k + 2]
        if not (a.kind == b.kind == "line") or spans[k - 1][1] is not None:
            continue
        found = _tangent(chain, scale, a, x, b, price)
        if found is None:
            continue
        circle, first, last = found
        if places[last, 1] - places[first, 0] + 1 < _FEWEST:
            continue
        spans[k - 1] = ((a.kind, spans[k - 1][0][1], first), None)
        spans[k] = (("arc", first, last), circle)
        spans[k + 1] = ((b.kind, last, b.ways[1]), None)
    return spans


def _length(chain: Chain, body: Body) -> float:
    return float(np.linalg.norm(chain.points[body.ways[1]] - chain.points[body.ways[0]]))


def _tangent(
    chain: Chain, scale: Floats, a: Body, x: Body, b: Body, price: float
) -> tuple[Floats, int, int] | None:
    """Centre and radius of the arc between two lines, and the points where it begins and ends."""
    from scipy.optimize import minimize_scalar

    middle = chain.points[(x.ways[0] + x.ways[1]) // 2]
    p = meeting(a, b, middle)
    u, v = a.direction(middle), b.direction(middle)
    turn = float(np.arccos(np.clip(u @ v, -1, 1)))
    room = _ROOM * min(_length(chain, a), _length(chain, b))
    if p is None or not _LEAST_TURN < turn < np.pi - _LEAST_TURN:
        return None
    if _length(chain, x) > _SHORT * min(_length(chain, a), _length(chain, b)):
        return None
    half = np.tan(turn / 2)
    out = (v - u) / np.linalg.norm(v - u)
    rows = used(np.isfinite(scale), scale, a.ways[0], b.ways[1])
    q, s = chain.points[rows], scale[rows]

    def misfit(radius: float) -> Floats:
        reach = radius * half
        centre = p + radius / np.cos(turn / 2) * out
        round_ = np.linalg.norm(q - centre, axis=1) - radius
        before, after = (p - q) @ u > reach, (q - p) @ v > reach
        off = np.where(before, _off(a, q), np.where(after, _off(b, q), round_))
        return np.asarray(np.minimum((off / s) ** 2, _CAP))

    best = minimize_scalar(
        lambda r: float(misfit(r).sum()), bounds=(1e-3 * room / half, room / half), method="bounded"
    )
    radius = float(best.x)
    straight = np.minimum(np.abs(_off(a, q)), np.abs(_off(b, q)))
    own = x.residuals(chain, x.p)[0]
    inside = np.isin(rows, x.rows)
    straight[inside] = np.abs(own[np.isin(x.rows, rows)])
    chamfered = float(np.minimum((straight / s) ** 2, _CAP).sum())
    parameters = 2.0 if x.kind == "line" else 3.0
    if float(best.fun) + price > chamfered + parameters * price:
        return None
    reach = radius * half
    centre = p + radius / np.cos(turn / 2) * out
    along = np.arange(a.ways[0], b.ways[1] + 1)
    at = chain.points[along]
    on = np.flatnonzero(((p - at) @ u <= reach) & ((at - p) @ v <= reach))
    if len(on) < 3 or on[0] < 1 or on[-1] > len(along) - 2:
        return None
    return np.r_[centre, radius], int(along[on[0]]), int(along[on[-1]])


def _off(body: Body, q: Floats) -> Floats:
    n = np.array([np.cos(body.p[0]), np.sin(body.p[0])])
    return np.asarray((q - body.origin) @ n - body.p[1])

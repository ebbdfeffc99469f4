"""The compiled search for the lines and arcs of a chain; imported only when it is used."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.compiled import njit

LINE, ARC = 0, 1
MOST_SKIPPED = 4
"""Points between two pieces that belong to neither: corners are cut by the faces across them."""
_WIDEST_TURN = 0.35
"""Radians: an arc turns no further from a point to the next; coarser ones are polygons."""
_LONGEST_SWEEP = 6.4
"""Radians, a little above a full turn: noise makes a path longer."""


class Points(NamedTuple):
    """The points of a chain, all (n,)."""

    x: Floats
    y: Floats
    """mm."""
    w: Floats
    """1/mm²: one over the variance of each across the chain; 0 for those without a say."""
    first: Longs
    last: Longs
    """The first and the last place that say where it lies: an arc needs `Prices.places` of them."""
    bulge: Floats
    """mm²: what the square of a distance to a centre lacks because the point lies on a chord."""


class Prices(NamedTuple):
    """What pieces cost beside their misfit, which is in units of its variance."""

    line: float
    arc: float
    skip: float
    """Of each point that belongs to no piece."""
    places: int
    """At which an arc was measured at the least."""
    least_sagitta: float
    """mm: an arc that bends less is a line."""


class Pieces(NamedTuple):
    """The best way found to each break (b,): written to while the search goes on."""

    cost: Floats
    start: Longs
    """The break where its last piece begins, −1 for none yet."""
    kind: Longs
    """`LINE` or `ARC`."""
    before: Longs
    """The break where the piece before it ends, −1 for none."""


@njit(cache=True, nogil=True)
def _taubin(m: Floats, out: Floats) -> float:
    """Circle from the means ``m`` = u, v, uu, uv, vv, q, uq, vq, qq, with q = u² + v² + bulge.

    Puts centre and radius into ``out`` and returns the mean square distance, negative where there
    is no circle (Taubin 1991 by Newton's method after Chernov, Circular and linear regression).
    """
    u, v, uu, uv, vv, q, uq, vq, qq = m
    g = u * u + v * v
    mz = q - g
    xx, xy, yy = uu - u * u, uv - u * v, vv - v * v
    xz = uq - 2 * u * uu - 2 * v * uv + g * u - u * mz
    yz = vq - 2 * u * uv - 2 * v * vv + g * v - v * mz
    zz = qq + 4 * u * u * uu + 4 * v * v * vv + g * g - 4 * u * uq - 4 * v * vq
    zz += 2 * g * q + 8 * u * v * uv - 4 * g * g
    cov = xx * yy - xy * xy
    var = zz - mz * mz
    if not (cov > 1e-14 * mz * mz and var > 0):
        return -1.0
    a3, a2 = 4 * mz, -3 * mz * mz - zz
    a1 = var * mz + 4 * cov * mz - xz * xz - yz * yz
    a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) - var * cov
    root, value = 0.0, a0
    for _ in range(20):
        slope = a1 + root * (2 * a2 + 3 * a3 * root)
        if slope == 0:
            break
        new = root - value / slope
        if not math.isfinite(new) or new == root:
            break
        value_new = a0 + new * (a1 + new * (a2 + new * a3))
        if abs(value_new) >= abs(value):
            break
        root, value = new, value_new
    det = root * root - root * mz + cov
    if det == 0:
        return -1.0
    a = (xz * (yy - root) - yz * xy) / det / 2
    b = (yz * (xx - root) - xz * xy) / det / 2
    r2 = a * a + b * b + mz
    if not (r2 > 0 and math.isfinite(r2)):
        return -1.0
    out[0], out[1], out[2] = a + u, b + v, math.sqrt(r2)
    e = var - 4 * (a * xz + b * yz) + 4 * (a * a * xx + 2 * a * b * xy + b * b * yy)
    return float(max(e, 0.0) / (4 * r2))


@njit(cache=True, nogil=True)
def circle(x: Floats, y: Floats, w: Floats, bulge: Floats, out: Floats) -> float:
    """The circle through points as in `Points` into ``out`` (3,); returns Σ w·distance², or −1."""
    s = np.zeros(9)
    total = 0.0
    for i in range(len(x)):
        total += w[i]
        _add(s, x[i] - x[0], y[i] - y[0], w[i], bulge[i])
    if not total > 0:
        return -1.0
    e = _taubin(s / total, out)
    out[0] += x[0]
    out[1] += y[0]
    return e * total if e >= 0 else -1.0


@njit(cache=True, nogil=True)
def _add(s: Floats, u: float, v: float, w: float, bulge: float) -> None:
    q = u * u + v * v + bulge
    s[0] += w * u
    s[1] += w * v
    s[2] += w * u * u
    s[3] += w * u * v
    s[4] += w * v * v
    s[5] += w * q
    s[6] += w * u * q
    s[7] += w * v * q
    s[8] += w * q * q


@njit(cache=True, nogil=True)
def _line(m: Floats) -> float:
    """Mean square distance from the best line, from the means of `_taubin`."""
    xx, xy, yy = m[2] - m[0] * m[0], m[3] - m[0] * m[1], m[4] - m[1] * m[1]
    half = (xx - yy) / 2
    return float(max((xx + yy) / 2 - math.sqrt(half * half + xy * xy), 0.0))


@njit(cache=True, nogil=True)
def pieces(points: Points, breaks: Longs, prices: Prices, widest_gap: float) -> tuple[Longs, float]:
    """Lines and arcs of an open chain of least Σ w·distance² + prices.

    Returns (k, 3) kind, first and last point of each, and the sum.

    ``breaks`` (b,) are the points where pieces may begin or end, the first and last point among
    them. A piece may begin where the last one ends, or some points later. Dynamic programming over
    all pairs of breaks; from a break that fits nothing any more the search goes no further.
    """
    x, y = points.x, points.y
    b = len(breaks)
    best = Pieces(np.full(b, np.inf), np.full(b, -1), np.full(b, -1), np.full(b, -1))
    found = np.empty(3)
    gap_price = np.zeros(len(x))
    for i in range(1, len(x)):
        wide = math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]) > widest_gap
        gap_price[i] = gap_price[i - 1] + (1.01 * prices.line if wide else 0.0)
    for a in range(b - 1):
        base, where = _begin(best.cost, breaks, a, prices.skip, gap_price)
        if base == np.inf:
            continue
        _grow(points, breaks, (a, where), base, prices, best, found)
    at, least = b - 1, np.inf
    for k in range(max(b - 1 - MOST_SKIPPED, 0), b):
        cost = best.cost[k] + prices.skip * (breaks[b - 1] - breaks[k])
        if cost < least:
            at, least = k, cost
    rows = np.empty((b, 3), dtype=np.int64)
    made = 0
    while at >= 0 and best.start[at] >= 0:
        rows[made] = best.kind[at], breaks[best.start[at]], breaks[at]
        made += 1
        at = best.before[at]
    return rows[:made][::-1].copy(), least


@njit(cache=True, nogil=True)
def _begin(
    best: Floats, breaks: Longs, a: int, skip_price: float, gap_price: Floats
) -> tuple[float, int]:
    """The least cost at which a piece may begin at break ``a``, and where the one before ends."""
    base, where = np.inf, -1
    if a <= MOST_SKIPPED:
        base = skip_price * (breaks[a] - breaks[0])
    for s in range(MOST_SKIPPED + 1):
        if a - s >= 0:
            lost = max(breaks[a] - breaks[a - s] - 1, 0)
            cost = best[a - s] + skip_price * lost
            cost += gap_price[breaks[a]] - gap_price[breaks[a - s]]
            if cost < base:
                base, where = cost, a - s
    return base, where


@njit(cache=True, nogil=True)
def _grow(
    points: Points, breaks: Longs, begin: tuple[int, int], base: float, prices: Prices,
    best: Pieces, found: Floats,
) -> None:  # fmt: skip
    """Offer all pieces that begin at a break to the breaks where they may end.

    ``begin`` is that break and the one where the piece before ends, ``base`` (in `Prices`' units)
    the cost up to there.
    """
    x, y, w, bulge = points.x, points.y, points.w, points.bulge
    a, where = begin
    i = breaks[a]
    s = np.zeros(9)
    total = w[i]
    count = 1 if w[i] > 0 else 0
    s[5] += w[i] * bulge[i]
    s[8] += w[i] * bulge[i] * bulge[i]
    path = widest = 0.0
    hopeless = 0
    j = i
    for e in range(a + 1, len(breaks)):
        while j < breaks[e]:
            j += 1
            step = math.hypot(x[j] - x[j - 1], y[j] - y[j - 1])
            path += step
            widest = max(widest, step)
            if w[j] > 0:
                count += 1
                total += w[j]
                _add(s, x[j] - x[i], y[j] - y[i], w[j], bulge[j])
        if total <= 0 or count < 2:
            continue
        m = s / total
        bound = count + 8.0 * math.sqrt(2.0 * count) + 10.0
        line = _line(m) * total
        if line <= bound and base + line + prices.line < best.cost[e]:
            best.cost[e] = base + line + prices.line
            best.start[e], best.kind[e], best.before[e] = a, LINE, where
        arc = np.inf
        if count >= 4 and points.last[j] - points.first[i] + 1 >= prices.places:
            mean = _taubin(m, found)
            if mean >= 0:
                arc = mean * total
                r = found[2]
                fair = widest <= _WIDEST_TURN * r and path <= _LONGEST_SWEEP * r
                fair = fair and path * path > 8 * r * prices.least_sagitta
                cost = base + arc + prices.arc
                if fair and arc <= bound and cost < best.cost[e]:
                    best.cost[e] = cost
                    best.start[e], best.kind[e], best.before[e] = a, ARC, where
        hopeless = hopeless + 1 if min(line, arc) > bound else 0
        if hopeless > 12:
            return

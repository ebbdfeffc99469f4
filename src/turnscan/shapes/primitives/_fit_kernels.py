"""Compiled kernels of the least squares that put an analytic surface through points.

Points are gathered once for each fit, side by side in rows, and one pass over them gives the cost
of a surface and all that the next step needs.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.compiled import njit
from turnscan.shapes.primitives._surface_kernels import (
    FREE,
    at,
    frame,
    lean,
    moved_across,
    slid,
    sound,
)

BOUND = 4.0
"""Standard deviations beyond which a point of a region is not fitted."""
ROUGH = 1e-3
"""Share of the cost that a step must gain while a region grows: what is fitted again later."""


@njit(cache=True, nogil=True, error_model="numpy")
def _gathered(points: Floats, scale: Floats, index: Longs) -> Floats:
    """(4, n) coordinates of points, and one over the scale of each."""
    P = np.empty((4, len(index)))
    for j in range(len(index)):
        i = index[j]
        for a in range(3):
            P[a, j] = points[i, a]
        P[3, j] = 1.0 / scale[i]
    return P


@njit(cache=True, nogil=True, error_model="numpy")
def _rows(
    kind: int, q: Floats, e1: Floats, e2: Floats, P: Floats, bound: float, J: Floats
) -> float:
    """Sum of squares over the scale, each at most ``bound``² (truncated least squares).

    Fills ``J`` (8, n) with the derivatives by the local parameters and the distance, over the
    scale; 0 of points beyond the bound.
    """
    c, s = lean(kind, q)
    total = 0.0
    p0, p1, p2, a0, a1, a2 = q[0], q[1], q[2], q[3], q[4], q[5]
    u0, u1, u2, v0, v1, v2 = e1[0], e1[1], e1[2], e2[0], e2[1], e2[2]
    for j in range(P.shape[1]):
        x, y, z, w = P[0, j], P[1, j], P[2, j], P[3, j]
        d, n0, n1, n2, by_r, by_s = at(kind, q, c, s, x, y, z)
        if abs(d * w) > bound:
            total += bound * bound
            w = 0.0
        y0, y1, y2 = x - p0, y - p1, z - p2
        c0 = w * (y1 * n2 - y2 * n1)
        c1 = w * (y2 * n0 - y0 * n2)
        c2 = w * (y0 * n1 - y1 * n0)
        n0, n1, n2 = w * n0, w * n1, w * n2
        J[0, j] = -(v0 * c0 + v1 * c1 + v2 * c2)
        J[1, j] = u0 * c0 + u1 * c1 + u2 * c2
        J[2, j] = -(u0 * n0 + u1 * n1 + u2 * n2)
        J[3, j] = -(v0 * n0 + v1 * n1 + v2 * n2)
        J[4, j] = -(a0 * n0 + a1 * n1 + a2 * n2)
        J[5, j] = w * by_r
        J[6, j] = w * by_s
        J[7, j] = w * d
        total += (w * d) * (w * d)
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _product(a: Floats, b: Floats) -> float:
    """Scalar product of rows (m,), summed in the lanes that the processor has."""
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@njit(cache=True, nogil=True)
def _normal(J: Floats, which: Longs) -> tuple[Floats, Floats]:
    """Normal matrix (k, k) and right side (k,) of the parameters ``which``, of `_rows`."""
    k = len(which)
    N, g = np.zeros((k, k)), np.zeros(k)
    for a in range(k):
        row = J[which[a]]
        g[a] = -_product(row, J[7])
        for b in range(a + 1):
            N[a, b] = _product(row, J[which[b]])
            N[b, a] = N[a, b]
    return N, g


@njit(cache=True, nogil=True)
def _solved(N: Floats, g: Floats, damping: float) -> tuple[bool, Floats]:
    """Cholesky solution of the damped normal equations, every scale taken out first."""
    k = len(g)
    s = np.empty(k)
    for i in range(k):
        s[i] = 1.0 / np.sqrt(max(N[i, i], 1e-300))
    L = np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1):
            v = N[i, j] * s[i] * s[j]
            if i == j:
                v += damping
            for m in range(j):
                v -= L[i, m] * L[j, m]
            if i == j:
                if not v > 1e-13:
                    return False, g
                L[i, i] = np.sqrt(v)
            else:
                L[i, j] = v / L[j, j]
    x = np.empty(k)
    for i in range(k):
        v = g[i] * s[i]
        for m in range(i):
            v -= L[i, m] * x[m]
        x[i] = v / L[i, i]
    for i in range(k - 1, -1, -1):
        v = x[i]
        for m in range(i + 1, k):
            v -= L[m, i] * x[m]
        x[i] = v / L[i, i]
    return True, x * s


@njit(cache=True, nogil=True)
def _settle(
    kind: int, q: Floats, P: Floats, free: Bools, bound: float, reach: float, rounds: int,
    enough: float,
) -> tuple[Floats, float]:  # fmt: skip
    """`fitted` through points that are `_gathered`."""
    which = np.flatnonzero(free)
    J = np.empty((8, P.shape[1]))
    damping = 1e-4
    e1, e2 = frame(q[3:6])
    cost = _rows(kind, q, e1, e2, P, bound, J)
    for _ in range(rounds):
        N, g = _normal(J, which)
        gain = -1.0
        for _try in range(6):
            fine, x = _solved(N, g, damping)
            if fine:
                step = np.zeros(7)
                for a in range(len(which)):
                    step[which[a]] = x[a]
                new = moved_across(q, e1, e2, step)
                f1, f2 = frame(new[3:6])
                trial = _rows(kind, new, f1, f2, P, bound, J)
                if trial <= cost and sound(kind, new, reach):
                    gain = cost - trial
                    q, cost, e1, e2 = new, trial, f1, f2
                    damping = max(damping * 0.1, 1e-12)
                    break
            damping = max(damping * 10.0, 1e-6)
        if gain < 0.0 or gain <= enough * cost + 1e-12:
            break
    if not sound(kind, q, reach):
        return q, np.inf
    return q, cost


@njit(cache=True, nogil=True)
def fitted(
    kind: int, q: Floats, points: Floats, scale: Floats, index: Longs, free: Bools, bound: float,
    reach: float, rounds: int, enough: float = 1e-9,
) -> tuple[Floats, float]:  # fmt: skip
    """Truncated least squares by Levenberg and Marquardt: the surface and its cost.

    It ends where a step gains no more than the share ``enough`` of the cost.

    ``scale`` (n,) mm is one standard deviation of each point, ``index`` those that count, ``free``
    (7,) the parameters that may move. A point further than ``bound`` scales has no say. No radius
    passes ``reach`` mm: beyond it curvature means nothing. The cost is inf where no fit is found.
    """
    return _settle(kind, q, _gathered(points, scale, index), free, bound, reach, rounds, enough)


@njit(cache=True, nogil=True)
def refitted(
    kind: int, q: Floats, points: Floats, scale: Floats, limit: Floats, off: Floats,
    index: Longs, reach: float, rounds: int,
) -> tuple[Floats, float, float]:  # fmt: skip
    """`fitted` through points of an index, the cost per point, and the misfit beyond their noise.

    The last is root mean square, each over its own ``limit`` (n,) mm; the noise is what each stands
    ``off`` (n,) mm its neighbours by, half of them less and half of them more.
    """
    begun = slid(kind, q, points, index)
    P = _gathered(points, scale, index)
    q, cost = _settle(kind, begun, P, FREE[kind], BOUND, reach, rounds, ROUGH)
    share = np.empty(len(index))
    c, s = lean(kind, q)
    total = 0.0
    for n in range(len(index)):
        i = index[n]
        d = at(kind, q, c, s, P[0, n], P[1, n], P[2, n])[0] / limit[i]
        total += d * d
        share[n] = abs(off[i] / limit[i])
    noise = 1.4826 * np.median(share)
    many = max(len(index), 1)
    return q, cost / many, np.sqrt(max(total / many - noise * noise, 0.0))

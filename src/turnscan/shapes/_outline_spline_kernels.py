"""The compiled sums of a spline's fit; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def cubics(at: Floats, knots: Floats) -> tuple[Longs, Floats, Floats]:
    """(n,) the first of the four control points that count at each place of a clamped cubic, (n, 4)
    their shares, and (n, 4) how these change (de Boor 1978, A Practical Guide to Splines, X)."""
    n = len(at)
    first = np.empty(n, dtype=np.int64)
    share, rise = np.zeros((n, 4)), np.empty((n, 4))
    for i in range(n):
        x = at[i]
        last = min(max(np.searchsorted(knots, x, side="right") - 1, 3), len(knots) - 5)
        first[i] = last - 3
        share[i, 0] = 1.0
        for degree in range(1, 4):
            if degree == 3:
                rise[i, 0], rise[i, 3] = 0.0, 0.0
                for k in range(3):
                    part = 3.0 * share[i, k] / (knots[last + k + 1] - knots[last + k - 2])
                    rise[i, k] = (rise[i, k] if k else 0.0) - part
                    rise[i, k + 1] = part
            saved = 0.0
            for k in range(degree):
                right, left = knots[last + k + 1], knots[last + k + 1 - degree]
                part = share[i, k] / (right - left)
                share[i, k] = saved + part * (right - x)
                saved = part * (x - left)
            share[i, degree] = saved
    return first, share, rise


@njit(cache=True, nogil=True)
def equations(
    p: Floats, weight: Floats, first: Longs, share: Floats, controls: int
) -> tuple[Floats, Floats]:
    """Normal equations (k, k) and (k, 2) of points (n, 2) with weights (n,), of which each has
    ``share`` (n, 4) of the four control points from ``first`` (n,) on."""
    normal, right = np.zeros((controls, controls)), np.zeros((controls, 2))
    for i in range(len(p)):
        for a in range(4):
            pull = weight[i] * share[i, a]
            row = first[i] + a
            right[row, 0] += pull * p[i, 0]
            right[row, 1] += pull * p[i, 1]
            for b in range(4):
                normal[row, first[i] + b] += pull * share[i, b]
    return normal, right


@njit(cache=True, nogil=True)
def settled(
    p: Floats, weight: Floats, at: Floats, cubic: tuple[Longs, Floats, Floats], control: Floats
) -> tuple[float, Floats]:
    """Σ weight · (distance across the spline)² of points (n, 2), and (n,) where along it each is
    nearest, one Newton step on from ``at`` (n,)."""
    first, share, rise = cubic
    chi2, nearest = 0.0, np.empty_like(at)
    for i in range(len(p)):
        u, v = p[i]
        du = dv = 0.0
        for a in range(4):
            x, y = control[first[i] + a]
            u -= share[i, a] * x
            v -= share[i, a] * y
            du += rise[i, a] * x
            dv += rise[i, a] * y
        speed = max(du * du + dv * dv, 1e-300)
        across = u * dv - v * du
        chi2 += weight[i] * across * across / speed
        nearest[i] = min(max(at[i] + (u * du + v * dv) / speed, 0.0), 1.0)
    return chi2, nearest

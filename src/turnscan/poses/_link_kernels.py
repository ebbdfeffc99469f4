"""Compiled kernels: which places two views measured both, and their sums of least squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.compiled import njit


class Surface(NamedTuple):
    """A view's points, in its own frame, and where the view lies."""

    points: Floats
    """(n, 3) mm."""
    normals: Floats
    """(n, 3) unit."""
    sigma: Floats
    """(n,) mm."""
    inner: Bools
    """(n,)."""
    rotation: Floats
    """(3, 3), view's frame → common frame."""
    translation: Floats
    """(3,) mm."""


class Sums(NamedTuple):
    """What the links between two views add to the normal equations."""

    H: Floats
    """(12, 12), turn before shift, the first view before the second."""
    g: Floats
    """(12,)."""
    mine: Floats
    """(6, 6): weighted square of the first view's motion itself."""
    others: Floats
    """(6, 6): of the second one's."""
    weights: Floats
    """(k,) mm⁻²."""
    chi2: float
    """Weighted square of the residuals, in sigma."""
    robust: float
    """Sum of Tukey's weights."""


@njit(cache=True, nogil=True)
def _placed(R: Floats, t: Floats, x: Floats, out: Floats) -> None:
    for a in range(3):
        out[a] = R[a, 0] * x[0] + R[a, 1] * x[1] + R[a, 2] * x[2] + t[a]


@njit(cache=True, nogil=True)
def met(
    mine: Surface,
    other: Surface,
    samples: Ints,
    away: Floats,
    at: Longs,
    limits: tuple[float, float],
) -> tuple[Ints, Floats, Floats, Floats, Floats, Floats]:
    """Samples (k,) that have a partner: their numbers, places, normals and sigma as in `Links`.

    ``away`` (k,) mm and ``at`` (k,) are the distance and number of the nearest point of the other
    view, infinite where there is none. ``limits``: the least cosine between the normals, and the
    square of how far the partner may lie beside the normal, mm².
    """
    alike, beside = limits
    most = len(samples)
    which = np.empty(most, np.int32)
    p, q, n, m = np.empty((most, 3)), np.empty((most, 3)), np.empty((most, 3)), np.empty((most, 3))
    sigma, nought, count = np.empty(most), np.zeros(3), 0
    for k in range(most):
        if not np.isfinite(away[k]) or not other.inner[at[k]]:
            continue
        i, j, c = samples[k], at[k], count
        _placed(mine.rotation, nought, mine.normals[i], n[c])
        _placed(other.rotation, nought, other.normals[j], m[c])
        if n[c, 0] * m[c, 0] + n[c, 1] * m[c, 1] + n[c, 2] * m[c, 2] <= alike:
            continue
        _placed(mine.rotation, mine.translation, mine.points[i], p[c])
        _placed(other.rotation, other.translation, other.points[j], q[c])
        rise = 0.0
        for a in range(3):
            rise += m[c, a] * (p[c, a] - q[c, a])
        if away[k] ** 2 - rise**2 > beside:
            continue
        sigma[c] = np.hypot(mine.sigma[i], other.sigma[j])
        which[c] = k
        count += 1
    return which[:count], p[:count], q[:count], n[:count], m[:count], sigma[:count]


@njit(cache=True, nogil=True)
def _row(x: Floats, n: Floats, sign: float, out: Floats) -> None:
    """(6,): how an offset along n answers to a turn and a shift of what lies at lever x."""
    out[0] = sign * (x[1] * n[2] - x[2] * n[1])
    out[1] = sign * (x[2] * n[0] - x[0] * n[2])
    out[2] = sign * (x[0] * n[1] - x[1] * n[0])
    for a in range(3):
        out[3 + a] = sign * n[a]


@njit(cache=True, nogil=True)
def _add_motion(x: Floats, w: float, out: Floats) -> None:
    """Adds w |ω × x + t|², as a form in (ω, t), to (6, 6)."""
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    for a in range(3):
        out[a, a] += w * square
        out[3 + a, 3 + a] += w
        for b in range(3):
            out[a, b] -= w * x[a] * x[b]
        # The cross product with x, in both corners.
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a, 3 + b] -= w * x[c]
        out[a, 3 + c] += w * x[b]
        out[3 + b, a] -= w * x[c]
        out[3 + c, a] += w * x[b]


@njit(cache=True, nogil=True)
def sums(
    p: Floats,
    q: Floats,
    normals: Floats,
    offsets: Floats,
    sigma: Floats,
    scale: tuple[float, float],
    middles: Floats,
) -> Sums:
    """Sums over links (k,), Tukey's weights round their scatter.

    ``scale``: the scatter of the offsets in sigma, and how many of it an offset may be. ``middles``
    (2, 3) mm: what the two views turn about.
    """
    spread, tukey = scale
    H, g, mine, others = np.zeros((12, 12)), np.zeros(12), np.zeros((6, 6)), np.zeros((6, 6))
    weights, J, x, y = np.zeros(len(p)), np.empty(12), np.empty(3), np.empty(3)
    chi2, count = 0.0, 0.0
    for k in range(len(p)):
        one = spread * sigma[k]
        u = offsets[k] / (tukey * one)
        if abs(u) >= 1.0:
            continue
        robust = (1.0 - u * u) ** 2
        w = robust / one**2
        for a in range(3):
            x[a] = p[k, a] - middles[0, a]
            y[a] = q[k, a] - middles[1, a]
        _row(x, normals[k], 1.0, J[:6])
        _row(y, normals[k], -1.0, J[6:])
        for a in range(12):
            wj = w * J[a]
            g[a] -= wj * offsets[k]
            for b in range(a + 1):
                H[a, b] += wj * J[b]
        _add_motion(x, w, mine)
        _add_motion(y, w, others)
        weights[k] = w
        chi2 += robust * (offsets[k] / sigma[k]) ** 2
        count += robust
    for a in range(12):
        for b in range(a):
            H[b, a] = H[a, b]
    return Sums(H, g, mine, others, weights, chi2, count)

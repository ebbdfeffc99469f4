"""Compiled kernels of first guesses: sums over the points of a small patch.

A patch has some 80 points, and NumPy would take longer to be called than to add them up.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.compiled import njit

TERMS = 10
"""Of a cubic of two variables."""


@njit(cache=True, nogil=True)
def _cubic(u: float, v: float, terms: Floats) -> None:
    """The ten terms of a cubic at a place, into ``terms``."""
    terms[0] = 1.0
    terms[1] = u
    terms[2] = v
    terms[3] = u * u
    terms[4] = u * v
    terms[5] = v * v
    terms[6] = u * u * u
    terms[7] = u * u * v
    terms[8] = u * v * v
    terms[9] = v * v * v


@njit(cache=True, nogil=True)
def height_sums(X: Floats, e1: Floats, e2: Floats, up: Floats) -> tuple[float, Floats, Floats]:
    """Half the width of points (n, 3) mm across ``up``, and the normal equations (10, 10), (10,) of
    the cubic in (x·e1, x·e2) over that width which their heights are."""
    n, size = len(X), 1e-300
    place = np.empty((n, 3))
    for i in range(n):
        for k in range(3):
            place[i, k] = 0.0
        for a in range(3):
            place[i, 0] += X[i, a] * e1[a]
            place[i, 1] += X[i, a] * e2[a]
            place[i, 2] += X[i, a] * up[a]
        size = max(size, abs(place[i, 0]), abs(place[i, 1]))
    M, right, terms = np.zeros((TERMS, TERMS)), np.zeros(TERMS), np.empty(TERMS)
    for i in range(n):
        _cubic(place[i, 0] / size, place[i, 1] / size, terms)
        for a in range(TERMS):
            right[a] += terms[a] * place[i, 2]
            for b in range(a + 1):
                M[a, b] += terms[a] * terms[b]
    for a in range(TERMS):
        for b in range(a):
            M[b, a] = M[a, b]
    return size, M, right


@njit(cache=True, nogil=True)
def on_heights(
    X: Floats, e1: Floats, e2: Floats, up: Floats, size: float, c: Floats
) -> tuple[Floats, Floats]:
    """Points (n, 3) mm moved along ``up`` onto a cubic (`height_sums`), and its unit normals."""
    smooth, normals, terms = np.empty_like(X), np.empty_like(X), np.empty(TERMS)
    for i in range(len(X)):
        u, v, w = 0.0, 0.0, 0.0
        for a in range(3):
            u += X[i, a] * e1[a]
            v += X[i, a] * e2[a]
            w += X[i, a] * up[a]
        u /= size
        v /= size
        _cubic(u, v, terms)
        height = 0.0
        for a in range(TERMS):
            height += c[a] * terms[a]
        by_u = c[1] + 2 * c[3] * u + c[4] * v + 3 * c[6] * u * u + 2 * c[7] * u * v + c[8] * v * v
        by_v = c[2] + c[4] * u + 2 * c[5] * v + c[7] * u * u + 2 * c[8] * u * v + 3 * c[9] * v * v
        long = np.sqrt(1.0 + (by_u * by_u + by_v * by_v) / (size * size))
        for a in range(3):
            smooth[i, a] = X[i, a] + (height - w) * up[a]
            normals[i, a] = (up[a] - (by_u * e1[a] + by_v * e2[a]) / size) / long
    return smooth, normals


@njit(cache=True, nogil=True)
def complex_sums(X: Floats, normals: Floats, size: float) -> Floats:
    """(6, 6) Σ l lᵀ of lines l = (n, x × n) that are normals of points x (n, 3) over ``size``."""
    M, row = np.zeros((6, 6)), np.empty(6)
    for i in range(len(X)):
        x, y, z = X[i, 0] / size, X[i, 1] / size, X[i, 2] / size
        a, b, c = normals[i, 0], normals[i, 1], normals[i, 2]
        row[0] = a
        row[1] = b
        row[2] = c
        row[3] = y * c - z * b
        row[4] = z * a - x * c
        row[5] = x * b - y * a
        for j in range(6):
            for k in range(6):
                M[j, k] += row[j] * row[k]
    return M


@njit(cache=True, nogil=True)
def round_sums(X: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Normal equations (k, k), (k,) of |x|² = 2 m·x + d, a circle or sphere through points (n, m).

    With heights ``along`` (n,), else empty, the points are those of circles whose radius changes
    with the height t as r + s t: |x|² = 2 m·x + s² t² + 2 r s t + d.
    """
    n, m = X.shape
    k = m + 1 + (2 if len(along) else 0)
    M, right, row = np.zeros((k, k)), np.zeros(k), np.ones(k)
    for i in range(n):
        square = 0.0
        for a in range(m):
            row[a] = 2.0 * X[i, a]
            square += X[i, a] * X[i, a]
        if len(along):
            row[m] = along[i] * along[i]
            row[m + 1] = 2.0 * along[i]
        for a in range(k):
            right[a] += row[a] * square
            for b in range(k):
                M[a, b] += row[a] * row[b]
    return M, right

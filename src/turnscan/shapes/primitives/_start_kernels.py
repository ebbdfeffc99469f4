"""Compiled kernels of first guesses: the surfaces through the points of a small patch.

A patch has some 80 points, and NumPy would take longer to be called than to add them up or to solve
a system of ten equations.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, SPHERE, TORUS, frame

TERMS = 10
"""Of a cubic of two variables."""
_CALMED, _FLAT = 30, 0.3
"""Points of a patch that a cubic is laid through, and the least cosine of a normal to the mean."""
_SWEEPS = 12
"""Of Jacobi's rotations; a symmetric matrix of three rows takes four or five."""


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
def _height_sums(X: Floats, e1: Floats, e2: Floats, up: Floats) -> tuple[float, Floats, Floats]:
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
def _on_heights(
    X: Floats, e1: Floats, e2: Floats, up: Floats, size: float, c: Floats
) -> tuple[Floats, Floats]:
    """Points (n, 3) mm moved along ``up`` onto a cubic (`_height_sums`), and its unit normals."""
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
def _complex_sums(X: Floats, normals: Floats, size: float) -> Floats:
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
def _round_sums(X: Floats, along: Floats) -> tuple[Floats, Floats]:
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


@njit(cache=True, nogil=True)
def solved(M: Floats, right: Floats) -> tuple[bool, Floats]:
    """Solution (k,) of equations (k, k), by elimination with pivots; False where there is none."""
    k = len(right)
    A, x = M.copy(), right.copy()
    for i in range(k):
        top = i
        for j in range(i + 1, k):
            if abs(A[j, i]) > abs(A[top, i]):
                top = j
        if not abs(A[top, i]) > 0.0:
            return False, x
        for c in range(i, k):
            A[i, c], A[top, c] = A[top, c], A[i, c]
        x[i], x[top] = x[top], x[i]
        for j in range(i + 1, k):
            f = A[j, i] / A[i, i]
            for c in range(i, k):
                A[j, c] -= f * A[i, c]
            x[j] -= f * x[i]
    for i in range(k - 1, -1, -1):
        for c in range(i + 1, k):
            x[i] -= A[i, c] * x[c]
        x[i] /= A[i, i]
    return True, x


@njit(cache=True, nogil=True)
def principal(M: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues (3,) of a symmetric matrix (3, 3), the least first, and unit vectors as columns.

    Jacobi's rotations (Golub and Van Loan, Matrix Computations, 8.5).
    """
    A, V = M.copy(), np.eye(3)
    for _ in range(_SWEEPS):
        off = A[0, 1] * A[0, 1] + A[0, 2] * A[0, 2] + A[1, 2] * A[1, 2]
        if off <= 1e-34 * (A[0, 0] * A[0, 0] + A[1, 1] * A[1, 1] + A[2, 2] * A[2, 2]):
            break
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if A[i, j] == 0.0:
                continue
            half = (A[j, j] - A[i, i]) / (2.0 * A[i, j])
            t = 1.0 / (abs(half) + np.sqrt(1.0 + half * half))
            t = t if half >= 0.0 else -t
            c = 1.0 / np.sqrt(1.0 + t * t)
            s = t * c
            for k in range(3):
                a, b = A[k, i], A[k, j]
                A[k, i], A[k, j] = c * a - s * b, s * a + c * b
            for k in range(3):
                a, b = A[i, k], A[j, k]
                A[i, k], A[j, k] = c * a - s * b, s * a + c * b
            for k in range(3):
                a, b = V[k, i], V[k, j]
                V[k, i], V[k, j] = c * a - s * b, s * a + c * b
    for i, j in ((0, 1), (1, 2), (0, 1)):
        if A[j, j] < A[i, i]:
            A[i, i], A[j, j] = A[j, j], A[i, i]
            for k in range(3):
                V[k, i], V[k, j] = V[k, j], V[k, i]
    return np.array([A[0, 0], A[1, 1], A[2, 2]]), V


@njit(cache=True, nogil=True)
def _round(X: Floats, along: Floats) -> tuple[bool, Floats]:
    """The solution of `_round_sums` with the radius behind it; False where there is none."""
    m = X.shape[1]
    M, right = _round_sums(X, along)
    fine, s = solved(M, right)
    out = np.empty(len(s) + 1)
    out[: len(s)] = s
    square = s[len(s) - 1]
    for a in range(m):
        square += s[a] * s[a]
    out[len(s)] = np.sqrt(max(square, 0.0))
    return fine and square > 0.0, out


@njit(cache=True, nogil=True)
def _calmed(X: Floats, normals: Floats, up: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) and normals (n, 3) of the cubic height field through a patch.

    Normals of a noisy mesh are too rough to tell an axis from.
    """
    least = 1.0
    for i in range(len(X)):
        least = min(least, normals[i, 0] * up[0] + normals[i, 1] * up[1] + normals[i, 2] * up[2])
    if len(X) < _CALMED or least < _FLAT:
        return X, normals
    e1, e2 = frame(up)
    size, M, right = _height_sums(X, e1, e2, up)
    little = 0.0
    for a in range(TERMS):
        little += 1e-9 * M[a, a]
    for a in range(TERMS):
        M[a, a] += little
    fine, c = solved(M, right)
    return _on_heights(X, e1, e2, up, size, c) if fine else (X, normals)


@njit(cache=True, nogil=True)
def _across(X: Floats, axis: Floats) -> Floats:
    """Points (n, 3) by the `frame` of an axis, the heights on it last."""
    e1, e2 = frame(axis)
    out = np.zeros_like(X)
    for i in range(len(X)):
        for a in range(3):
            out[i, 0] += X[i, a] * e1[a]
            out[i, 1] += X[i, a] * e2[a]
            out[i, 2] += X[i, a] * axis[a]
    return out


@njit(cache=True, nogil=True)
def _scattered(normals: Floats, mean: Floats) -> Floats:
    """(3, 3) Σ n nᵀ of normals (n, 3) less their mean."""
    M = np.zeros((3, 3))
    for i in range(len(normals)):
        for a in range(3):
            for b in range(3):
                M[a, b] += (normals[i, a] - mean[a]) * (normals[i, b] - mean[b])
    return M


@njit(cache=True, nogil=True)
def _times(A: Floats, B: Floats) -> Floats:
    """Product of two matrices (3, 3)."""
    out = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            for c in range(3):
                out[a, b] += A[a, c] * B[c, b]
    return out


@njit(cache=True, nogil=True)
def _turned(X: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """The axis about which a rotation moves every point (n, 3) most nearly across its normal, and
    the place (3,) on it next to the origin."""
    size = 1e-300
    for i in range(len(X)):
        size = max(size, abs(X[i, 0]), abs(X[i, 1]), abs(X[i, 2]))
    M = _complex_sums(X, normals, size)
    values, vectors = principal(M[:3, :3])
    strong = vectors.copy()
    for k in range(3):
        for a in range(3):
            strong[a, k] /= values[k] if values[k] > 1e-6 * values[2] else np.inf
    shift = -_times(_times(strong, vectors.T.copy()), M[:3, 3:])
    axis = principal(M[3:, 3:] + _times(M[3:, :3], shift))[1][:, 0].copy()
    moved = np.zeros(3)
    for a in range(3):
        for b in range(3):
            moved[a] += shift[a, b] * axis[b] * size
    foot = np.empty(3)
    foot[0] = axis[1] * moved[2] - axis[2] * moved[1]
    foot[1] = axis[2] * moved[0] - axis[0] * moved[2]
    foot[2] = axis[0] * moved[1] - axis[1] * moved[0]
    return axis, foot


@njit(cache=True, nogil=True)
def _put(out: Floats, middle: Floats, axis: Floats, place: Floats) -> None:
    """A surface's point and axis into its numbers (10,); ``place`` (3,) is by `_across`."""
    e1, e2 = frame(axis)
    long = max(np.sqrt((axis * axis).sum()), 1e-300)
    for a in range(3):
        out[a] = middle[a] + place[0] * e1[a] + place[1] * e2[a] + place[2] * axis[a]
        out[3 + a] = axis[a] / long


@njit(cache=True, nogil=True)
def guesses(points: Floats, patch_normals: Floats) -> tuple[Floats, Bools]:
    """(5, 10) the surface of each kind through points (n, 3) with normals, and whether there is one
    (`_start.first_guesses`)."""
    out, fine, none = np.zeros((5, 10)), np.zeros(5, dtype=np.bool_), np.zeros(0)
    many, middle, up, mean = len(points), np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(many):
        for a in range(3):
            middle[a] += points[i, a] / many
            up[a] += patch_normals[i, a] / many
    X, normals = _calmed(points - middle, patch_normals, up / max(np.sqrt((up * up).sum()), 1e-300))
    for i in range(many):
        for a in range(3):
            mean[a] += normals[i, a] / many

    fine[PLANE] = True
    _put(out[PLANE], middle, mean, np.zeros(3))

    fine[SPHERE], s = _round(X, none)
    if fine[SPHERE]:
        out[SPHERE, :3] = middle + s[:3]
        out[SPHERE, 5], out[SPHERE, 6] = 1.0, s[4]

    axis = principal(_scattered(normals, np.zeros(3)))[1][:, 0].copy()
    seen = _across(X, axis)
    fine[CYLINDER], s = _round(seen[:, :2].copy(), none)
    if fine[CYLINDER]:
        _put(out[CYLINDER], middle, axis, np.array([s[0], s[1], 0.0]))
        out[CYLINDER, 6] = s[3]

    # A cone goes through circles: at each height t the radius is r + t tan s.
    # (x − u)² + (y − v)² = (r + k t)²: linear in u, v, k², r k and r² − u² − v².
    axis = principal(_scattered(normals, mean))[1][:, 0].copy()
    seen = _across(X, axis)
    fine[CONE], s = _round(seen[:, :2].copy(), seen[:, 2].copy())
    if fine[CONE]:
        _put(out[CONE], middle, axis, np.array([s[0], s[1], 0.0]))
        out[CONE, 6], out[CONE, 7] = s[5], np.arctan(s[3] / s[5])

    axis, foot = _turned(X, normals)
    seen = _across(X - foot, axis)
    for i in range(many):
        seen[i, 0] = np.sqrt(seen[i, 0] * seen[i, 0] + seen[i, 1] * seen[i, 1])
        seen[i, 1] = seen[i, 2]
    fine[TORUS], s = _round(seen[:, :2].copy(), none)
    if fine[TORUS]:
        _put(out[TORUS], middle + foot, axis, np.array([0.0, 0.0, s[1]]))
        out[TORUS, 6], out[TORUS, 7] = max(s[0], 0.0), s[3]
    return out, fine

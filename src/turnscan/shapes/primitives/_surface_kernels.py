"""Compiled kernels of the analytic surfaces: distances, derivatives, moves.

Each kind is a surface of revolution about an axis a through a point p. With t = (x − p)·a and
ρ = |x − p − t a|, the distance of x is

plane t · sphere |x − p| − r · cylinder ρ − r · cone (ρ − r) cos s − t sin s ·
torus √((ρ − r)² + t²) − s.

A surface is ten numbers: p, a, r, s, and two that are not used. Its seven local parameters are
tilt of the axis along e1 and e2, shift of p along e1, e2 and a, r and s; not all of them mean
something to each kind (`FREE`).
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.compiled import njit

PLANE, SPHERE, CYLINDER, CONE, TORUS = range(5)

FREE = np.array(
    [
        [1, 1, 0, 0, 1, 0, 0],
        [0, 0, 1, 1, 1, 1, 0],
        [1, 1, 1, 1, 0, 1, 0],
        [1, 1, 1, 1, 0, 1, 1],
        [1, 1, 1, 1, 1, 1, 1],
    ],
    dtype=np.bool_,
)
"""(kinds, 7) which local parameters a kind has."""
_TINY = 1e-12


@njit(cache=True, nogil=True)
def frame(axis: Floats) -> tuple[Floats, Floats]:
    """Unit vectors e1, e2 across an axis; e1 × e2 = axis."""
    k = 0
    if abs(axis[1]) < abs(axis[k]):
        k = 1
    if abs(axis[2]) < abs(axis[k]):
        k = 2
    lead = np.zeros(3)
    lead[k] = 1.0
    e1 = np.empty(3)
    e1[0] = axis[1] * lead[2] - axis[2] * lead[1]
    e1[1] = axis[2] * lead[0] - axis[0] * lead[2]
    e1[2] = axis[0] * lead[1] - axis[1] * lead[0]
    e1 /= np.sqrt((e1 * e1).sum())
    e2 = np.empty(3)
    e2[0] = axis[1] * e1[2] - axis[2] * e1[1]
    e2[1] = axis[2] * e1[0] - axis[0] * e1[2]
    e2[2] = axis[0] * e1[1] - axis[1] * e1[0]
    return e1, e2


@njit(cache=True, nogil=True)
def lean(kind: int, q: Floats) -> tuple[float, float]:
    """Cosine and sine of a cone's angle, which `at` needs for each point; 1 and 0 of the others."""
    if kind == 3:
        return np.cos(q[7]), np.sin(q[7])
    return 1.0, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def at(
    kind: int, q: Floats, c: float, s: float, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float]:
    """Distance of a point, the normal (three numbers), derivatives by r and s; `lean` is c and s.

    It takes and gives numbers alone, for a view of an array costs more than what is done here.
    """
    y0, y1, y2 = x - q[0], y - q[1], z - q[2]
    t = y0 * q[3] + y1 * q[4] + y2 * q[5]
    if kind == 0:
        return t, q[3], q[4], q[5], 0.0, 0.0
    if kind == 1:
        long = max(np.sqrt(y0 * y0 + y1 * y1 + y2 * y2), _TINY)
        return long - q[6], y0 / long, y1 / long, y2 / long, -1.0, 0.0
    o0, o1, o2 = y0 - t * q[3], y1 - t * q[4], y2 - t * q[5]
    rho = np.sqrt(o0 * o0 + o1 * o1 + o2 * o2)
    safe = max(rho, _TINY)
    o0, o1, o2 = o0 / safe, o1 / safe, o2 / safe
    away = rho - q[6]
    if kind == 2:
        return away, o0, o1, o2, -1.0, 0.0
    if kind == 3:
        n0, n1, n2 = c * o0 - s * q[3], c * o1 - s * q[4], c * o2 - s * q[5]
        return away * c - t * s, n0, n1, n2, -c, -away * s - t * c
    ring = max(np.sqrt(away * away + t * t), _TINY)
    f, g = away / ring, t / ring
    n0, n1, n2 = f * o0 + g * q[3], f * o1 + g * q[4], f * o2 + g * q[5]
    return ring - q[7], n0, n1, n2, -f, -1.0


@njit(cache=True, nogil=True)
def distances(kind: int, q: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Signed distances (n,) mm of points (n, 3), and unit normals (n, 3) of the surface there."""
    d = np.empty(len(points))
    normals = np.empty((len(points), 3))
    c, s = lean(kind, q)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        d[i], normals[i, 0], normals[i, 1], normals[i, 2], _, _ = at(kind, q, c, s, x, y, z)
    return d, normals


@njit(cache=True, nogil=True)
def _row(
    kind: int, q: Floats, e1: Floats, e2: Floats, cs: tuple[float, float],
    x: float, y: float, z: float, J: Floats,
) -> float:  # fmt: skip
    """Distance of a point; fills its derivatives (7,) by the local parameters."""
    d, n0, n1, n2, J[5], J[6] = at(kind, q, cs[0], cs[1], x, y, z)
    y0, y1, y2 = x - q[0], y - q[1], z - q[2]
    c0 = y1 * n2 - y2 * n1
    c1 = y2 * n0 - y0 * n2
    c2 = y0 * n1 - y1 * n0
    J[0] = -(e2[0] * c0 + e2[1] * c1 + e2[2] * c2)
    J[1] = e1[0] * c0 + e1[1] * c1 + e1[2] * c2
    J[2] = -(e1[0] * n0 + e1[1] * n1 + e1[2] * n2)
    J[3] = -(e2[0] * n0 + e2[1] * n1 + e2[2] * n2)
    J[4] = -(q[3] * n0 + q[4] * n1 + q[5] * n2)
    return float(d)


@njit(cache=True, nogil=True)
def jacobian(kind: int, q: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) and derivatives (n, 7) by the local parameters."""
    e1, e2 = frame(q[3:6])
    cs = lean(kind, q)
    d = np.empty(len(points))
    J = np.empty((len(points), 7))
    for i in range(len(points)):
        d[i] = _row(kind, q, e1, e2, cs, points[i, 0], points[i, 1], points[i, 2], J[i])
    return d, J


@njit(cache=True, nogil=True)
def moved(q: Floats, step: Floats) -> Floats:
    """The surface after a step (7,) of its local parameters, across by `frame` of its axis."""
    e1, e2 = frame(q[3:6])
    return moved_across(q, e1, e2, step)


@njit(cache=True, nogil=True)
def moved_across(q: Floats, e1: Floats, e2: Floats, step: Floats) -> Floats:
    """The same with unit vectors across the axis that are given."""
    out = q.copy()
    for k in range(3):
        out[3 + k] = q[3 + k] + step[0] * e1[k] + step[1] * e2[k]
        out[k] = q[k] + step[2] * e1[k] + step[3] * e2[k] + step[4] * q[3 + k]
    out[3:6] /= np.sqrt((out[3:6] * out[3:6]).sum())
    out[6] = q[6] + step[5]
    out[7] = q[7] + step[6]
    return out


@njit(cache=True, nogil=True)
def some_of(member: Longs, most: int) -> Longs:
    """At most so many members, evenly spread and the same each time."""
    if len(member) <= most:
        return member
    out = np.empty(most, dtype=np.int64)
    step = (len(member) - 1) / (most - 1)
    for i in range(most):
        out[i] = member[min(int(i * step), len(member) - 1)]
    out[most - 1] = member[len(member) - 1]
    return out


@njit(cache=True, nogil=True)
def slid(kind: int, q: Floats, points: Floats, index: Longs) -> Floats:
    """The same surface with its point p beside the middle of some points, where p may slide."""
    out = q.copy()
    middle = np.zeros(3)
    for i in index:
        for k in range(3):
            middle[k] += points[i, k]
    middle /= max(len(index), 1)
    t = 0.0
    for k in range(3):
        t += (middle[k] - q[k]) * q[3 + k]
    if kind == PLANE:
        for k in range(3):
            out[k] = middle[k] - t * q[3 + k]
    elif kind in (CYLINDER, CONE):
        for k in range(3):
            out[k] = q[k] + t * q[3 + k]
        if kind == CONE:
            out[6] = q[6] + t * np.tan(q[7])
    return out


@njit(cache=True, nogil=True)
def sound(kind: int, q: Floats, reach: float) -> bool:
    """Whether a surface is one at all."""
    for k in range(8):
        if not np.isfinite(q[k]):
            return False
    if kind == 1 or kind == 2:
        return bool(0.0 < q[6] < reach)
    if kind == 3:
        return bool(abs(q[7]) < 1.55 and abs(q[6]) < reach)
    if kind == 4:
        return bool(0.0 < q[7] < reach and 0.0 <= q[6] < reach)
    return True

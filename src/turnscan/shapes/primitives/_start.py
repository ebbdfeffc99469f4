"""First guesses of the surface through a patch, from its points and normals."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, SPHERE, TORUS, frame


def first_guesses(points: Floats, normals: Floats) -> list[tuple[int, Floats]]:
    """Kinds and their ten numbers, simplest first, for a patch of points (n, 3) and normals (n, 3).

    The axis of a cylinder is the direction that all normals are across; that of a cone leaves them
    one angle; that of a torus is the rotation that moves every point across its normal (line
    complex of the normals: Pottmann and Wallner, Computational Line Geometry, 2001).
    """
    middle = points.mean(axis=0)
    X, normals = _calmed(points - middle, normals)
    out = [(PLANE, _packed(middle, normals.mean(axis=0)))]
    out += _spheres(X, middle)
    gauss = normals.T @ normals
    out += _cylinders(X, middle, np.linalg.eigh(gauss)[1][:, 0])
    spread = normals - normals.mean(axis=0)
    out += _cones(X, middle, np.linalg.eigh(spread.T @ spread)[1][:, 0])
    out += _tori(X, normals, middle)
    return out


def _calmed(X: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) and normals (n, 3) of the cubic height field through a patch.

    Normals of a noisy mesh are too rough to tell an axis from.
    """
    up = normals.mean(axis=0)
    up /= max(float(np.linalg.norm(up)), 1e-300)
    if len(X) < 30 or float((normals @ up).min()) < 0.3:
        return X, normals
    e1, e2 = frame(up)
    u, v, w = X @ e1, X @ e2, X @ up
    size = max(float(np.abs(u).max()), float(np.abs(v).max()), 1e-300)
    u, v = u / size, v / size
    uu, uv, vv = u * u, u * v, v * v
    A = np.stack([np.ones(len(u)), u, v, uu, uv, vv, uu * u, uu * v, uv * v, vv * v])
    M = A @ A.T
    c = np.linalg.solve(M + 1e-9 * np.trace(M) * np.eye(10), A @ w)
    by_u = c[1] + 2 * c[3] * u + c[4] * v + 3 * c[6] * uu + 2 * c[7] * uv + c[8] * vv
    by_v = c[2] + c[4] * u + 2 * c[5] * v + c[7] * uu + 2 * c[8] * uv + 3 * c[9] * vv
    n = up - np.outer(by_u / size, e1) - np.outer(by_v / size, e2)
    smooth = X + np.outer(c @ A - w, up)
    return smooth, n / np.sqrt(np.einsum("ij,ij->i", n, n))[:, None]


def _packed(p: Floats, axis: Floats, r: float = 0.0, s: float = 0.0) -> Floats:
    return np.concatenate([p, axis / max(float(np.linalg.norm(axis)), 1e-300), [r, s, 0.0, 0.0]])


def _circle(x: Floats, y: Floats) -> tuple[float, float, float] | None:
    """Algebraic circle through points of a plane: its centre and radius."""
    A = np.column_stack([2 * x, 2 * y, np.ones(len(x))])
    try:
        s = np.linalg.solve(A.T @ A, A.T @ (x * x + y * y))
    except np.linalg.LinAlgError:
        return None
    square = s[2] + s[0] ** 2 + s[1] ** 2
    return (float(s[0]), float(s[1]), float(np.sqrt(square))) if square > 0 else None


def _spheres(X: Floats, middle: Floats) -> list[tuple[int, Floats]]:
    A = np.column_stack([2 * X, np.ones(len(X))])
    try:
        s = np.linalg.solve(A.T @ A, A.T @ (X * X).sum(axis=1))
    except np.linalg.LinAlgError:
        return []
    square = s[3] + s[:3] @ s[:3]
    if not square > 0:
        return []
    return [(SPHERE, _packed(middle + s[:3], np.array([0.0, 0, 1]), float(np.sqrt(square))))]


def _cylinders(X: Floats, middle: Floats, axis: Floats) -> list[tuple[int, Floats]]:
    e1, e2 = frame(axis)
    found = _circle(X @ e1, X @ e2)
    if found is None:
        return []
    x, y, r = found
    return [(CYLINDER, _packed(middle + x * e1 + y * e2, axis, r))]


def _cones(X: Floats, middle: Floats, axis: Floats) -> list[tuple[int, Floats]]:
    """A cone through circles: at each height t the radius is r + t tan s."""
    e1, e2 = frame(axis)
    x, y, t = X @ e1, X @ e2, X @ axis
    # (x − u)² + (y − v)² = (r + k t)²: linear in u, v, k², r k and r² − u² − v².
    A = np.column_stack([2 * x, 2 * y, t * t, 2 * t, np.ones(len(x))])
    try:
        s = np.linalg.solve(A.T @ A, A.T @ (x * x + y * y))
    except np.linalg.LinAlgError:
        return []
    square = s[4] + s[0] ** 2 + s[1] ** 2
    if not square > 0:
        return []
    r = float(np.sqrt(square))
    foot = middle + s[0] * e1 + s[1] * e2
    return [(CONE, _packed(foot, axis, r, float(np.arctan(s[3] / r))))]


def _tori(X: Floats, normals: Floats, middle: Floats) -> list[tuple[int, Floats]]:
    size = max(float(np.abs(X).max()), 1e-300)
    (x, y, z), (a, b, c) = X.T / size, normals.T
    rows = np.stack([a, b, c, y * c - z * b, z * a - x * c, x * b - y * a])
    M = rows @ rows.T
    values, vectors = np.linalg.eigh(M[:3, :3])
    strong = values > 1e-6 * values[-1]
    pseudo = (vectors[:, strong] / values[strong]) @ vectors[:, strong].T
    turn = M[3:, 3:] - M[3:, :3] @ pseudo @ M[:3, 3:]
    axis = np.linalg.eigh(turn)[1][:, 0]
    shift = -pseudo @ M[:3, 3:] @ axis * size
    foot = np.cross(axis, shift)
    away = X - foot
    t = away @ axis
    rho = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - t * t, 0.0))
    found = _circle(rho, t)
    if found is None:
        return []
    ring, height, small = found
    return [(TORUS, _packed(middle + foot + height * axis, axis, max(ring, 0.0), small))]

"""First guesses of the surface through a patch, from its points and normals."""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _start_kernels as kernels
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, PLANE, SPHERE, TORUS, frame

_NOWHERE = np.zeros(0)


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
    size, M, right = kernels.height_sums(X, e1, e2, up)
    c = np.linalg.solve(M + 1e-9 * np.trace(M) * np.eye(kernels.TERMS), right)
    return kernels.on_heights(X, e1, e2, up, size, c)


def _packed(p: Floats, axis: Floats, r: float = 0.0, s: float = 0.0) -> Floats:
    out = np.zeros(10)
    out[:3] = p
    out[3:6] = axis / max(math.sqrt(float(axis @ axis)), 1e-300)
    out[6:8] = r, s
    return out


def _round(X: Floats, along: Floats = _NOWHERE) -> Floats | None:
    """(k,) the solution of `kernels.round_sums`, None where there is none."""
    try:
        return np.asarray(np.linalg.solve(*kernels.round_sums(X, along)))
    except np.linalg.LinAlgError:
        return None


def _circle(X: Floats) -> tuple[float, float, float] | None:
    """Algebraic circle through points (n, 2) of a plane: its centre and radius."""
    s = _round(X)
    if s is None:
        return None
    square = s[2] + s[0] ** 2 + s[1] ** 2
    return (float(s[0]), float(s[1]), math.sqrt(square)) if square > 0 else None


def _spheres(X: Floats, middle: Floats) -> list[tuple[int, Floats]]:
    s = _round(X)
    if s is None:
        return []
    square = s[3] + s[:3] @ s[:3]
    if not square > 0:
        return []
    return [(SPHERE, _packed(middle + s[:3], np.array([0.0, 0, 1]), math.sqrt(square)))]


def _cylinders(X: Floats, middle: Floats, axis: Floats) -> list[tuple[int, Floats]]:
    e1, e2 = frame(axis)
    found = _circle(X @ np.stack([e1, e2], axis=1))
    if found is None:
        return []
    x, y, r = found
    return [(CYLINDER, _packed(middle + x * e1 + y * e2, axis, r))]


def _cones(X: Floats, middle: Floats, axis: Floats) -> list[tuple[int, Floats]]:
    """A cone through circles: at each height t the radius is r + t tan s."""
    e1, e2 = frame(axis)
    # (x − u)² + (y − v)² = (r + k t)²: linear in u, v, k², r k and r² − u² − v².
    s = _round(X @ np.stack([e1, e2], axis=1), X @ axis)
    if s is None:
        return []
    square = s[4] + s[0] ** 2 + s[1] ** 2
    if not square > 0:
        return []
    r = math.sqrt(square)
    foot = middle + s[0] * e1 + s[1] * e2
    return [(CONE, _packed(foot, axis, r, math.atan(s[3] / r)))]


def _tori(X: Floats, normals: Floats, middle: Floats) -> list[tuple[int, Floats]]:
    size = max(float(np.abs(X).max()), 1e-300)
    M = kernels.complex_sums(X, normals, size)
    values, vectors = np.linalg.eigh(M[:3, :3])
    strong = values > 1e-6 * values[-1]
    pseudo = (vectors[:, strong] / values[strong]) @ vectors[:, strong].T
    turn = M[3:, 3:] - M[3:, :3] @ pseudo @ M[:3, 3:]
    axis = np.linalg.eigh(turn)[1][:, 0]
    shift = -pseudo @ M[:3, 3:] @ axis * size
    foot = np.array(
        [
            axis[1] * shift[2] - axis[2] * shift[1],
            axis[2] * shift[0] - axis[0] * shift[2],
            axis[0] * shift[1] - axis[1] * shift[0],
        ]
    )
    away = X - foot
    t = away @ axis
    rho = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - t * t, 0.0))
    found = _circle(np.stack([rho, t], axis=1))
    if found is None:
        return []
    ring, height, small = found
    return [(TORUS, _packed(middle + foot + height * axis, axis, max(ring, 0.0), small))]

"""Planes, spheres, circles and cylinders (`_forms`) through points, by least squares.

Where an ``area`` in mm² is given the points are those of a surface, and cover it: neighbours that
are off together count as fewer then (`shared_noise`), else each as off by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import DidNotConverge, InputError
from turnscan.shapes._cells import shared_noise
from turnscan.shapes._forms import Circle, Cylinder, Plane, Sphere

_Shape = TypeVar("_Shape", Plane, Sphere, Cylinder)
_ROUNDS = 100
_TINY = 1e-12
"""mm that a point is from a centre at the least, so that it has a direction from there."""
_OPEN = 1e13
"""Condition number of normal equations, all scales taken out, above which they say nothing."""
_STARTS = 24
"""Axis directions tried for a cylinder, spread over the half sphere."""


def _checked(points: npt.ArrayLike, least: int, what: str) -> Floats:
    X = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    if len(X) < least or not np.isfinite(X).all():
        raise InputError(
            f"{what}: {len(X)} points, expected at least {least} finite ones",
            hint="choose a larger region",
        )
    return X


def _weights(sigma: npt.ArrayLike | None, count: int) -> Floats:
    if sigma is None:
        return np.ones(count)
    s = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (count,))
    bad = ~((s > 0) & np.isfinite(s))
    if bad.any():
        raise InputError(
            f"sigma {float(s[bad][0])} mm", hint="give positive standard uncertainties"
        )
    return np.asarray(1.0 / (s * s))


def _variance(residual: Floats, w: Floats, free: int, known: bool) -> float:
    """Variance of unit weight: from the residuals, not below 1 where sigma was given."""
    measured = float((w * residual**2).sum()) / max(len(residual) - free, 1)
    return max(measured, 1.0) if known else measured


def _shared(shape: _Shape, X: Floats, w: Floats, area: float | None) -> _Shape:
    """A shape fitted to points X (n, 3), its covariance with what these share."""
    if area is None:
        return shape
    times = shared_noise(X, shape.distances(X) * np.sqrt(w), area)
    return replace(shape, covariance=shape.covariance * times)


def fit_plane(
    points: npt.ArrayLike, sigma: npt.ArrayLike | None = None, area: float | None = None
) -> Plane:
    """Least-squares plane through points (n, 3) mm, n ≥ 3, weighted by 1/sigma² where given.

    Orthogonal distances (principal axes of the points). The covariance follows from the scatter
    of the residuals, or from ``sigma`` (n,) mm where that is larger. Raises InputError for too few
    points or points on one line.
    """
    X = _checked(points, 3, "plane")
    w = _weights(sigma, len(X))
    centre = w @ X / w.sum()
    d = X - centre
    moments, axes = np.linalg.eigh((d * w[:, None]).T @ d)
    if not moments[1] > 1e-12 * max(moments[2], 1e-300):
        raise InputError("plane: the points lie on one line", hint="choose a wider region")
    normal = axes[:, 0]
    normal = normal if normal[np.argmax(np.abs(normal))] > 0 else -normal
    residual = d @ normal
    unit = _variance(residual, w, 3, sigma is not None)
    covariance = np.diag(unit / np.array([moments[2], moments[1], w.sum()]))
    rms = float(np.sqrt(np.mean(residual**2)))
    plane = Plane(normal, float(normal @ centre), centre, rms, covariance, len(X))
    return _shared(plane, X, w, area)


def fit_sphere(
    points: npt.ArrayLike, sigma: npt.ArrayLike | None = None, area: float | None = None
) -> Sphere:
    """Least-squares sphere (orthogonal distances) through points (n, 3) mm, n ≥ 4.

    Starts at the algebraic solution. Raises InputError for too few points or points in a plane,
    DidNotConverge where the adjustment does not settle.
    """
    X = _checked(points, 4, "sphere")
    w = _weights(sigma, len(X))
    middle = X.mean(axis=0)
    d = X - middle
    A = np.column_stack([2 * d, np.ones(len(d))])
    solution, _, rank, _ = np.linalg.lstsq(A, (d * d).sum(axis=1), rcond=1e-10)
    if rank < 4:
        raise InputError("sphere: the points lie in one plane", hint="choose a wider region")
    start = np.append(solution[:3], np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 1e-12)))

    def model(p: Floats) -> tuple[Floats, Floats]:
        away = d - p[:3]
        r = np.maximum(np.linalg.norm(away, axis=1), _TINY)
        return r - p[3], np.column_stack([-away / r[:, None], -np.ones(len(r))])

    p, residual, N = _settle(model, start, w, "sphere")
    covariance = _inverse(N, "sphere") * _variance(residual, w, 4, sigma is not None)
    rms = float(np.sqrt(np.mean(residual**2)))
    return _shared(Sphere(middle + p[:3], float(p[3]), rms, covariance, len(X)), X, w, area)


def fit_circle(
    points: npt.ArrayLike, normal: npt.ArrayLike, sigma: npt.ArrayLike | None = None
) -> Circle:
    """Least-squares circle (orthogonal distances) through points (n, 3) mm, n ≥ 3, of a section.

    ``normal`` (3,) is that of the plane they lie in. Raises InputError for too few points or
    points on one line, DidNotConverge where the adjustment does not settle.
    """
    X = _checked(points, 3, "circle")
    w = _weights(sigma, len(X))
    n = np.asarray(normal, dtype=np.float64)
    if not (np.isfinite(n).all() and np.linalg.norm(n) > 0):
        raise InputError(f"circle: normal {n.tolist()}", hint="give a direction")
    n = n / np.linalg.norm(n)
    e1, e2 = _across(n)
    middle = X.mean(axis=0)
    d = np.stack([(X - middle) @ e1, (X - middle) @ e2], axis=-1)
    if not np.linalg.svd(d, compute_uv=False)[1] > 1e-9 * np.abs(d).max():
        raise InputError("circle: the points lie on one line", hint="choose another section")
    foot, radius, _ = _circle(X - middle, n)

    def model(p: Floats) -> tuple[Floats, Floats]:
        away = d - p[:2]
        r = np.maximum(np.linalg.norm(away, axis=1), _TINY)
        return r - p[2], np.column_stack([-away / r[:, None], -np.ones(len(r))])

    p, residual, N = _settle(model, np.array([foot @ e1, foot @ e2, radius]), w, "circle")
    covariance = _inverse(N, "circle") * _variance(residual, w, 3, sigma is not None)
    rms = float(np.sqrt(np.mean(residual**2)))
    centre = middle + p[0] * e1 + p[1] * e2
    return Circle(centre, n, float(p[2]), rms, covariance, len(X))


def fit_cylinder(
    points: npt.ArrayLike,
    sigma: npt.ArrayLike | None = None,
    area: float | None = None,
    axis: npt.ArrayLike | None = None,
) -> Cylinder:
    """Least-squares cylinder (orthogonal distances) through points (n, 3) mm, n ≥ 6.

    ``axis`` (3,) is a first guess of the direction; without one, directions all round are tried
    and the best fit is kept. Raises InputError for too few points or points in a plane, such as
    one ring, DidNotConverge where no start settles.
    """
    X = _checked(points, 6, "cylinder")
    w = _weights(sigma, len(X))
    middle = X.mean(axis=0)
    d = X - middle
    spread = np.linalg.svd(d, compute_uv=False)
    if not spread[2] > 1e-9 * spread[0]:
        raise InputError(
            "cylinder: the points lie in one plane, which leaves its axis undetermined",
            hint="choose a region that is longer, or measure a circle in a section",
        )
    starts = _directions(_STARTS) if axis is None else np.atleast_2d(np.asarray(axis, float))
    best: Cylinder | None = None
    for direction in sorted(starts, key=lambda a: _circle(d, a / np.linalg.norm(a))[2])[:3]:
        try:
            found = _cylinder_from(d, w, direction / np.linalg.norm(direction), sigma is not None)
        except DidNotConverge:
            continue
        if best is None or found.rms < best.rms:
            best = found
    if best is None:
        raise DidNotConverge("cylinder: no fit converged", hint="choose a region that is rounder")
    return _shared(replace(best, point=best.point + middle), X, w, area)


def _cylinder_from(d: Floats, w: Floats, axis: Floats, known: bool) -> Cylinder:
    """Gauss-Newton on tilt, shift and radius, about an axis that is re-set in every round."""
    a = axis
    foot, radius, _ = _circle(d, a)
    for _ in range(_ROUNDS):
        e1, e2 = _across(a)
        away = d - foot
        away = away - np.outer(away @ a, a)
        r = np.maximum(np.linalg.norm(away, axis=1), _TINY)
        out = away / r[:, None]
        residual = r - radius
        along = (d - foot) @ a
        o1, o2 = out @ e1, out @ e2
        J = np.column_stack([-along * o1, -along * o2, -o1, -o2, -np.ones(len(r))])
        N = (J * w[:, None]).T @ J
        step = _solve(N, J.T @ (w * -residual), "cylinder")
        a = a + step[0] * e1 + step[1] * e2
        a /= np.linalg.norm(a)
        foot = foot + step[2] * e1 + step[3] * e2
        foot = foot - (foot @ a) * a
        radius += float(step[4])
        if np.abs(step).max() < 1e-12 * max(1.0, abs(radius)):
            break
    else:
        if np.abs(step).max() > 1e-6 * max(1.0, abs(radius)):
            raise DidNotConverge("cylinder: the fit does not converge")
    if not radius > 0:
        raise DidNotConverge("cylinder: the fit diverged")
    a = a if a[2] >= 0 else -a
    covariance = _inverse(N, "cylinder") * _variance(residual, w, 5, known)
    rms = float(np.sqrt(np.mean(residual**2)))
    return Cylinder(foot, a, radius, rms, covariance, len(d))


def _circle(d: Floats, a: Floats) -> tuple[Floats, float, float]:
    """Algebraic circle of the points seen along ``a``: its centre, radius and rms."""
    e1, e2 = _across(a)
    x, y = d @ e1, d @ e2
    A = np.column_stack([2 * x, 2 * y, np.ones(len(x))])
    s = np.linalg.lstsq(A, x * x + y * y, rcond=1e-12)[0]
    radius = float(np.sqrt(max(s[2] + s[0] ** 2 + s[1] ** 2, 1e-12)))
    residual = np.hypot(x - s[0], y - s[1]) - radius
    return s[0] * e1 + s[1] * e2, radius, float(np.sqrt(np.mean(residual**2)))


def _across(a: Floats) -> tuple[Floats, Floats]:
    lead = np.eye(3)[int(np.argmin(np.abs(a)))]
    e1 = np.cross(a, lead)
    e1 /= np.linalg.norm(e1)
    return e1, np.cross(a, e1)


def _directions(count: int) -> Floats:
    """Directions spread evenly over the half sphere z ≥ 0 (Fibonacci lattice), and z itself."""
    i = np.arange(count)
    z = (i + 0.5) / count
    turn = np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z * z)
    return np.vstack([np.column_stack([r * np.cos(turn), r * np.sin(turn), z]), np.eye(3)])


def _solve(N: Floats, b: Floats, what: str) -> Floats:
    """N⁻¹ b of normal equations. Raises DidNotConverge where a direction is undetermined."""
    scale = np.sqrt(np.maximum(np.diagonal(N), 1e-300))
    even = N / np.outer(scale, scale)
    if not np.isfinite(even).all() or not np.linalg.cond(even) < _OPEN:
        raise DidNotConverge(
            f"{what}: the points leave a direction undetermined",
            hint="choose a larger, rounder region",
        )
    x = np.linalg.solve(even, (b.T / scale).T)
    return np.asarray((x.T / scale).T, dtype=np.float64)


def _inverse(N: Floats, what: str) -> Floats:
    return _solve(N, np.eye(len(N)), what)


def _settle(
    model: Callable[[Floats], tuple[Floats, Floats]], p: Floats, w: Floats, what: str
) -> tuple[Floats, Floats, Floats]:
    """Gauss-Newton: parameters, residuals and normal matrix where the step vanishes."""
    for _ in range(_ROUNDS):
        residual, J = model(p)
        N = (J * w[:, None]).T @ J
        step = _solve(N, J.T @ (w * -residual), what)
        p = p + step
        if np.abs(step).max() < 1e-12 * max(1.0, float(np.abs(p).max())):
            return p, residual, N
    if np.abs(step).max() < 1e-7 * max(1.0, float(np.abs(p).max())):
        return p, residual, N
    raise DidNotConverge(f"{what}: the fit does not converge", hint="choose a rounder region")

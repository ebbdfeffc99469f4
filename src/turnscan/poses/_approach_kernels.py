"""Compiled kernel: how a trial comes near, one view moved onto another by a few hundred samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.poses._link_kernels import Surface, met, sums
from turnscan.poses._near_kernels import Cubes, nearest


class Course(NamedTuple):
    """How a trial is to proceed; the words are those of `refine`."""

    rounds: int
    begin: float
    """mm: length of the first links."""
    last: float
    """mm: of the last ones."""
    shrink: float
    """How much shorter they get from round to round."""
    still: float
    """mm that a round may still move it by when it is done, or …"""
    noise: float
    """… usual sigmas."""
    tukey: float
    """Robust sigma beyond which an offset says nothing."""
    ridge: float
    """Information that every motion has, in parts of that of the motion itself."""
    alike: float
    """Least cosine between the normals of a link."""
    spacing: float
    """mm, of the points of the other view."""


@njit(cache=True, nogil=True)
def _solved(H: Floats, g: Floats) -> Floats:
    """(6,) x of H x = g by Cholesky's factors, H (6, 6) positive; zero where it is not."""
    n = len(g)
    L, x = np.zeros((n, n)), np.zeros(n)
    for a in range(n):
        for b in range(a + 1):
            rest = H[a, b]
            for c in range(b):
                rest -= L[a, c] * L[b, c]
            if a != b:
                L[a, b] = rest / L[b, b]
            elif rest > 0.0:
                L[a, a] = np.sqrt(rest)
            else:
                return x
    y = np.zeros(n)
    for a in range(n):
        rest = g[a]
        for c in range(a):
            rest -= L[a, c] * y[c]
        y[a] = rest / L[a, a]
    for a in range(n - 1, -1, -1):
        rest = y[a]
        for c in range(a + 1, n):
            rest -= L[c, a] * x[c]
        x[a] = rest / L[a, a]
    return x


@njit(cache=True, nogil=True)
def _turn(r: Floats) -> Floats:
    """(3, 3) rotation by the vector r, direction × radians (Rodrigues)."""
    angle = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    R = np.eye(3)
    if angle < 1e-300:
        return R
    w = r / angle
    s, c = np.sin(angle), 1.0 - np.cos(angle)
    for a in range(3):
        b, d = (a + 1) % 3, (a + 2) % 3
        R[a, a] -= c * (w[b] * w[b] + w[d] * w[d])
        R[a, b] += c * w[a] * w[b] - s * w[d]
        R[b, a] += c * w[a] * w[b] + s * w[d]
    return R


@njit(cache=True, nogil=True)
def _product(A: Floats, B: Floats) -> Floats:
    """A B of matrices (3, 3)."""
    out = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            for c in range(3):
                out[a, b] += A[a, c] * B[c, b]
    return out


@njit(cache=True, nogil=True)
def _moved(R: Floats, t: Floats, step: Floats, middle: Floats) -> tuple[Floats, Floats]:
    """A pose after a turn about ``middle`` and a shift; its rotation stays one after many rounds.

    A product of rotations is off by its rounding alone, so one step of Newton's towards the
    nearest rotation, (3 R - R Rᵀ R) / 2, is enough.
    """
    turn = _turn(step[:3])
    turned = _product(turn, R)
    turned = 1.5 * turned - 0.5 * _product(_product(turned, turned.T), turned)
    shifted = np.empty(3)
    for a in range(3):
        shifted[a] = middle[a] + step[3 + a]
        for b in range(3):
            shifted[a] += turn[a, b] * (t[b] - middle[b])
    return turned, shifted


@njit(cache=True, nogil=True)
def _between(
    p: Floats, q: Floats, n: Floats, m: Floats, sigma: Floats
) -> tuple[Floats, Floats, float]:
    """Normals (k, 3) and offsets (k,) of links as in `Links`, and the robust scatter of these."""
    normals, offsets, ratio = n + m, np.zeros(len(p)), np.empty(len(p))
    for k in range(len(p)):
        length = np.sqrt(normals[k, 0] ** 2 + normals[k, 1] ** 2 + normals[k, 2] ** 2)
        for a in range(3):
            normals[k, a] /= length
            offsets[k] += normals[k, a] * (p[k, a] - q[k, a])
        ratio[k] = abs(offsets[k] / sigma[k])
    return normals, offsets, max(1.0, 1.4826 * np.median(ratio))


@njit(cache=True, nogil=True)
def _step(
    links: tuple[Floats, Floats, Floats, Floats, Floats], middle: Floats, course: Course
) -> tuple[Floats, float]:
    """(6,) the step that least squares of the links ask for, and how far it moves the view (mm)."""
    p, q, n, m, sigma = links
    normals, offsets, scale = _between(p, q, n, m, sigma)
    middles = np.empty((2, 3))
    middles[:] = middle
    s = sums(p, q, normals, offsets, sigma, (scale, course.tukey), middles)
    H = s.H[:6, :6] + course.ridge * s.mine
    most = 1.0
    for a in range(6):
        most = max(most, H[a, a])
    for a in range(6):
        H[a, a] += 1e-12 * most
    step = _solved(H, s.g[:6])
    square = 0.0
    for a in range(6):
        for b in range(6):
            square += step[a] * s.mine[a, b] * step[b]
    weight = s.mine[3, 3] + s.mine[4, 4] + s.mine[5, 5] + 1e-300
    return step, np.sqrt(max(square / weight, 0.0))


@njit(cache=True, nogil=True)
def approach(
    mine: Surface, other: Surface, cubes: Cubes, samples: Ints, middle: Floats, course: Course
) -> tuple[Floats, Floats]:
    """The pose (rotation, translation) that brings a view onto another one, which stays.

    The same rounds as those of `refine`, of two views, compiled as a whole: of a few hundred
    samples the sums take less time than what passes them on. ``other`` lies in its own frame,
    ``cubes`` are its points; ``middle`` (3,) mm is the mean of the view's own.
    """
    R, t, limit = mine.rotation.copy(), mine.translation.copy(), course.begin
    there, centre = np.empty((len(samples), 3)), np.empty(3)
    for _ in range(course.rounds):
        now = Surface(mine.points, mine.normals, mine.sigma, mine.inner, R, t)
        for a in range(3):
            centre[a] = t[a] + R[a, 0] * middle[0] + R[a, 1] * middle[1] + R[a, 2] * middle[2]
            for k in range(len(samples)):
                x = mine.points[samples[k]]
                there[k, a] = t[a] + R[a, 0] * x[0] + R[a, 1] * x[1] + R[a, 2] * x[2]
        away, at = nearest(cubes, there, limit)
        limits = (course.alike, max(2 * course.spacing, limit / 2) ** 2)
        _, p, q, n, m, sigma = met(now, other, samples, away, at, limits)
        if len(p) == 0:
            break
        step, largest = _step((p, q, n, m, sigma), centre, course)
        R, t = _moved(R, t, step, centre)
        done = largest < max(course.still, course.noise * np.median(sigma))
        if limit <= course.last and done:
            break
        limit = max(course.last, course.shrink * limit)
    return R, t

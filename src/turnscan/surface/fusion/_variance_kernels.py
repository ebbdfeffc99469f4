"""Compiled: where a place on a face lies and how well it is known; for voxels and cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit

_BENT = float(np.deg2rad(45.0))
"""Turn from a vertex to its neighbour beyond which there is an edge between them."""


class Vertices(NamedTuple):
    """What a merge knows of the vertices of one range surface."""

    points: Floats
    """(v, 3) mm."""
    sigma: Floats
    """(v,) mm."""
    step: Ints
    """(v,) the profile of each, in any numbers."""
    noise: Floats
    """(v,) mm: what of sigma noise makes. What goes beyond are edges, creases and chords, which
    move neighbours, and all surfaces, alike."""
    bend: Floats
    """(v,) 1/mm: how the surface bends from profile to profile, positive where it bulges."""
    alike: float
    """Correlation of that noise along a profile, from 0 to 1."""


@njit(cache=True, nogil=True)
def variances(
    face: Ints, u: float, v: float, vertices: Vertices, between: float
) -> tuple[float, float, float, float]:
    """Variances, mm², of a place on a face, ``u`` and ``v`` its barycentric coordinates for the
    second and the third vertex: of its vertices' noise, which averages out; of all that is known
    of them; the same as if each erred by itself, which is what a place is weighed by; and, to be
    added, what the surface may do ``between`` mm the two profiles that the face spans, none of
    it on them and all half-way.
    """
    a, b, c = face
    w = 1.0 - u - v
    noise, common, single = 0.0, 0.0, 0.0
    for share, k in ((w, a), (u, b), (v, c)):
        whole = vertices.sigma[k] * vertices.sigma[k]
        part = min(whole, vertices.noise[k] * vertices.noise[k])
        noise += share * share * part
        common += share * np.sqrt(whole - part)
        single += share * share * whole
    if vertices.alike > 0.0:
        noise += vertices.alike * _along(face, (w, u, v), vertices)
    step = vertices.step
    part = w + (u if step[b] == step[a] else 0.0) + (v if step[c] == step[a] else 0.0)
    part = min(max(part, 0.0), 1.0)
    gap = 4.0 * part * (1.0 - part) * between
    return noise, noise + common * common, single, gap * gap


@njit(cache=True, nogil=True)
def _along(face: Ints, shares: tuple[float, float, float], vertices: Vertices) -> float:
    """mm²: what the noise of vertices of a face adds to that of a place where those on one profile
    err alike."""
    out = 0.0
    for i in range(3):
        j = (i + 1) % 3
        a, b = face[i], face[j]
        if vertices.step[a] == vertices.step[b]:
            noise = min(vertices.sigma[a], vertices.noise[a])
            noise *= min(vertices.sigma[b], vertices.noise[b])
            out += 2.0 * shares[i] * shares[j] * noise
    return out


@njit(cache=True, nogil=True)
def rise(points: Floats, bend: Floats, step: Ints, a: int, b: int) -> float:
    """mm: four times the height of a surface over the middle of the chord from a to b.

    As it bends at both ends (a circle's, to the second order); none along one profile, whose points
    lie close, nor where it turns by more than 45° on the way, for that is an edge.
    """
    if step[a] == step[b]:
        return 0.0
    mean, square = (bend[a] + bend[b]) / 2.0, 0.0
    for i in range(3):
        square += (points[b, i] - points[a, i]) ** 2
    return mean * square / 2.0 if abs(mean) * np.sqrt(square) < _BENT else 0.0


@njit(cache=True, nogil=True)
def rises(points: Floats, bend: Floats, step: Ints, other: Ints) -> Floats:
    """(v,) mm: `rise` between each vertex and the ``other`` (v,) one; 0 where that is −1."""
    out = np.zeros(len(points))
    for a in range(len(points)):
        if other[a] >= 0:
            out[a] = rise(points, bend, step, a, other[a])
    return out

"""Compiled: how well a place on a face is known; shared by the merges in voxels and in cells."""

from __future__ import annotations

from typing import NamedTuple

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit


class Vertices(NamedTuple):
    """What a merge knows of the vertices of one range surface."""

    points: Floats
    """(v, 3) mm."""
    sigma: Floats
    """(v,) mm."""
    between: Floats
    """(v,) mm: how far the surface may lie off its chords to the neighbouring profiles."""
    step: Ints
    """(v,) the profile of each, in any numbers."""


@njit(cache=True, nogil=True)
def variances(
    face: Ints, u: float, v: float, sigma: Floats, between: Floats, step: Ints
) -> tuple[float, float]:
    """Variances, mm², of a place on a face, ``u`` and ``v`` its barycentric coordinates for the
    second and the third vertex: of the vertices' noise alone, and with what the surface may do
    ``between`` the two profiles that the face spans, none of it on them and all half-way.
    """
    a, b, c = face
    w = 1.0 - u - v
    own = (w * sigma[a]) ** 2 + (u * sigma[b]) ** 2 + (v * sigma[c]) ** 2
    part = w + (u if step[b] == step[a] else 0.0) + (v if step[c] == step[a] else 0.0)
    part = min(max(part, 0.0), 1.0)
    gap = 4.0 * part * (1.0 - part) * max(between[a], between[b], between[c])
    return own, own + gap * gap

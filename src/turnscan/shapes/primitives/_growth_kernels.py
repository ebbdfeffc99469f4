"""Compiled kernels of a region's growth: a surface and the vertices on it, in turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Longs
from turnscan.compiled import njit
from turnscan.shapes.primitives._fit_kernels import refitted
from turnscan.shapes.primitives._region_kernels import Marks, Neighbourhood, Surface, grown
from turnscan.shapes.primitives._surface_kernels import at, lean, some_of

_LOOKED_AT = 200
"""Members that the side of a surface is asked of."""


class Growth(NamedTuple):
    """How a region grows, and what its fits take of the vertices."""

    scale: Floats
    """(v,) mm: one standard deviation of each."""
    off: Floats
    """(v,) mm: how far each stands off the mean of its neighbours."""
    reach: float
    """mm: no radius passes it."""
    points: int
    """That a fit looks at."""
    steps: int
    """Of a fit."""
    rounds: int
    """Of growth at the most."""
    times: int
    """Each round at most so many times as large as the one before."""
    hopeless: float
    """Misfit beyond which the region is given up."""


@njit(cache=True, nogil=True)
def outward(kind: int, q: Floats, vertices: Floats, normals: Floats, member: Longs) -> float:
    """+1 where the surface's normals look outward over members, −1 where inward."""
    c, s = lean(kind, q)
    total = 0.0
    for i in some_of(member, _LOOKED_AT):
        _, n0, n1, n2, _, _ = at(kind, q, c, s, vertices[i, 0], vertices[i, 1], vertices[i, 2])
        total += n0 * normals[i, 0] + n1 * normals[i, 1] + n2 * normals[i, 2]
    return 1.0 if total >= 0.0 else -1.0


@njit(cache=True, nogil=True)
def spread_out(
    surface: Surface, ground: Neighbourhood, marks: Marks, ball: Longs, cos_turn: float, how: Growth
) -> tuple[Floats, Longs, int]:
    """The surface (10,) and the vertices that a patch grows to, none where that is hopeless; and
    how many there were when it was given up, −1 where it was not or the fit failed.

    Takes the marks from ``marks.mark`` on, one for each round.
    """
    kind, q, side = surface.kind, surface.q, surface.side
    member, none = ball, ball[:0].copy()
    for turn in range(how.rounds):
        now = Marks(marks.label, marks.seen, marks.mark + turn)
        most = how.times * len(member)
        larger = grown(Surface(kind, q, side), ground, now, member, cos_turn, most)
        if len(larger) < 0.6 * len(ball):
            return q, none, 0
        enough = len(larger) <= 1.01 * len(member) and turn > 1
        member = larger
        some = some_of(member, how.points)
        q, cost, misfit = refitted(
            kind, q, ground.vertices, how.scale, ground.limit, how.off, some, how.reach, how.steps
        )
        if not np.isfinite(cost):
            return q, none, -1
        if enough:
            break
        if len(member) > len(ball) and misfit > how.hopeless:
            return q, none, len(member)
    return q, member, -1

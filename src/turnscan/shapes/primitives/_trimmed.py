"""A region without what it took of surfaces that it runs into without an edge."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import Ground, Index
from turnscan.shapes.primitives._judged import enough, fair, pattern
from turnscan.shapes.primitives._region import Region, refit, side_of
from turnscan.shapes.primitives._surface_kernels import CYLINDER, PLANE

_TANGENT, _TRIMS, _LEVEL = (PLANE, CYLINDER), 8, 0.2
"""Kinds that others are tangent to; how often what such others have is taken off at most; and the
share of the limit that a point and those about it may stand off on average."""
_INNER, _LEFT, _FLAT = 0.4, 0.6, 0.08
"""Shares of a region that must be left while that goes on, and of it in one piece at the end: a
freeform wall has 0.2 to 0.5; and the pattern that it may have."""


def trimmed(
    g: Ground, kind: int, q: Floats, member: Index, least: float, place: Index
) -> Region | None:
    """A region without what it took of surfaces that it runs into without an edge, such as the
    fillets beside a wall; None where that is no shape.

    What stands off the surface together with those about it does not count, until nothing else
    does. Of freeform surface less than half is left then, for the width within which it bends
    by some part of the limit goes with the root of that part. ``least`` mm² must be left; ``place``
    (v,) is room for the kernels.
    """
    if kind not in _TANGENT:
        return None
    inner, kept = member, member[:0]
    for _ in range(_TRIMS):
        d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
        level = region.levelled(member, d, g.start, g.near, 2, place)
        inner = member[np.abs(level) <= _LEVEL]
        if len(inner) < _INNER * len(member):
            return None
        q, cost = refit(g, kind, q, inner)
        if not np.isfinite(cost):
            return None
        if len(inner) == len(kept):
            break
        kept = inner
    inner = region.largest_piece(inner, g.start, g.near, place)
    if len(inner) < _LEFT * len(member) or not enough(g, kind, q, inner, least):
        return None
    if not fair(g, kind, q, inner) or pattern(g, kind, q, inner) > _FLAT:
        return None
    return Region(kind, q, side_of(g, kind, q, inner), inner)

"""Vertices of a mesh on one surface, and the surface through them."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _fit_kernels as fit
from turnscan.shapes.primitives import _growth_kernels as growth
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import Ground, Index
from turnscan.shapes.primitives._surface_kernels import CONE, CYLINDER, FREE, PLANE, SPHERE, TORUS

SIMPLEST = (PLANE, CYLINDER, CONE, SPHERE, TORUS)
STEPS = 6
"""Of a fit while a region grows."""
FIT = 4000
"""Points that a fit looks at."""


@dataclass
class Region:
    """Vertices on one surface, while regions are looked for."""

    kind: int
    q: Floats
    side: float
    """+1 where the surface's normal looks outward."""
    member: Index

    def rank(self) -> int:
        """The simplest kind first. A sphere comes after a cone, although it has fewer parameters: a
        narrow ring, such as a chamfer, lies on both, and its curvature across is not seen."""
        return SIMPLEST.index(self.kind)


def side_of(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """+1 where the surface's normals look outward over members, −1 where inward."""
    return growth.outward(kind, q, g.vertices, g.normals, member)


def refit(
    g: Ground, kind: int, q: Floats, member: Index, most: int = FIT, steps: int = STEPS
) -> tuple[Floats, float]:
    """The surface through members again, and its cost per point."""
    some = surface.some_of(member, most)
    q = surface.slid(kind, q, g.vertices, some)
    q, cost = fit.fitted(
        kind, q, g.vertices, g.scale, some, FREE[kind], fit.BOUND, 4 * g.size, steps
    )
    return q, cost / len(some)

"""How well a volume is known that faces of shapes bound."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.mesh import vector_areas
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._shapes import KINDS, ShapeSet


def volume_slopes(found: ShapeSet, triangles: Floats, shape: Ints) -> Floats:
    """(7 n,) ∂V/∂parameter of the shapes' parameters, mm³ over mm or rad.

    ``triangles`` (m, 3, 3) mm lie on the faces of a solid, outward, and ``shape`` (m,) is which
    shape each is of, −1 for none. A face that moves by δ along its normal adds ∫ δ dA: its area
    times its shift, and its first moments times its tilt. Where faces meet, their edge moves
    along them, which is of second order.
    """
    t = triangles
    middle, area = t.mean(axis=1), vector_areas(t)
    slopes = np.zeros((len(found.shapes), 7))
    for k, s in enumerate(found.shapes):
        own, kind = shape == k, KINDS.index(s.kind)
        X = np.ascontiguousarray(middle[own])
        normal = surface.distances(kind, s.numbers, X)[1]
        J = surface.jacobian(kind, s.numbers, X)[1] * surface.FREE[kind]
        # The distance of a point grows where the surface goes back.
        slopes[k] = -np.einsum("mi,mi,mp->p", normal, area[own], J)
    return slopes.ravel()


def shapes_volume_sigma(found: ShapeSet, triangles: Floats, shape: Ints) -> float:
    """mm³: standard uncertainty of a volume by that of the shapes that bound it, as `volume_slopes`
    takes them: their joint covariance, and so what the calibration does to all of them at once."""
    g = volume_slopes(found, triangles, shape)
    return float(np.sqrt(max(float(g @ found.covariance @ g), 0.0)))

"""First guesses of the surface through a patch, from its points and normals."""

from __future__ import annotations

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _start_kernels as kernels


def first_guesses(points: Floats, normals: Floats) -> list[tuple[int, Floats]]:
    """Kinds and their ten numbers, simplest first, for a patch of points (n, 3) and normals (n, 3).

    The axis of a cylinder is the direction that all normals are across; that of a cone leaves them
    one angle; that of a torus is the rotation that moves every point across its normal (line
    complex of the normals: Pottmann and Wallner, Computational Line Geometry, 2001). A kind that
    does not go through the patch is left out.
    """
    numbers, fine = kernels.guesses(points, normals)
    return [(kind, q) for kind, (q, known) in enumerate(zip(numbers, fine, strict=True)) if known]

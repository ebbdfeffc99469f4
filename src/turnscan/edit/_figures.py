"""Figures of a surface under edit, taken after every edit."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.edit import _figure_kernels as kernels
from turnscan.edit._body import Body

Corner = tuple[float, float, float]


@dataclass(frozen=True)
class Figures:
    """What the living surface of a body is like."""

    vertices: int
    """Those that faces use."""
    faces: int
    bounds: tuple[Corner, Corner] | None
    """Lowest and highest corner, mm; None where there is no face."""
    closed: bool
    volume: float | None
    """mm³; None where the surface is open."""


def figures(body: Body) -> Figures:
    """What the living surface is like, in one pass over its faces."""
    mesh = body.mesh
    faces, corners, volume, low, high, closed = kernels.figures(
        mesh.vertices, mesh.faces, body.alive
    )
    (a, b, c), (d, e, f) = low.tolist(), high.tolist()
    return Figures(
        vertices=corners,
        faces=faces,
        bounds=((a, b, c), (d, e, f)) if faces else None,
        closed=closed,
        volume=volume if closed else None,
    )

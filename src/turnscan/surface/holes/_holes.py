"""Hole: a border of the mesh as a value, with its measures and, once it is known, its cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from turnscan.arrays import Floats, Ints, frozen
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._topology import boundary_loops

Cause = Literal[
    "laser",
    "camera",
    "grazing",
    "dark",
    "saturated",
    "outside",
    "ambiguous",
    "removed",
    "unknown",
    "deleted",
]
"""Why nothing was measured where a hole is."""

CAUSE_WORDS: Final[dict[Cause, str]] = {
    "laser": "hidden from the laser",
    "camera": "hidden from the camera",
    "grazing": "lit or seen at a grazing angle",
    "dark": "too dark",
    "saturated": "too bright",
    "outside": "outside the picture or the working volume",
    "ambiguous": "several candidates, none of them reliable",
    "removed": "removed by the clean-up",
    "unknown": "not known",
    "deleted": "deleted by hand",
}
"""Every cause in words for people."""


@dataclass(frozen=True)
class Hole:
    """A border of a mesh: a place where its surface ends."""

    loop: Ints
    """(m,) vertex numbers along the border, in the winding of the faces that it bounds; the last
    one is followed by the first."""
    perimeter: float
    """mm."""
    area: float
    """mm² that the border encloses, seen in the plane in which that is most (a flat fill)."""
    size: float
    """mm: the largest distance between two corners."""
    centre: Floats
    """(3,) mm: the mean of the border, by length."""
    cause: Cause | None = None
    """Why nothing was measured there; None where not determined."""
    also: Cause | None = None
    """The second cause, of a hole that lacks the face on which the part stands and one in its
    shadow, each at least a third of it as far as is known; None for others."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "loop", frozen(self.loop, (None,), "Hole.loop", np.int32))
        put(self, "centre", frozen(self.centre, (3,), "Hole.centre"))

    @property
    def reason(self) -> str:
        """Its cause in words for people, with the second one."""
        first = CAUSE_WORDS[self.cause or "unknown"]
        return first if self.also is None else f"{first}; in part {CAUSE_WORDS[self.also]}"


def holes(mesh: Mesh) -> list[Hole]:
    """The borders of a mesh, that of the longest perimeter first; their causes are not known yet.

    Where two parts of the surface touch in a vertex, a border turns off along the part that it
    came by.
    """
    found = [measure(mesh, loop) for loop in boundary_loops(mesh)]
    return sorted(found, key=lambda h: (-h.perimeter, int(h.loop.min())))


def measure(mesh: Mesh, loop: Ints) -> Hole:
    """The hole within one border (m,) of a mesh."""
    from turnscan.mesh import _topology_kernels as kernels

    corners = mesh.vertices[loop]
    after = np.roll(corners, -1, axis=0)
    sides = np.linalg.norm(after - corners, axis=1)
    perimeter = float(sides.sum())
    middle = (corners + after) / 2
    centre = sides @ middle / perimeter if perimeter > 0 else corners[0]
    return Hole(
        loop=loop,
        perimeter=perimeter,
        area=float(np.linalg.norm(vector_area(corners))),
        size=float(kernels.diameter(corners)),
        centre=centre,
    )


def vector_area(corners: Floats) -> Floats:
    """(3,) mm²: Newell's normal of a loop (m, 3), as long as the area the loop encloses."""
    centred = corners - corners.mean(axis=0)
    area: Floats = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2
    return area

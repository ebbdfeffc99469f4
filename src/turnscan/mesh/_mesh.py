"""Mesh: triangles that know where each vertex came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Provenance:
    """For each vertex of a mesh: the laser, step and line that measured it, and how well."""

    sigma: Floats
    """(v,) mm; NaN where not measured or not known."""
    laser: Ints
    """(v,) index into ``lasers``; −1 where not measured."""
    step: Ints
    """(v,) step number; −1 where not measured."""
    line: Ints
    """(v,) image row (column for a horizontal stripe); −1 where not measured."""
    lasers: tuple[str, ...]

    def __post_init__(self) -> None:
        v = len(self.sigma)
        put = object.__setattr__
        put(self, "sigma", frozen(self.sigma, (v,), "Provenance.sigma", nan=True))
        for name in ("laser", "step", "line"):
            put(self, name, frozen(getattr(self, name), (v,), f"Provenance.{name}", np.int32))


@dataclass(frozen=True)
class Mesh:
    """Triangles in the object's frame, mm; faces run counter-clockwise seen from outside."""

    vertices: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3) vertex indices."""
    provenance: Provenance | None = None
    """One entry per vertex, or None for a mesh that nobody measured."""
    colour: npt.NDArray[np.uint8] | None = field(default=None)
    """(v, 3) red, green, blue, or None."""
    measured: Bools | None = field(default=None)
    """(f,) False for a face that closes a gap and was not measured; None when all were."""

    def __post_init__(self) -> None:
        v, f = len(self.vertices), len(self.faces)
        put = object.__setattr__
        put(self, "vertices", frozen(self.vertices, (v, 3), "Mesh.vertices"))
        faces = frozen(np.asarray(self.faces).reshape(f, 3), (f, 3), "Mesh.faces", np.int32)
        if f and (faces.min() < 0 or faces.max() >= v):
            raise ValueError(f"Mesh.faces: index {faces.max()} outside 0 to {v - 1}")
        put(self, "faces", faces)
        if self.provenance is not None and len(self.provenance.sigma) != v:
            raise ValueError(f"Mesh.provenance: {len(self.provenance.sigma)} entries, {v} vertices")
        if self.measured is not None:
            put(self, "measured", frozen(self.measured, (f,), "Mesh.measured", np.bool_))
        if self.colour is not None:
            put(self, "colour", frozen(self.colour, (v, 3), "Mesh.colour", np.uint8))

    @property
    def triangles(self) -> Floats:
        """(f, 3, 3) mm: the vertices of every face."""
        corners: Floats = self.vertices[self.faces]
        return corners

    def area_of(self, which: Bools | None = None) -> float:
        """Area of the faces where ``which`` (f,) is True, mm²; None takes all."""
        t = self.triangles if which is None else self.triangles[which]
        normals = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        return float(np.linalg.norm(normals, axis=1).sum() / 2)

    @property
    def volume(self) -> float:
        """Signed volume, mm³ (divergence theorem); means something for a closed mesh only."""
        if not len(self.faces):
            return 0.0
        t = self.triangles - self.vertices.mean(axis=0)
        return float(np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2])) / 6.0)

    @property
    def bounds(self) -> Floats:
        """(2, 3) mm: lowest and highest corner; NaN for a mesh without vertices."""
        if not len(self.vertices):
            return np.full((2, 3), np.nan)
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def to_trimesh(self) -> trimesh.Trimesh:
        """The same mesh for the library trimesh, which is installed beside turnscan.

        Vertices keep their order; ``vertex_attributes["sigma"]`` is the standard uncertainty in mm,
        ``face_attributes["measured"]`` is False for faces that close a gap.
        """
        import trimesh

        out = trimesh.Trimesh(self.vertices, self.faces, process=False)
        if self.provenance is not None:
            out.vertex_attributes["sigma"] = self.provenance.sigma
        if self.measured is not None:
            out.face_attributes["measured"] = self.measured
        if self.colour is not None:
            out.visual.vertex_colors = self.colour
        return out

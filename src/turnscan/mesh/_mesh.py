"""Mesh: triangles that know where each vertex came from."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen, is_frozen
from turnscan.errors import InputError
from turnscan.mesh._render import render
from turnscan.picture import Picture, card, image

if TYPE_CHECKING:
    import trimesh


def vector_areas(triangles: Floats) -> Floats:
    """(n, 3) mm² along the normals of triangles (n, 3, 3) mm: as long as each is large."""
    first, second = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    areas: Floats = np.cross(first, second) / 2
    return areas


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
    """One entry per vertex, or None for a mesh that was not measured."""
    colour: npt.NDArray[np.uint8] | None = field(default=None)
    """(v, 3) red, green, blue, or None."""
    measured: Bools | None = field(default=None)
    """(f,) False for a face that closes a gap and was not measured; None when all were."""

    def __post_init__(self) -> None:
        v, f = len(self.vertices), len(self.faces)
        put = object.__setattr__
        put(self, "vertices", frozen(self.vertices, (v, 3), "Mesh.vertices"))
        known = is_frozen(self.faces)
        given = self.faces if known else np.asarray(self.faces).reshape(f, 3)
        faces = frozen(given, (f, 3), "Mesh.faces", np.int32)
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
        return float(np.linalg.norm(vector_areas(t), axis=1).sum())

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

    def show(
        self,
        *,
        azimuth: float = 0.6,
        elevation: float = 0.45,
        size: tuple[int, int] = (640, 480),
        colour: npt.ArrayLike | None = None,
        transparent: bool = False,
    ) -> Picture:
        """Draw the mesh, shaded, z up, fitted to the frame.

        It is seen from ``azimuth`` and ``elevation`` (radians); ``size`` is (width, height) in px;
        ``colour`` is (v, 3) red, green, blue 0 to 255 per vertex, None takes the mesh's own, or one
        plain colour. Faces seen from behind are rust, so that a hole or a wrong orientation shows.
        The background is white, or ``transparent``.
        """
        paint = self.colour if colour is None else colour
        drawn = render(
            self.vertices, self.faces, azimuth=azimuth, elevation=elevation, size=size,
            colour=paint, transparent=transparent,
        )  # fmt: skip
        return Picture(drawn)

    def _repr_html_(self) -> str:
        rows: list[tuple[str, object]] = [
            ("vertices", len(self.vertices)),
            ("faces", len(self.faces)),
        ]
        if not len(self.faces):
            return card("Mesh", rows)
        low, high = self.bounds
        sides = " × ".join(f"{side:.2f}" for side in high - low)
        rows.append(("size", f"{sides} mm"))
        if self.measured is not None:
            rows.append(("not measured", f"{int((~self.measured).sum())} faces"))
        if self.provenance is not None and np.isfinite(self.provenance.sigma).any():
            rows.append(("sigma, median", f"{np.nanmedian(self.provenance.sigma):.4f} mm"))
        return card("Mesh", rows, image(self.show(size=(320, 240)).pixels))

    def to_trimesh(self) -> trimesh.Trimesh:
        """The same mesh for the library trimesh.

        Vertices keep their order; ``vertex_attributes["sigma"]`` is the standard uncertainty in mm,
        ``face_attributes["measured"]`` is False for faces that close a gap. Raises InputError where
        trimesh is not installed.
        """
        out: trimesh.Trimesh = _library("trimesh").Trimesh(self.vertices, self.faces, process=False)
        if self.provenance is not None:
            out.vertex_attributes["sigma"] = self.provenance.sigma
        if self.measured is not None:
            out.face_attributes["measured"] = self.measured
        if self.colour is not None:
            out.visual.vertex_colors = self.colour
        return out

    def to_open3d(self) -> Any:
        """The same mesh for the library Open3D, as ``open3d.geometry.TriangleMesh``.

        Vertices and faces keep their order. Raises InputError where Open3D is not installed.
        """
        o3d = _library("open3d")
        out = o3d.geometry.TriangleMesh(
            o3d.utility.Vector3dVector(np.array(self.vertices)),
            o3d.utility.Vector3iVector(np.array(self.faces)),
        )
        if self.colour is not None:
            out.vertex_colors = o3d.utility.Vector3dVector(np.array(self.colour) / 255.0)
        return out

    def to_pyvista(self) -> Any:
        """The same mesh for the library PyVista, as ``pyvista.PolyData``.

        Vertices and faces keep their order; ``point_data["sigma"]`` is the standard uncertainty in
        mm, ``cell_data["measured"]`` is False for faces that close a gap. Raises InputError where
        PyVista is not installed.
        """
        pyvista = _library("pyvista")
        out = pyvista.PolyData.from_regular_faces(np.array(self.vertices), np.array(self.faces))
        if self.provenance is not None:
            out.point_data["sigma"] = np.array(self.provenance.sigma)
        if self.measured is not None:
            out.cell_data["measured"] = np.array(self.measured)
        if self.colour is not None:
            out.point_data["colour"] = np.array(self.colour)
        return out


def _library(name: str) -> Any:
    """A library that is not among those that turnscan needs."""
    try:
        return importlib.import_module(name)
    except ImportError as e:
        raise InputError(
            f"{name} is not installed: {e}", hint=f"pip install 'turnscan[{name}]'"
        ) from None

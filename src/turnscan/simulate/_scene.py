"""What stands in front of the camera: bodies with materials, a lamp, the surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Singles, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh, components
from turnscan.rig import Pose
from turnscan.simulate._parts import Part
from turnscan.simulate._solids import bisected

PatternKind = Literal["none", "bars", "rings", "checks"]
PATTERNS: tuple[PatternKind, ...] = ("none", "bars", "rings", "checks")
_CREASE = np.cos(np.deg2rad(25.0))
_LONGEST_EDGE = 8.0
_INK_DEEP = 0.1
"""mm from the print's plane."""


@dataclass(frozen=True)
class Material:
    """How a surface gives light back: Lambert + GGX, a painted pattern, light spreading inside.

    Raises ValueError where a share is not between 0 and 1.
    """

    albedo: tuple[float, float, float] = (0.6, 0.6, 0.6)
    """Diffuse reflectance in red, green and blue."""
    specular: float = 0.0
    """Fresnel reflectance at normal incidence (0.04 varnish, 0.9 metal); 0: none."""
    roughness: float = 0.3
    """GGX roughness α."""
    pattern: PatternKind = "none"
    """bars along z, rings round z, or checks of both."""
    pitch: float = 10.0
    """Period of the pattern, mm (for bars: measured along the circumference at 25 mm radius)."""
    pattern_ratio: float = 0.1
    """Albedo of the pattern's dark half over that of its light half."""
    halo: float = 0.0
    """Share of the diffuse light that travels inside the material before it comes out."""
    halo_length: float = 2.0
    """mm: how far it travels (length of the exponential)."""
    polarisation: float = 0.0
    """Degree of polarisation of the scattered laser light: 0 matt (contrast 1/√2), 1 metal."""

    def __post_init__(self) -> None:
        shares = {"specular": self.specular, "halo": self.halo, "polarisation": self.polarisation}
        shares |= {f"albedo[{i}]": a for i, a in enumerate(self.albedo)}
        shares |= {"pattern_ratio": self.pattern_ratio}
        for name, value in shares.items():
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"Material.{name}: {value}, expected 0 to 1")
        for name in ("roughness", "pitch", "halo_length"):
            if not getattr(self, name) > 0:
                raise ValueError(f"Material.{name}: {getattr(self, name)}, expected above 0")
        if self.pattern not in PATTERNS:
            raise ValueError(f"Material.pattern: {self.pattern!r}, expected one of {PATTERNS}")

    def at(self, wavelength: float) -> float:
        """Albedo at a wavelength (mm), between those of red, green and blue."""
        return float(np.interp(wavelength * 1e6, (460.0, 535.0, 620.0), self.albedo[::-1]))


@dataclass(frozen=True)
class Texture:
    """A printed picture on a body's faces: a calibration board."""

    picture: Floats
    """(h, w) reflectance 0 to 1, row 0 at the top."""
    corner: Floats
    """(3,) mm: the outer corner of the top-left pixel, in the body's frame."""
    right: Floats
    """(3,) mm: from there to the top right corner."""
    down: Floats
    """(3,) mm: from there to the bottom left corner."""

    def __post_init__(self) -> None:
        h, w = self.picture.shape
        put = object.__setattr__
        put(self, "picture", frozen(self.picture, (h, w), "Texture.picture"))
        for name in ("corner", "right", "down"):
            put(self, name, frozen(getattr(self, name), (3,), f"Texture.{name}"))

    def places(self, points: Floats) -> tuple[Singles, Singles, Bools]:
        """Columns and rows (n,) of the picture at points (n, 3) in the body's frame, and which lie
        off the print's plane: on other sides of the body."""
        h, w = self.picture.shape
        d = points - self.corner
        normal = np.cross(self.right, self.down)
        off: Bools = np.abs(d @ (normal / np.linalg.norm(normal))) > _INK_DEEP
        x = (d @ self.right / (self.right @ self.right) * w - 0.5).astype(np.float32)
        y = (d @ self.down / (self.down @ self.down) * h - 0.5).astype(np.float32)
        return x, y, off

    def at(self, points: Floats) -> Floats:
        """Reflectance (n,) at points (n, 3) in the body's frame; 1 off the print and behind it."""
        import cv2

        x, y, off = self.places(points)
        out = np.empty(len(points))
        for i in range(0, len(points), 16384):  # OpenCV's remap takes at most 32767 rows
            part = cv2.remap(
                self._paper, x[i : i + 16384, None], y[i : i + 16384, None], cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_CONSTANT, borderValue=1.0,
            )  # fmt: skip
            out[i : i + 16384] = part[:, 0]
        return np.where(off, 1.0, out)

    def room(self, x: Singles, y: Singles) -> Singles:
        """(n,) pixels of the picture to each side of a place within which there is one tone."""
        h, w = self.picture.shape
        beyond = np.maximum(np.maximum(-x, x - (w - 1)), np.maximum(-y, y - (h - 1)))
        column = np.clip(np.rint(x), 0, w - 1).astype(int)
        row = np.clip(np.rint(y), 0, h - 1).astype(int)
        return np.asarray(np.where(beyond > 0, beyond, self._plain[row, column]), np.float32)

    @cached_property
    def _paper(self) -> Singles:
        return self.picture.astype(np.float32)

    @cached_property
    def _plain(self) -> Singles:
        """(h, w) pixels to the nearest one beside which there is another tone."""
        import cv2

        paper = cv2.copyMakeBorder(self._paper, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=1.0)
        around = np.ones((3, 3), np.uint8)
        alike = cv2.dilate(paper, around) == cv2.erode(paper, around)
        far = cv2.distanceTransform(alike[1:-1, 1:-1].astype(np.uint8), cv2.DIST_C, 3)
        return np.asarray(far, np.float32)


@dataclass(frozen=True)
class Body:
    """A part somewhere on the table."""

    part: Part
    material: Material = field(default_factory=Material)
    T_table_part: Pose = field(default_factory=Pose)
    """Part's frame → table frame at angle 0."""
    texture: Texture | None = None


@dataclass(frozen=True)
class Scene:
    """All that turns with the table, and the light that does not."""

    bodies: tuple[Body, ...]
    sky: float = 0.0
    """Irradiance of diffuse room light in the camera's band, W/mm²."""
    lamp: float = 0.0
    """Irradiance of a lamp square to its rays, W/mm²."""
    lamp_from: Floats = field(default_factory=lambda: np.array([0.7, -0.5, 0.5]))
    """(3,) direction from the scene to the lamp, table frame at rest."""
    background: float = 0.0
    """Radiance behind everything, relative to white paper under the diffuse light."""

    def __post_init__(self) -> None:
        d = np.asarray(self.lamp_from, dtype=np.float64)
        d = frozen(d / np.linalg.norm(d), (3,), "Scene.lamp_from")
        object.__setattr__(self, "lamp_from", d)


@dataclass(frozen=True)
class Triangles:
    """All bodies as triangles in the table frame at angle 0, ready for ray casting."""

    vertices: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3)."""
    flat_normals: Floats
    """(f, 3) unit normals of the triangles."""
    corner_normals: Floats
    """(f, 3, 3) unit normals of the smooth surface at the corners."""
    body: Ints
    """(f,) which body."""

    @cached_property
    def closed(self) -> bool:
        """Whether every edge has its opposite and no piece is inside out: there is an inside.

        Also False where that cannot be said, as of a hollow, whose wall turns inwards.
        """
        from turnscan.simulate import _raster

        if _raster.open_edges(self.vertices, self.faces):
            return False
        t = self.vertices[self.faces]
        volume = np.einsum("ij,ij->i", t[:, 0], np.cross(t[:, 1], t[:, 2]))
        return bool((np.bincount(components(Mesh(self.vertices, self.faces)), volume) > 0).all())

    @cached_property
    def corners(self) -> Floats:
        """(f, 3, 3) mm, laid out as they are read."""
        return self.vertices[self.faces]

    @cached_property
    def boxes(self) -> tuple[Floats, Floats]:
        """Round each few triangles, and round each few of these boxes: (n, 12) and (m, 12), as of
        `_cut.clusters` and `_cut.groups`."""
        from turnscan.simulate import _cut

        small = _cut.clusters(self.corners, self.flat_normals)
        return small, _cut.groups(small)


def _near_to_far(v: Floats, f: npt.NDArray[np.integer]) -> npt.NDArray[np.intp]:
    """(f,) an order of triangles that keeps neighbours together."""
    middle = v[f].mean(axis=1)
    low, high = middle.min(axis=0), middle.max(axis=0)
    steps = ((middle - low) / np.maximum(high - low, 1e-9).max() * 1023).astype(np.uint64)
    code = np.zeros(len(middle), np.uint64)  # Morton's: the bits of x, y, z interleaved
    for bit in range(10):
        for axis in range(3):
            one = (steps[:, axis] >> np.uint64(bit)) & np.uint64(1)
            code |= one << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def _by_first_use(v: Floats, f: npt.NDArray[np.integer]) -> tuple[Floats, npt.NDArray[np.integer]]:
    """Vertices in the order in which triangles use them, and the triangles."""
    used, first, place = np.unique(f, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return v[used[order]], rank[place].reshape(f.shape)


def triangles(bodies: Sequence[Body]) -> Triangles:
    """Collect the bodies' triangles. Raises InputError for a body without faces.

    Neighbours in space are neighbours in the arrays: fetching triangles from all over the memory
    would take longer than drawing them.
    """
    meshes = []
    for b in bodies:
        if not len(b.part.mesh.faces):
            raise InputError(f"{b.part.name}: the mesh has no faces", hint="give another part")
        m = bisected(b.part.mesh, _LONGEST_EDGE)
        meshes.append(Mesh(b.T_table_part.apply(m.vertices), m.faces))
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    v = np.concatenate([m.vertices for m in meshes])
    f = np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)])
    t = v[f]
    cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.linalg.norm(cross, axis=1)
    solid = np.flatnonzero(length > 1e-12)
    solid = solid[_near_to_far(v, f[solid])]
    body = np.repeat(np.arange(len(meshes)), [len(m.faces) for m in meshes])[solid]
    flat = cross[solid] / length[solid, None]
    v, f = _by_first_use(v, f[solid])
    return Triangles(
        frozen(v, (None, 3), "Triangles.vertices"),
        frozen(f, (None, 3), "Triangles.faces", np.int32),
        frozen(flat, (None, 3), "Triangles.flat_normals"),
        frozen(_smooth(v, f, flat), (None, 3, 3), "Triangles.corner_normals"),
        frozen(body, (None,), "Triangles.body", np.int32),
    )


def _smooth(v: Floats, f: npt.NDArray[np.integer], flat: Floats) -> Floats:
    """Corner normals: mean of the neighbours' normals weighted by angle, but not across edges."""
    from turnscan.simulate import _rays

    t = v[f]
    angles = np.empty((len(f), 3))
    for k in range(3):
        a = t[:, (k + 1) % 3] - t[:, k]
        b = t[:, (k + 2) % 3] - t[:, k]
        angles[:, k] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))
    order = np.argsort(f.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(f.ravel(), minlength=len(v)))])
    return np.asarray(_rays.corner_normals(f, flat, angles, order, starts, _CREASE))

"""How far points lie from a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh, half_edges


@dataclass(frozen=True)
class Deviation:
    """Signed distances of points from a reference surface, positive outside."""

    distance: Floats
    """(n,) mm."""
    closest: Floats
    """(n, 3) mm: the nearest point of the surface."""
    face: Ints
    """(n,) the face on which it lies."""
    beyond: Bools
    """(n,) True for points off the end of an open reference, which says nothing there: their
    nearest place is on its border, and not below or above them."""

    def __post_init__(self) -> None:
        n = len(self.distance)
        put = object.__setattr__
        put(self, "distance", frozen(self.distance, (n,), "Deviation.distance"))
        put(self, "closest", frozen(self.closest, (n, 3), "Deviation.closest"))
        put(self, "face", frozen(self.face, (n,), "Deviation.face", np.int32))
        put(self, "beyond", frozen(self.beyond, (n,), "Deviation.beyond", np.bool_))

    def covered(self) -> Deviation:
        """The same without the points ``beyond``."""
        k = ~self.beyond
        return Deviation(self.distance[k], self.closest[k], self.face[k], self.beyond[k])

    @property
    def mean(self) -> float:
        """Mean signed distance, mm; NaN without points."""
        return float(self.distance.mean()) if len(self.distance) else np.nan

    @property
    def rms(self) -> float:
        """Root mean square distance, mm; NaN without points."""
        return float(np.sqrt(np.mean(self.distance**2))) if len(self.distance) else np.nan

    def quantile(self, share: float) -> float:
        """Absolute distance, mm, that ``share`` of the points (0 to 1) stay within."""
        return float(np.quantile(np.abs(self.distance), share)) if len(self.distance) else np.nan

    def within(self, tolerance: float) -> float:
        """Share of the points, 0 to 1, that lie no further than ``tolerance`` mm; NaN if none."""
        return float(np.mean(np.abs(self.distance) <= tolerance)) if len(self.distance) else np.nan


def deviation(points: npt.ArrayLike, reference: Mesh) -> Deviation:
    """Signed distance of points (n, 3) mm from a mesh.

    The sign is that of the angle-weighted pseudonormal at the nearest point (Bærentzen & Aanæs
    2005), so it is right for a closed, outward mesh and tells the side of an open one. Raises
    InputError for a mesh without faces.
    """
    import igl

    if not len(reference.faces):
        raise InputError(
            "the reference has no faces to measure a distance from",
            hint="give a mesh (STL, PLY, OBJ, 3MF, GLB, DXF), not a cloud of points",
        )
    p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    if not len(p):
        return Deviation(np.zeros(0), p, np.zeros(0, np.int32), np.zeros(0, np.bool_))
    distance, face, closest, _ = igl.signed_distance(
        p,
        np.array(reference.vertices),
        reference.faces.astype(np.int64),
        sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    face = face.astype(np.int32)
    return Deviation(distance, closest, face, _beyond(p - closest, closest, face, reference))


def _beyond(apart: Floats, closest: Floats, face: Ints, reference: Mesh) -> Bools:
    """(n,) `Deviation.beyond`, of points that lie ``apart`` (n, 3) from their closest place."""
    begin, end = half_edges(reference.faces)
    size = len(reference.vertices)
    rim = np.sort(begin.astype(np.int64) * size + end)
    vertex = np.zeros(size, dtype=np.bool_)
    vertex[begin] = True
    distance = np.linalg.norm(apart, axis=1)
    corners = reference.faces[face]
    t = reference.vertices[corners]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.linalg.norm(normal, axis=1)
    steep = np.abs(np.einsum("ij,ij->i", normal, apart)) > 0.5 * length * distance
    near = 1e-6 * np.sqrt(length)
    on_rim = np.zeros(len(apart), dtype=np.bool_)
    for i in range(3):
        a, b = t[:, i], t[:, (i + 1) % 3]
        to = closest - a
        along = b - a
        off = np.linalg.norm(np.cross(along, to), axis=1) / np.linalg.norm(along, axis=1)
        keys = corners[:, i].astype(np.int64) * size + corners[:, (i + 1) % 3]
        at = np.minimum(np.searchsorted(rim, keys), max(len(rim) - 1, 0))
        on_side = (rim[at] == keys) if len(rim) else np.zeros(len(keys), dtype=np.bool_)
        on_rim |= (on_side & (off < near)) | (
            vertex[corners[:, i]] & (np.linalg.norm(to, axis=1) < near)
        )
    return np.asarray(on_rim & ~steep & (distance > near))

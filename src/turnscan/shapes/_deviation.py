"""How far points lie from a surface, and how much of a surface was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints, frozen
from turnscan.errors import InputError
from turnscan.surface import Mesh


@dataclass(frozen=True)
class Deviation:
    """Signed distances of points from a reference surface, positive outside."""

    distance: Floats
    """(n,) mm."""
    closest: Floats
    """(n, 3) mm: the nearest point of the surface."""
    face: Ints
    """(n,) the face on which it lies."""

    def __post_init__(self) -> None:
        n = len(self.distance)
        put = object.__setattr__
        put(self, "distance", frozen(self.distance, (n,), "Deviation.distance"))
        put(self, "closest", frozen(self.closest, (n, 3), "Deviation.closest"))
        put(self, "face", frozen(self.face, (n,), "Deviation.face", np.int32))

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
            hint="give a mesh (STL, PLY, OBJ, DXF), not a cloud of points",
        )
    p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    if not len(p):
        return Deviation(np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int32))
    distance, face, closest, _ = igl.signed_distance(
        p,
        np.array(reference.vertices),
        reference.faces.astype(np.int64),
        sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    return Deviation(distance, closest, face.astype(np.int32))


def sample_surface(mesh: Mesh, count: int) -> Floats:
    """``count`` points (count, 3) mm spread evenly over the area of a mesh, always the same ones.

    Faces are taken in equal steps of cumulated area and the place within a face from the plastic-
    number sequence, so that neighbouring samples do not clump as random ones would.
    """
    t = mesh.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    if not area.sum() > 0:
        raise InputError("the mesh has no area to sample", hint="give a mesh with faces")
    ends = np.cumsum(area)
    at = (np.arange(count) + 0.5) / count * ends[-1]
    face = np.minimum(np.searchsorted(ends, at), len(t) - 1)
    plastic = 1.3247179572447460
    order = np.arange(1, count + 1)
    r1, r2 = (order / plastic) % 1.0, (order / plastic**2) % 1.0
    root = np.sqrt(r1)
    weights = np.stack([1.0 - root, root * (1.0 - r2), root * r2], axis=-1)
    points: Floats = np.einsum("ni,nij->nj", weights, t[face])
    return points

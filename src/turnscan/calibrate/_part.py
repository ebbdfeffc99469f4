"""A drawn part as a body: how far points are from its triangles, and ways in which it may stand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from turnscan.arrays import Floats, cross
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.rig import Pose, nearest_rotation, rotation_from_vector

_TURNS = 480
"""Rotations that are tried."""
_TRIES = ((480, 60, 10), (40, 150, 15))
"""How many of the best go on, how many points are looked at, and rounds with the rig free."""
_ASIDE = 0.05
"""Of the part's size: so far it may stand aside of where a rotation puts it."""
_HELD = 4
"""Rounds before, with the rig held."""
_FINER, _FINEST = 0.7, 0.1
"""By how much more gaps weigh from round to round, and mm beyond which they weigh no more."""
_LOOSE = 1e-9
"""Of a place, that is known by nothing."""
_FAR = 2.0
"""Times what gaps weigh by: a point farther off lies on something else, as well as may be."""
_BEHIND, _HARDLY, _FALSE = -0.2, 0.1, 2.0
"""Cosine below which a face cannot have been seen, the weight of a point there, and mm of its gap
besides."""
_UNLIKE = np.radians(15.0)
"""Rotations that differ by less are one way to stand."""
_GOLDEN = 1.533751168755204288118041
"""ψ⁴ = ψ + 4."""


@dataclass(frozen=True)
class Loose:
    """Points as a rig has them that may be off."""

    points: Floats
    """(n, 3) mm."""
    towards: Floats
    """(n, 3) of unit length: the way to the camera."""
    modes: Floats
    """(n, 3, m) mm by which they move with each of m independent directions in which the rig may be
    off, by 1 standard uncertainty."""

    def some(self, most: int) -> Loose:
        """``most`` of the points, spread over all of them."""
        count = len(self.points)
        few = np.unique(np.linspace(0, count - 1, most).astype(np.intp))
        return Loose(self.points[few], self.towards[few], self.modes[few])


@dataclass(frozen=True)
class Placement:
    """A way in which a part may stand, and how far the rig is off then."""

    pose: Pose
    """Part's frame → that of the points."""
    off: Floats
    """(m,) standard uncertainties, in the directions of its modes."""
    gap: float
    """mm by which points are beside it, on the average; more for one seen from behind."""


@dataclass(frozen=True, eq=False)
class Part:
    """A surface of triangles in a frame of its own; its one size is its scale, nominally 1.

    Raises InputError for a mesh without a surface.
    """

    mesh: Mesh

    def __post_init__(self) -> None:
        if not self.mesh.area_of() > 0:
            raise InputError("the drawn part has no surface", hint="give a mesh with triangles")

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return "part"

    @property
    def size_names(self) -> tuple[str, ...]:
        """Of its one size."""
        return ("scale",)

    @property
    def moves(self) -> Floats:
        """As of `Balls`; what turns or shifts it within itself is found by the adjustment."""
        return np.eye(6)

    @cached_property
    def _corners(self) -> Floats:
        """(v, 3), each once."""
        return np.ascontiguousarray(self.mesh.vertices)

    @cached_property
    def _faces(self) -> npt.NDArray[np.int64]:
        return self.mesh.faces.astype(np.int64)

    @cached_property
    def _normals(self) -> Floats:
        """(f, 3) of unit length, outwards also where the mesh is inside out; 0 for a face without
        area."""
        t = self.mesh.triangles
        normals = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit: Floats = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
        return -unit if self.mesh.volume < 0 else unit

    @cached_property
    def _tree(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self._corners, self._faces)
        return tree

    def _under(self, points: Floats) -> tuple[Floats, Floats]:
        """(n, 3) the nearest place of the surface to each point (n, 3) of its frame, and the normal
        of the face there."""
        _, face, foot = self._tree.squared_distance(
            self._corners, self._faces, np.ascontiguousarray(points)
        )
        return foot, self._normals[face]

    def nearest(self, points: Floats, sizes: Floats) -> tuple[Floats, Floats, Floats]:
        """As of `Balls`: positive outside, by the normal of the nearest triangle."""
        away, unit, _ = self._apart(points / float(sizes[0]))
        away = float(sizes[0]) * away
        by_scale = (away - np.einsum("ni,ni->n", unit, points)) / float(sizes[0])
        return away, unit, by_scale[:, None]

    def _apart(self, local: Floats) -> tuple[Floats, Floats, Floats]:
        """Of points (n, 3) of its frame: distance (n,) mm, the direction (n, 3) in which that
        grows, and the nearest face's normal (n, 3)."""
        foot, normal = self._under(local)
        off = local - foot
        far = np.linalg.norm(off, axis=1)
        side = np.where(np.einsum("ni,ni->n", off, normal) < 0, -1.0, 1.0)
        unit = np.where(
            (far > 1e-6)[:, None], (side / np.maximum(far, 1e-300))[:, None] * off, normal
        )
        return side * far, unit, normal

    def placements(
        self, seen: Loose, doubt: float, count: int, progress: Progress = no_progress
    ) -> list[Placement]:
        """Ways in which the part may stand, the best first; ``doubt`` mm is how far the rig may put
        points beside their places.

        Rotations all over are each brought nearer by nearest points (Besl & McKay, A method for
        registration of 3-D shapes, 1992); the best of them go on with the rig free, at first where
        it is known to be, as gaps hardly weigh, and less and less so.
        """
        corners = self.mesh.vertices[self.mesh.faces.ravel()]
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        few = seen.some(_TRIES[0][1])
        size = float(np.linalg.norm(np.ptp(corners, axis=0)))
        sigma = max(doubt, _ASIDE * size)
        done = progress.counter(_TURNS + sum(best for best, _, _ in _TRIES))
        tried = []
        for R in _rotations(_TURNS):
            turned = few.points @ R.T
            shift = middle - (turned.min(axis=0) + turned.max(axis=0)) / 2
            held = self._brought(few.points, Pose(R, shift))
            tried.append(Placement(held.inverse(), np.zeros(few.modes.shape[2]), size))
            done()
        for best, most, rounds in _TRIES:
            few = seen.some(most)
            nearer = []
            for one in tried[:best]:
                nearer.append(self._loosened(few, one, sigma, rounds))
                done()
            tried = sorted(nearer, key=lambda one: one.gap)
            sigma *= _FINER**rounds
        out = list[Placement]()
        for one in tried:
            if all(_angle(one.pose, other.pose) > _UNLIKE for other in out):
                out.append(one)
        return out[:count]

    def _brought(self, points: Floats, to_part: Pose) -> Pose:
        """The motion after some rounds of nearest points."""
        for _ in range(_HELD):
            foot, _ = self._under(to_part.apply(points))
            p, q = points.mean(axis=0), foot.mean(axis=0)
            R = nearest_rotation((foot - q).T @ (points - p))
            to_part = Pose(R, q - R @ p)
        return to_part

    def _loosened(self, seen: Loose, start: Placement, sigma: float, rounds: int) -> Placement:
        """The placement after some rounds more, in which gaps weigh by ``sigma`` mm at first.

        Least squares of distances and of what is known of the rig, far points weighed down
        (Cauchy), and those nearest to a face that looks away from the camera. Points are wrong
        together: all of them say as much as there are unknowns.
        """
        points, modes = seen.points, seen.modes
        to_part, off = start.pose.inverse(), start.off
        unknown = len(off) + 6
        share = np.sqrt(len(points) / unknown)
        known = np.concatenate([np.full(6, _LOOSE), np.ones(len(off))])
        for _ in range(rounds):
            local = to_part.apply(points + modes @ off)
            away, unit, normal = self._apart(local)
            behind = np.einsum("ni,ni->n", normal, seen.towards @ to_part.rotation.T) < _BEHIND
            centre = local.mean(axis=0)
            own = np.einsum("nim,ni->nm", modes, unit @ to_part.rotation)
            J = np.concatenate([cross(local - centre, unit), unit, own], axis=1)
            w = 1.0 / ((share * max(sigma, _FINEST)) ** 2 + (away / _FAR) ** 2)
            w[behind] *= _HARDLY
            pull = J.T @ (w * away) + known * np.concatenate([np.zeros(6), off])
            step = -np.linalg.solve((J.T * w) @ J + np.diag(known), pull)
            R = rotation_from_vector(step[:3])
            shift = R @ (to_part.translation - centre) + centre + step[3:6]
            to_part = Pose(nearest_rotation(R @ to_part.rotation), shift)
            off = off + step[6:]
            sigma *= _FINER
        away, _, normal = self._apart(to_part.apply(points + modes @ off))
        behind = np.einsum("ni,ni->n", normal, seen.towards @ to_part.rotation.T) < _BEHIND
        gap = float(np.mean(np.abs(away))) + _FALSE * float(behind.mean())
        return Placement(to_part.inverse(), off, gap)


def _rotations(count: int) -> npt.NDArray[np.float64]:
    """(count, 3, 3) spread evenly (Alexa, Super-Fibonacci spirals, 2022)."""
    s = np.arange(count) + 0.5
    r, big = np.sqrt(s / count), np.sqrt(1 - s / count)
    a, b = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / _GOLDEN
    quaternions = np.stack([r * np.sin(a), r * np.cos(a), big * np.sin(b), big * np.cos(b)], axis=1)
    return Rotation.from_quat(quaternions).as_matrix()


def _angle(one: Pose, other: Pose) -> float:
    return float(Rotation.from_matrix(one.rotation.T @ other.rotation).magnitude())

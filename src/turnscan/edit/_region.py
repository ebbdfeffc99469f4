"""Region: a piece of the surface, by number on its own mesh and by place on any other."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from turnscan.arrays import Bools, Floats, Ints
from turnscan.edit._body import Body
from turnscan.errors import FormatError, InputError
from turnscan.rig import Pose

MOST_RUNS = 2_000_000
"""Numbers in one coded list of faces."""
MOST_SAMPLES = 20_000
"""Samples on each side of a region's border; the spacing grows until they are enough."""
_UNIT = 1e-3
"""mm: samples are whole numbers of these."""
_FAR = 1_000_000_000
_RIM = 3.0
"""Spacings round a region in which the faces beside it are remembered too."""
_REACH = 1.5
"""Spacings from the nearest sample within which a face of another mesh belongs to the region."""
_WITHIN = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0
"""Barycentric places in a face that are sampled: its centroid, and halfway to each corner."""

Length = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
"""mm, above 0."""
Runs = Annotated[tuple[Annotated[int, Field(ge=0, le=1 << 31)], ...], Field(max_length=MOST_RUNS)]
"""Ascending numbers as gap, length, gap, length …: 3, 2, 4, 1 is 3 4 9."""
Samples = Annotated[
    tuple[Annotated[int, Field(ge=-_FAR, le=_FAR)], ...], Field(max_length=3 * MOST_SAMPLES)
]
"""x, y, z, x, y, z … in µm, the object's frame."""


@dataclass(frozen=True)
class Place:
    """Where a region lies in the object's frame: points on it, and points beside it."""

    spacing: Length
    """mm between samples, about."""
    inside: Samples = field(repr=False)
    outside: Samples = field(repr=False)

    def __post_init__(self) -> None:
        for name in ("inside", "outside"):
            if len(getattr(self, name)) % 3:
                raise FormatError(f"place.{name}: {len(getattr(self, name))} numbers, not triples")

    @property
    def reach(self) -> float:
        """mm from a sample within which a face of another mesh belongs."""
        return _REACH * self.spacing

    def samples(self) -> Floats:
        """(n, 3) mm: the points on it."""
        return _points(self.inside)

    def holds(self, points: Floats) -> Bools:
        """(n,) True for points (n, 3) mm that belong: an inside sample is near, and the nearest."""
        from scipy.spatial import cKDTree

        inside, outside = self.samples(), _points(self.outside)
        if not len(inside):
            return np.zeros(len(points), dtype=np.bool_)
        reach = self.reach
        low, high = inside.min(axis=0) - reach, inside.max(axis=0) + reach
        near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        to_in = np.asarray(cKDTree(inside).query(points[near], distance_upper_bound=reach)[0])
        good = to_in <= reach
        if len(outside):
            to_out = np.asarray(cKDTree(outside).query(points[near[good]])[0])
            good[good] = to_in[good] <= to_out
        out = np.zeros(len(points), dtype=np.bool_)
        out[near[good]] = True
        return out


@dataclass(frozen=True)
class Region:
    """Faces that a person chose. On the body they were chosen on the numbers count, to the face;
    on any other, such as the surface of another scan of the same part, the place does."""

    mesh: Annotated[str, Field(min_length=1, max_length=64)]
    """Key of the body that the numbers belong to."""
    faces: Runs = field(repr=False)
    place: Place

    def __post_init__(self) -> None:
        if len(self.faces) % 2:
            raise FormatError(f"faces: {len(self.faces)} numbers, not pairs of gap and length")

    @classmethod
    def of(cls, body: Body, faces: npt.ArrayLike) -> Region:
        """The region of these faces (n,) of a body. Raises InputError for none, or dead ones."""
        chosen = np.unique(np.asarray(faces, dtype=np.int64))
        if not len(chosen):
            raise InputError("nothing is selected", hint="select some faces first")
        if chosen[0] < 0 or chosen[-1] >= len(body.alive) or not body.alive[chosen].all():
            raise InputError(
                "the selection names faces that do not exist", hint="select again, then repeat"
            )
        return cls(body.key, runs_of(chosen), _place(body, chosen))

    @property
    def count(self) -> int:
        """Number of faces it had on its own mesh."""
        return sum(self.faces[1::2])

    def moved(self, pose: Pose) -> Region:
        """The region where a part stands elsewhere: by its place alone."""
        inside, outside = (
            _whole(pose.apply(_points(samples)))
            for samples in (self.place.inside, self.place.outside)
        )
        return replace(
            self, mesh="moved", place=replace(self.place, inside=inside, outside=outside)
        )

    def find(self, body: Body) -> Ints:
        """(n,) numbers of the living faces of ``body`` that belong to the region, ascending."""
        if self.mesh == body.key:
            faces = numbers_of(self.faces, len(body.alive))
            return faces[body.alive[faces]]
        living = np.flatnonzero(body.alive)
        there = self.place.holds(_centroids(body, living))
        return living[there].astype(np.int32)


def runs_of(numbers: npt.ArrayLike) -> tuple[int, ...]:
    """Ascending numbers (n,), none twice → gap, length, gap, length …"""
    n = np.asarray(numbers, dtype=np.int64)
    if not len(n):
        return ()
    breaks = np.flatnonzero(np.diff(n) != 1)
    first, last = n[np.r_[0, breaks + 1]], n[np.r_[breaks, len(n) - 1]]
    gap = first - np.r_[0, last[:-1] + 1]
    return tuple(np.stack([gap, last - first + 1], axis=-1).ravel().tolist())


def numbers_of(runs: tuple[int, ...], limit: int) -> Ints:
    """The numbers that runs stand for, (n,) ascending; those from ``limit`` on are left out."""
    pairs = np.asarray(runs, dtype=np.int64).reshape(-1, 2)
    ends = np.cumsum(pairs.ravel()).reshape(-1, 2)
    # Clipped before anything is allocated: a few bytes can promise any number of faces.
    first, last = np.minimum(ends[:, 0], limit), np.minimum(ends[:, 1], limit)
    marks = np.zeros(limit + 1, dtype=np.int64)
    np.add.at(marks, first, 1)
    np.add.at(marks, last, -1)
    return np.flatnonzero(np.cumsum(marks[:limit]) > 0).astype(np.int32)


def _place(body: Body, chosen: npt.NDArray[np.int64]) -> Place:
    from scipy.spatial import cKDTree

    corners = body.mesh.vertices[body.mesh.faces[chosen]]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    # By the shortest side: those of a spike's faces are long, but what is beside it is near.
    spacing = max(2.0 * float(np.median(sides.min(axis=1))), 10 * _UNIT)
    points = np.einsum("kc,ncx->nkx", _WITHIN, corners).reshape(-1, 3)
    inside = _sampled(points, spacing)
    while len(inside) > MOST_SAMPLES:
        spacing *= 1.5
        inside = _sampled(points, spacing)
    rim = _RIM * spacing
    others = body.alive.copy()
    others[chosen] = False
    at = _centroids(body, np.flatnonzero(others))
    low, high = inside.min(axis=0) - rim, inside.max(axis=0) + rim
    at = at[((at >= low) & (at <= high)).all(axis=1)]
    away, _ = cKDTree(inside).query(at, distance_upper_bound=rim)
    outside = _sampled(at[away <= rim], spacing)
    while len(outside) > MOST_SAMPLES:
        outside = outside[::2]
    return Place(spacing, _whole(inside), _whole(outside))


def _sampled(points: Floats, spacing: float) -> Floats:
    """The mean of the points (n, 3) in every cell of a grid."""
    cell = np.floor(points / spacing).astype(np.int64)
    cell -= cell.min(axis=0, initial=0)
    size = cell.max(axis=0, initial=0) + 1
    _, which = np.unique((cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2],
                         return_inverse=True)  # fmt: skip
    count = np.bincount(which)
    sums = [np.bincount(which, points[:, k]) for k in range(3)]
    mean: Floats = np.stack(sums, axis=-1) / count[:, None]
    return mean


def _centroids(body: Body, faces: npt.NDArray[np.integer]) -> Floats:
    mesh = body.mesh
    total = mesh.vertices[mesh.faces[faces, 0]] + mesh.vertices[mesh.faces[faces, 1]]
    middle: Floats = (total + mesh.vertices[mesh.faces[faces, 2]]) / 3.0
    return middle


def _whole(points: Floats) -> tuple[int, ...]:
    return tuple(np.rint(points / _UNIT).astype(np.int64).ravel().tolist())


def _points(samples: tuple[int, ...]) -> Floats:
    return np.asarray(samples, dtype=np.float64).reshape(-1, 3) * _UNIT

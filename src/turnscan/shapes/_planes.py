"""The planar faces of a measured part: regions grown on the mesh, and the angles between them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, Longs, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh, vector_areas, vertex_normals
from turnscan.shapes._fit import fit_plane
from turnscan.shapes._forms import Plane
from turnscan.shapes._measure import sigma_of

if TYPE_CHECKING:
    from turnscan.shapes.primitives._ground import Ground

_ROUNDS = 8
_LEAST = 12
"""Vertices that a plane must have at the least."""
_ROWS = 2.5
"""Rows of vertices side by side that tell a plane from two profiles."""
_PARALLEL = 0.05
"""Sine of an angle below which noise may turn the edge of two planes anywhere."""
_NOISES = 3.0
"""Of the noise: how far a vertex may lie off its plane."""
_BEND = 0.2
"""Of the tolerance: how far a side may bend, root mean square. Strips of a cylinder or sphere that
the tolerance lets grow bend by 0.3 of it, sides of simulated plates and prisms by up to 0.1."""


@dataclass(frozen=True)
class PlaneRegion:
    """One planar face: its plane, normal pointing outward, and what belongs to it."""

    plane: Plane
    inliers: Bools
    """(v,) True for the vertices of the mesh that the plane was fitted to."""
    area: float
    """mm² of the faces whose corners all belong to it, laid into the plane."""
    own_sigma: float
    """Radians: standard uncertainty of the normal's direction from the points alone, the common
    causes left out that `plane` counts, too."""
    turns: Floats
    """(m, 3) how the normal turns with one standard deviation of each common cause."""

    def __post_init__(self) -> None:
        inliers = frozen(self.inliers, (None,), "PlaneRegion.inliers", np.bool_)
        object.__setattr__(self, "inliers", inliers)
        object.__setattr__(self, "turns", frozen(self.turns, (None, 3), "PlaneRegion.turns"))


@dataclass(frozen=True)
class _Side:
    """A planar face before anything is asked of its uncertainty."""

    plane: Plane
    inliers: Bools
    """(v,) of the measured part."""
    area: float


def find_planes(
    mesh: Mesh,
    *,
    tolerance: float | None = None,
    turn: float = float(np.deg2rad(25.0)),
    smallest: float = 0.02,
    most: int = 24,
    moves: Iterable[Floats] = (),
) -> list[PlaneRegion]:
    """The planar faces of a mesh, largest first.

    Regions grow over the mesh from its flattest places: a vertex joins where it lies within
    ``tolerance`` mm of the region's plane and its smoothed normal within ``turn`` radians; the
    plane is fitted anew as the region grows, and regions of one plane that touch it become one.
    ``tolerance`` None takes three times the noise that neighbours show, without what the surface
    does between them. ``smallest`` is the least area of a side, as a part of the whole surface.
    Points further than ``tolerance`` from the final plane are left out of its fit; rms is over the
    points kept. A region that bends as far as ``tolerance`` lets it grow is none, for such strips
    lie on every cylinder; nor is one of two rows of vertices, through which a plane always goes.

    Vertices that were not measured belong to no side; points weigh 1/sigma² where all know theirs.
    ``moves`` are (v, 3) mm each: how all vertices move with one standard deviation of each common
    cause (`common_moves`). They count in the uncertainties, with what `find_shapes` counts.

    Raises InputError for a mesh without measured faces.
    """
    from turnscan.shapes.primitives._ground import measured_part, prepared
    from turnscan.shapes.primitives._ground import sigma_of as usual_sigma_of
    from turnscan.shapes.primitives._judged import rows
    from turnscan.shapes.primitives._surface_kernels import PLANE

    part, back = measured_part(mesh)
    ground = prepared(part, usual_sigma_of(part), None)
    limit = _NOISES * ground.noise if tolerance is None else tolerance
    own = [np.asarray(m)[back] for m in moves]
    return [
        _known(ground, r, back, len(mesh.vertices), own)
        for r in _find(part, limit, turn, smallest, most)
        if rows(ground, PLANE, np.zeros(10), np.flatnonzero(r.inliers)) >= _ROWS
    ]


def _known(g: Ground, r: _Side, back: Longs, count: int, moves: Sequence[Floats]) -> PlaneRegion:
    """A side of the measured part, with what is known of it, on the mesh of ``count`` vertices."""
    from turnscan.shapes.primitives._budget import known

    told = known(g, r.plane, np.flatnonzero(r.inliers), moves)
    C, ways = told.covariance, np.eye(3)
    ways[:2, :2] = np.linalg.eigh(C[:2, :2])[1]
    inliers = np.zeros(count, dtype=np.bool_)
    inliers[back[r.inliers]] = True
    return PlaneRegion(
        replace(r.plane, covariance=ways.T @ C @ ways),
        inliers,
        r.area,
        float(np.sqrt(np.linalg.eigvalsh(told.own[:2, :2])[-1])),
        told.moves[:, :2] @ told.frame,
    )


def _find(mesh: Mesh, limit: float, turn: float, smallest: float, most: int) -> list[_Side]:
    from turnscan.shapes import _plane_kernels as kernels

    start, near = _neighbours(mesh)
    normals, rough = _smooth(mesh, start, near)
    seeds = max(limit, _NOISES * _flattest(rough))
    area = _vertex_area(mesh)
    least = smallest * float(area.sum())
    label = np.full(len(mesh.vertices), -1, dtype=np.int32)
    found: list[_Side] = []
    for seed in np.argsort(rough, kind="stable").astype(np.int64):
        if len(found) >= most or rough[seed] > seeds:
            break
        if label[seed] != -1:
            continue
        member = np.zeros(0, dtype=np.int64)
        centre, normal = mesh.vertices[seed], normals[seed]
        for _ in range(_ROUNDS):
            grown = kernels.grow(
                mesh.vertices, normals, start, near, label, seed, centre, normal, limit,
                float(np.cos(turn)),
            )  # fmt: skip
            if len(grown) < _LEAST or len(grown) <= len(member) * 1.001:
                break
            member = grown
            try:
                plane = _fit(mesh, member)
            except InputError:
                break
            centre = plane.centre
            normal = plane.normal if plane.normal @ normal > 0 else -plane.normal
        # A region too small is not tried again from its other vertices; a larger one may take them.
        label[member] = -2
        label[seed] = -2
        if len(member) < _LEAST or float(area[member].sum()) < least:
            continue
        region = _finish(mesh, normals, member, limit, turn)
        if _bent(mesh, region, limit):
            continue
        label[region.inliers] = len(found)
        found.append(region)
    sides = [
        r
        for r in _merged(mesh, normals, found, limit, turn)
        if r.area >= least and not _bent(mesh, r, limit)
    ]
    return sorted(sides, key=lambda r: -r.area)


def _finish(
    mesh: Mesh, normals: Floats, member: npt.NDArray[np.int64] | Bools, limit: float, turn: float
) -> _Side:
    """The plane of a region, fitted again without what lies off it, facing outward."""
    inside = np.zeros(len(mesh.vertices), dtype=np.bool_)
    inside[member] = True
    plane = _fit(mesh, np.flatnonzero(inside))
    for _ in range(_ROUNDS):
        keep = inside & (np.abs(plane.distances(mesh.vertices)) <= limit)
        keep &= np.abs(normals @ plane.normal) >= np.cos(turn)
        if keep.sum() < _LEAST:
            break
        plane = _fit(mesh, np.flatnonzero(keep))
        if (keep == inside).all():
            break
        inside = keep
    t = mesh.triangles[inside[mesh.faces].all(axis=1)]
    size = abs(float((vector_areas(t) @ plane.normal).sum()))
    facing = float((normals[inside] @ plane.normal).sum())
    if facing < 0:
        plane = Plane(
            -plane.normal, -plane.distance, plane.centre, plane.rms, plane.covariance, plane.count
        )
    return _Side(plane, inside, size)


def _bent(mesh: Mesh, r: _Side, limit: float) -> bool:
    """Whether a side bends, by how much closer a quadric follows its points than its plane does:
    up to a tolerance, strips of a cylinder are flat."""
    d = r.plane.distances(mesh.vertices[r.inliers])
    away = mesh.vertices[r.inliers] - r.plane.centre
    u, v = (away @ np.linalg.eigh(away.T @ away)[1][:, 1:]).T
    A = np.column_stack([np.ones(len(u)), u, v, u * u, u * v, v * v])
    left = d - A @ np.linalg.lstsq(A, d, rcond=None)[0]
    return bool(float(np.mean(d**2 - left**2)) > (_BEND * limit) ** 2)


def _fit(mesh: Mesh, vertices: npt.NDArray[np.int64]) -> Plane:
    return fit_plane(mesh.vertices[vertices], sigma_of(mesh, vertices))


def _merged(
    mesh: Mesh, normals: Floats, regions: list[_Side], limit: float, turn: float
) -> list[_Side]:
    """Regions that lie in one plane, joined: a side cut in two by a shadow is one side."""
    done: list[_Side] = []
    for region in sorted(regions, key=lambda r: -r.area):
        for i, other in enumerate(done):
            a, b = region.plane, other.plane
            apart = np.abs(b.distances(mesh.vertices[region.inliers])).mean()
            if a.normal @ b.normal > np.cos(turn / 3) and apart < limit:
                done[i] = _finish(mesh, normals, region.inliers | other.inliers, limit, turn)
                break
        else:
            done.append(region)
    return done


def _neighbours(mesh: Mesh) -> tuple[Ints, Ints]:
    """Vertices next to each vertex, as a compressed list: near[start[i]:start[i + 1]]."""
    a = mesh.faces[:, [0, 1, 2]].ravel().astype(np.int64)
    b = mesh.faces[:, [1, 2, 0]].ravel().astype(np.int64)
    v = len(mesh.vertices)
    keys = np.unique(np.concatenate([a * v + b, b * v + a]))
    start = np.searchsorted(keys // v, np.arange(v + 1))
    return start.astype(np.int32), (keys % v).astype(np.int32)


def _smooth(mesh: Mesh, start: Ints, near: Ints) -> tuple[Floats, Floats]:
    """Normals (v, 3) of local planes, outward, and how rough (v,) mm the surface is about them."""
    from turnscan.shapes import _plane_kernels as kernels

    first = np.nan_to_num(vertex_normals(mesh))
    normals, rough = kernels.local_planes(mesh.vertices, first, start, near, _reach(mesh))
    return normals, rough


def _reach(mesh: Mesh) -> float:
    """mm: how far a local plane reaches. Three of the longer sides of the faces."""
    t = mesh.triangles
    longest = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=-1).max(axis=1)
    return 3.0 * float(np.median(longest))


def _flattest(rough: Floats) -> float:
    """mm: roughness of the flatter half of the surface. Local planes of a coarse turn reach over
    edges: a side of three profiles is as rough as that in its middle, and more than its noise."""
    have = np.sort(rough[np.isfinite(rough)])
    return float(have[len(have) // 4]) if len(have) else 0.0


def _vertex_area(mesh: Mesh) -> Floats:
    """(v,) mm²: a third of the faces about each vertex."""
    size = np.linalg.norm(vector_areas(mesh.triangles), axis=1) / 3
    corners = mesh.faces.ravel()
    return np.asarray(np.bincount(corners, np.repeat(size, 3), minlength=len(mesh.vertices)), float)


@dataclass(frozen=True)
class PlaneAngle:
    """The angle between the outward normals of two planar faces."""

    first: int
    second: int
    """Index of the sides in the list they were given in."""
    angle: float
    """Radians, 0 to π."""
    sigma: float
    """Radians: standard uncertainty."""

    @property
    def off_square(self) -> float:
        """Radians by which the sides are not at right angles."""
        return abs(self.angle - np.pi / 2)

    @property
    def off_parallel(self) -> float:
        """Radians by which the sides are not parallel."""
        return min(self.angle, np.pi - self.angle)


def plane_angles(regions: Sequence[PlaneRegion]) -> list[PlaneAngle]:
    """The angle between every two planar faces; what turns both alike leaves it as it is."""
    out = []
    for i, a in enumerate(regions):
        for j in range(i + 1, len(regions)):
            b = regions[j]
            first, second = a.plane.normal, b.plane.normal
            edge = np.cross(first, second)
            across = float(np.linalg.norm(edge))
            angle = float(np.arctan2(across, first @ second))
            turned = np.cross(second, b.turns) - np.cross(first, a.turns)
            if across > _PARALLEL:
                common = turned @ (edge / across)
            else:  # any way that one turns against the other opens the angle
                common = np.linalg.norm(turned, axis=1)
            sigma = float(np.sqrt(a.own_sigma**2 + b.own_sigma**2 + common @ common))
            out.append(PlaneAngle(i, j, angle, sigma))
    return out

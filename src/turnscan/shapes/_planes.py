"""The planar faces of a measured part: regions grown on the mesh, and the angles between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.errors import InputError
from turnscan.mesh import Mesh, measured_vertices, submesh, vector_areas, vertex_normals
from turnscan.shapes._fit import fit_plane
from turnscan.shapes._forms import Plane
from turnscan.shapes._measure import sigma_of

_ROUNDS = 8
_LEAST = 12
"""Vertices that a plane must have at the least."""


@dataclass(frozen=True)
class PlaneRegion:
    """One planar face: its plane, normal pointing outward, and what belongs to it."""

    plane: Plane
    inliers: Bools
    """(v,) True for the vertices of the mesh that the plane was fitted to."""
    area: float
    """mm² of the faces whose corners all belong to it, laid into the plane."""

    def __post_init__(self) -> None:
        inliers = frozen(self.inliers, (None,), "PlaneRegion.inliers", np.bool_)
        object.__setattr__(self, "inliers", inliers)


def find_planes(
    mesh: Mesh,
    *,
    tolerance: float | None = None,
    turn: float = float(np.deg2rad(25.0)),
    smallest: float = 0.02,
    most: int = 24,
) -> list[PlaneRegion]:
    """The planar faces of a mesh, largest first.

    Regions grow over the mesh from its flattest places: a vertex joins where it lies within
    ``tolerance`` mm of the region's plane and its smoothed normal within ``turn`` radians; the
    plane is fitted anew as the region grows, and regions of one plane that touch it become one.
    ``tolerance`` None takes three times the noise that the mesh shows on its flat places.
    ``smallest`` is the least area of a side, as a part of the whole surface. Points further than
    ``tolerance`` from the final plane are left out of its fit; rms is over the points kept.

    Vertices that were not measured belong to no side; points weigh 1/sigma² where all know theirs.

    Raises InputError for a mesh without measured faces.
    """
    known = measured_vertices(mesh)
    if not known.all():
        whole = np.asarray(known[mesh.faces].all(axis=1), dtype=np.bool_)
        used = np.zeros(len(known), dtype=np.bool_)
        used[mesh.faces[whole]] = True
        part = submesh(mesh, whole)
        found = find_planes(part, tolerance=tolerance, turn=turn, smallest=smallest, most=most)
        return [replace(r, inliers=_among(used, r.inliers)) for r in found]
    if not len(mesh.faces):
        raise InputError("no faces that were measured", hint="measure a mesh with a surface")
    return _find(mesh, tolerance, turn, smallest, most)


def _among(used: Bools, inliers: Bools) -> Bools:
    """(v,) True for those of the ``used`` vertices that are ``inliers`` among them."""
    whole = np.zeros(len(used), dtype=np.bool_)
    whole[np.flatnonzero(used)[inliers]] = True
    return whole


def _find(
    mesh: Mesh, tolerance: float | None, turn: float, smallest: float, most: int
) -> list[PlaneRegion]:
    from turnscan.shapes import _plane_kernels as kernels

    start, near = _neighbours(mesh)
    normals, rough = _smooth(mesh, start, near)
    limit = tolerance if tolerance is not None else 3.0 * _noise(rough)
    area = _vertex_area(mesh)
    least = smallest * float(area.sum())
    label = np.full(len(mesh.vertices), -1, dtype=np.int32)
    found: list[PlaneRegion] = []
    for seed in np.argsort(rough, kind="stable").astype(np.int64):
        if len(found) >= most or rough[seed] > limit:
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
        label[region.inliers] = len(found)
        found.append(region)
    sides = [r for r in _merged(mesh, normals, found, limit, turn) if r.area >= least]
    return sorted(sides, key=lambda r: -r.area)


def _finish(
    mesh: Mesh, normals: Floats, member: npt.NDArray[np.int64] | Bools, limit: float, turn: float
) -> PlaneRegion:
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
    plane = _fit(mesh, np.flatnonzero(inside), size)
    facing = float((normals[inside] @ plane.normal).sum())
    if facing < 0:
        plane = Plane(
            -plane.normal, -plane.distance, plane.centre, plane.rms, plane.covariance, plane.count
        )
    return PlaneRegion(plane, inside, size)


def _fit(mesh: Mesh, vertices: npt.NDArray[np.int64], area: float | None = None) -> Plane:
    return fit_plane(mesh.vertices[vertices], sigma_of(mesh, vertices), area)


def _merged(
    mesh: Mesh, normals: Floats, regions: list[PlaneRegion], limit: float, turn: float
) -> list[PlaneRegion]:
    """Regions that lie in one plane, joined: a side cut in two by a shadow is one side."""
    done: list[PlaneRegion] = []
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


def _noise(rough: Floats) -> float:
    """mm: roughness of the flatter half of the surface."""
    have = np.sort(rough[np.isfinite(rough)])
    return max(float(have[len(have) // 4]) if len(have) else 0.0, 1e-6)


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
    """Radians: standard uncertainty from the scatter of the points."""

    @property
    def off_square(self) -> float:
        """Radians by which the sides are not at right angles."""
        return abs(self.angle - np.pi / 2)

    @property
    def off_parallel(self) -> float:
        """Radians by which the sides are not parallel."""
        return min(self.angle, np.pi - self.angle)


def plane_angles(regions: Sequence[PlaneRegion]) -> list[PlaneAngle]:
    """The angle between every two planar faces."""
    out = []
    for i, a in enumerate(regions):
        for j in range(i + 1, len(regions)):
            b = regions[j].plane
            cross = float(np.linalg.norm(np.cross(a.plane.normal, b.normal)))
            angle = float(np.arctan2(cross, a.plane.normal @ b.normal))
            sigma = float(np.hypot(a.plane.normal_sigma, b.normal_sigma))
            out.append(PlaneAngle(i, j, angle, sigma))
    return out

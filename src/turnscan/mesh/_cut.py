"""Cut: a mesh by a plane, exactly, and the section closed where that is wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.errors import InputError
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._parts import measured, submesh

_ON_PLANE = 1e-7
"""Part of the mesh's size within which a vertex counts as lying in the plane."""


@dataclass(frozen=True, eq=False)
class Clip:
    """What a cut changes: faces that go, vertices and faces that come."""

    gone: Bools
    """(f,) True for the faces beyond the plane and those that it crosses."""
    near: Ints
    """(k,) for each new vertex, the nearer end of the side that it is on."""
    vertices: Floats
    """(k, 3) mm: where sides cross the plane."""
    faces: Ints
    """(t, 3) what is left of the crossed faces, then the caps; from v on: new vertices."""
    measured: Bools
    """(t,) False for caps, and for what is left of faces that were not measured."""
    caps: int
    """Closed sections that were capped."""


def cut(mesh: Mesh, normal: npt.ArrayLike, distance: float, cap: bool = True) -> Mesh:
    """The part of a mesh on the side of the plane n·x = ``distance`` that ``normal`` points to.

    Crossed faces are clipped exactly: nothing that is left moves. ``cap`` closes the section with
    flat faces that are not ``measured``; sections within sections leave their inside open, as a
    wall has it. New vertices take the provenance of the nearer end of their side. Raises
    InputError for a normal without direction.
    """
    c = clip(mesh, normal, distance, cap)
    if not c.gone.any():
        return mesh
    p = mesh.provenance
    if p is not None:
        index = np.concatenate([np.arange(len(mesh.vertices)), c.near])
        p = Provenance(p.sigma[index], p.laser[index], p.step[index], p.line[index], p.lasers)
    whole = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, c.vertices]),
        faces=np.concatenate([mesh.faces, c.faces]),
        provenance=p,
        colour=None if mesh.colour is None else np.concatenate([mesh.colour, mesh.colour[c.near]]),
        measured=np.concatenate([measured(mesh), c.measured]),
    )
    return submesh(whole, np.concatenate([~c.gone, np.ones(len(c.faces), dtype=np.bool_)]))


def clip(mesh: Mesh, normal: npt.ArrayLike, distance: float, cap: bool = True) -> Clip:
    """What `cut` changes, in the numbers of the mesh. Raises InputError like it."""
    unit, height, side = _heights(mesh, normal, distance)
    corner = side[mesh.faces]
    above, below = (corner > 0).any(axis=1), (corner < 0).any(axis=1)
    crossed = np.flatnonzero(above & below)
    (faces, of), met = _left(mesh, height, side, crossed)
    parts, kinds, caps = [faces], [measured(mesh)[crossed[of]]], 0
    if cap:
        whole = np.concatenate([mesh.faces[above & ~below], faces])
        lids, caps = _lids(np.concatenate([mesh.vertices, met.points]), whole, side, unit)
        parts.append(lids)
        kinds.append(np.zeros(len(lids), dtype=np.bool_))
    gone = np.asarray(~above | below)
    return Clip(gone, met.near, met.points, np.concatenate(parts), np.concatenate(kinds), caps)


@dataclass(frozen=True, eq=False)
class Section:
    """One loop of a plane through a mesh."""

    points: Floats
    """(m, 3) mm, along the loop, which goes back from the last to the first."""
    near: Ints
    """(m,) for each point the nearest vertex of the side it is on."""
    bulge: Floats
    """(m,) mm²: t(1 − t)e² for a point at share t of a side whose length, seen along the normal, is
    e. Where the ends of the side lie on a cylinder of radius r round the normal, the point's
    distance from the axis is √(r² − bulge): it lies on a chord."""
    measured: Bools
    """(m,) False for a point of the filling of a gap, which was not measured."""


def sections(mesh: Mesh, normal: npt.ArrayLike, distance: float) -> list[Section]:
    """The loops in which the plane n·x = ``distance`` meets a mesh, the longest first.

    Where the surface is open, a loop goes straight on to where it begins again. Raises InputError
    like `cut`.
    """
    unit, height, side = _heights(mesh, normal, distance)
    corner = side[mesh.faces]
    above, below = (corner > 0).any(axis=1), (corner < 0).any(axis=1)
    (faces, _), met = _left(mesh, height, side, np.flatnonzero(above & below))
    vertices = np.concatenate([mesh.vertices, met.points])
    index = np.concatenate([np.arange(len(mesh.vertices), dtype=np.int32), met.near])
    along = mesh.vertices[met.second] - mesh.vertices[met.first]
    across = (along**2).sum(axis=1) - (along @ unit) ** 2
    bulge = np.zeros(len(vertices))
    bulge[len(mesh.vertices) :] = met.share * (1.0 - met.share) * across
    known = np.zeros(len(vertices), dtype=np.bool_)
    known[mesh.faces[measured(mesh)]] = True
    known[len(mesh.vertices) :] = met.measured
    loops = _loops(vertices, np.concatenate([mesh.faces[above & ~below], faces]), side)
    found = [Section(vertices[k], index[k], bulge[k], known[k]) for k in loops]
    return sorted(found, key=lambda s: -_length(s.points))


def _length(points: Floats) -> float:
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def _heights(
    mesh: Mesh, normal: npt.ArrayLike, distance: float
) -> tuple[Floats, Floats, npt.NDArray[np.int8]]:
    """The unit normal; above the plane, mm, and on which side of it, each vertex lies."""
    n = np.asarray(normal, dtype=np.float64).reshape(-1)
    if n.shape != (3,) or not np.isfinite(n).all() or not np.linalg.norm(n) > 0:
        raise InputError(f"a plane with the normal {n.tolist()}", hint="give three numbers")
    unit = n / np.linalg.norm(n)
    size = float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0
    height = mesh.vertices @ unit - distance
    side = np.where(np.abs(height) <= _ON_PLANE * size, 0, np.sign(height)).astype(np.int8)
    return unit, height, side


@dataclass(frozen=True, eq=False)
class _Met:
    """Where sides cross the plane."""

    first: npt.NDArray[np.int64]
    second: npt.NDArray[np.int64]
    share: Floats
    """Of the way from the first end to the second."""
    points: Floats
    measured: Bools
    """Whether one of the faces about the side was measured."""

    @property
    def near(self) -> Ints:
        return np.where(self.share <= 0.5, self.first, self.second).astype(np.int32)


def _left(
    mesh: Mesh, height: Floats, side: npt.NDArray[np.int8], crossed: npt.NDArray[np.intp]
) -> tuple[tuple[Ints, npt.NDArray[np.intp]], _Met]:
    """What is left of the crossed faces, and which of them each piece is of; the new vertices."""
    v = len(mesh.vertices)
    faces = mesh.faces[crossed]
    a, b = faces, faces[:, [1, 2, 0]]
    cuts = side[a] * side[b] < 0
    low, high = np.minimum(a, b)[cuts].astype(np.int64), np.maximum(a, b)[cuts].astype(np.int64)
    keys, number = np.unique(low * v + high, return_inverse=True)
    first, second = keys // max(v, 1), keys % max(v, 1)
    share = height[first] / (height[first] - height[second]) if len(keys) else np.zeros(0)
    start, end = mesh.vertices[first], mesh.vertices[second]
    known = np.zeros(len(keys), dtype=np.bool_)
    known[number[np.broadcast_to(measured(mesh)[crossed][:, None], cuts.shape)[cuts]]] = True
    met = _Met(first, second, share, start + share[:, None] * (end - start), known)
    on = np.full((len(faces), 3), -1, dtype=np.int64)
    on[cuts] = v + number
    # Round each face: its corners that stay, and the new vertex on each side that is cut.
    ring = np.stack([np.where(side[a] >= 0, a, -1), on], axis=2).reshape(-1, 6)
    order = np.argsort(ring < 0, axis=1, kind="stable")
    ring = np.take_along_axis(ring, order, axis=1)[:, :4]
    four = np.flatnonzero(ring[:, 3] >= 0)
    pieces = np.concatenate([ring[:, :3], ring[four][:, [0, 2, 3]]]).astype(np.int32)
    of = np.concatenate([np.arange(len(faces)), four])
    return (pieces.reshape(-1, 3), of), met


def _lids(
    vertices: Floats, faces: Ints, side: npt.NDArray[np.int8], unit: Floats
) -> tuple[Ints, int]:
    """Faces that close the sections of ``faces`` with the plane, and how many sections.

    Their corners are those of the sections, and each side of a section has one of them (Manifold).
    """
    import manifold3d

    loops = _loops(vertices, faces, side)
    lead = np.eye(3)[int(np.argmin(np.abs(unit)))]
    e1 = np.cross(unit, lead)
    e1 /= np.linalg.norm(e1)
    # Seen from outside, which is against the normal of the side that stays.
    xy = vertices @ np.stack([np.cross(unit, e1), e1], axis=-1)
    bounds = _bounding(loops, xy)
    if not bounds:
        return np.zeros((0, 3), dtype=np.int32), len(loops)
    lids = manifold3d.triangulate([xy[loop] for loop in bounds])
    return np.concatenate(bounds)[lids].astype(np.int32), len(loops)


def _bounding(loops: list[Ints], xy: Floats) -> list[Ints]:
    """The loops round material, and those within one: an inner one alone bounds nothing."""
    from turnscan.mesh import _cut_kernels as kernels

    area = [_area(xy[loop]) for loop in loops]
    outer = [(loop, a) for loop, a in zip(loops, area, strict=True) if a > 0]
    return [
        loop
        for loop, a in zip(loops, area, strict=True)
        if a > 0
        or any(big > -a and kernels.contains(xy[round_it], xy[loop[0]]) for round_it, big in outer)
    ]


def _loops(vertices: Floats, faces: Ints, side: npt.NDArray[np.int8]) -> list[Ints]:
    """The borders of faces that lie in the plane, each running against the sides it meets."""
    from turnscan.mesh import _cut_kernels as kernels

    on = np.ones(len(vertices), dtype=np.bool_)
    on[: len(side)] = side == 0
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    flat = on[a] & on[b]
    begin, end = b[flat].astype(np.int64), a[flat].astype(np.int64)
    lonely = ~np.isin(end * len(vertices) + begin, begin * len(vertices) + end)
    if not lonely.any():
        return []
    begin, end = begin[lonely], end[lonely]
    order = np.argsort(begin, kind="stable")
    following = np.searchsorted(begin[order], end)
    heads = np.flatnonzero(~np.isin(begin, end))
    row, starts = kernels.chains(begin, end, order, following, heads, vertices)
    return [loop for loop in np.split(row, starts[1:]) if len(loop) >= 3]


def _area(xy: Floats) -> float:
    x, y = (xy - xy.mean(axis=0)).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0

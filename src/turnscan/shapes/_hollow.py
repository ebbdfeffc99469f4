"""What fillings may hide: bores and pockets of which nothing but the beginning was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Caster, Mesh, measured_vertices, submesh, vector_areas
from turnscan.points import working_volume
from turnscan.shapes._added import border_normals, fillings, usual_side
from turnscan.shapes._shared import View
from turnscan.surface.holes import ScanCoverage, reached

_PLACES = 400
"""Places of one filling that are asked, at most."""
_ABOUT = 40
"""Faces of a filling whose mean tells which way it looks at a place."""
_CLEAR = 1.5
"""Samples from all that was measured within which a place says nothing: there the clean-up may have
taken a point of the surface. What is said of the middle of a filling holds for its rim."""
_SECTORS, _WALLS, _FACING = 12, 2, 0.5
"""Directions in which the border about a place is looked at, those in which it must be a wall, at
least, and the cosine from which it is: it looks towards the place at less than 60°."""
_OPEN = 5.0 / 6.0
"""Of the depth that a hollow has on the average where the far side is filled, too: both depths are
unknown, and where they meet the bore goes through."""
_VESSEL = 0.5
"""Share of the part's silhouette from which a filling is the lid of a vessel: that its inside is
full was chosen by whoever closed it."""


class _Asked(NamedTuple):
    """Places on the fillings of a mesh."""

    at: Floats
    """(m, 3) mm."""
    normal: Floats
    """(m, 3) outward, of the filling about each."""
    area: Floats
    """(m,) mm² across it that each stands for."""
    patch: Ints
    """(m,) number of the filling."""
    hollow: Bools
    """(m,) True where the border that was measured is in part a wall before the place."""


def hollow_sigma(mesh: Mesh, views: Sequence[View]) -> float:
    """mm³ by which a closed mesh may be too large for what its fillings hide.

    A place on a filling that was in the light and in sight at one moment, where no surface was
    found, hangs in the air; where the measured surface goes down into it as a wall, as at the mouth
    of a bore, it covers a hollow, and none knows how deep: it may end at once, or on the far side
    of the part. Taken as equally likely in between, a filling of area A over a depth D is too large
    by AD/2 ± AD/√12. Where the far side is a filling as well, a hollow may come from there; with
    both depths unknown the two take 5/6 of AD between them. All err one way, so the means add up,
    the rest adds up with its signs unknown; given is the root mean square. Nothing without the
    ``views`` of the scan.
    """
    real = mesh.measured
    if real is None or real.all() or not real.any() or not views:
        return 0.0
    asked = _places(mesh, real)
    which = np.flatnonzero(asked.hollow)
    if not len(which):
        return 0.0
    scans = [
        (ScanCoverage(v.rig, v.grid, working_volume(v.rig, v.grid.laser)), v.pose) for v in views
    ]
    seen = reached(submesh(mesh, real), asked.at[which], asked.normal[which], scans)
    which = which[seen]
    if not len(which):
        return 0.0
    most = asked.area[which] * _depths(mesh, real, asked.at[which], asked.normal[which])
    each = np.bincount(asked.patch[which], most)
    return float(np.sqrt((each.sum() / 2) ** 2 + (each**2).sum() / 12))


def _places(mesh: Mesh, real: Bools) -> _Asked:
    """Places spread evenly over the fillings that are no lids of vessels."""
    from scipy.spatial import cKDTree

    known = measured_vertices(mesh)
    normals = border_normals(mesh, known, real)
    area = vector_areas(mesh.triangles)
    size = np.linalg.norm(area, axis=1)
    middle = mesh.triangles.mean(axis=1)
    sample = usual_side(mesh.triangles[real])
    measured = cKDTree(mesh.vertices[np.unique(mesh.faces[real])])
    out = [
        _Asked(
            np.zeros((0, 3)),
            np.zeros((0, 3)),
            np.zeros(0),
            np.zeros(0, np.int32),
            np.zeros(0, np.bool_),
        )
    ]
    for number, (mine, border) in enumerate(fillings(mesh, known, real)):
        ends = np.cumsum(size[mine])
        count = int(min(_PLACES, len(mine), np.ceil(ends[-1] / sample**2)))
        at = (np.arange(count) + 0.5) / count * ends[-1]
        some = mine[np.minimum(np.searchsorted(ends, at), len(mine) - 1)]
        some = some[measured.query(middle[some])[0] > _CLEAR * sample]
        if not len(some) or _is_lid(area, area[mine].sum(axis=0)):
            continue
        near = cKDTree(middle[mine]).query(middle[some], min(_ABOUT, len(mine)))[1]
        way = area[mine][near.reshape(len(some), -1)].sum(axis=1)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
        across = np.einsum("ij,ij->i", way, area[some]) / np.maximum(size[some], 1e-300)
        out.append(
            _Asked(
                middle[some], way, ends[-1] / len(some) * np.maximum(across, 0.0),
                np.full(len(some), number, np.int32),
                _walled(middle[some], way, mesh.vertices[border], normals[border]),
            )
        )  # fmt: skip
    return _Asked(*(np.concatenate(part) for part in zip(*out, strict=True)))


def _is_lid(area: Floats, whole: Floats) -> bool:
    """Whether a filling of vector area ``whole`` (3,) covers most of what faces (f, 3) hide along
    it."""
    silhouette = float(np.abs(np.einsum("fi,i->f", area, whole)).sum()) / 2
    return float(whole @ whole) > _VESSEL * silhouette


def _walled(places: Floats, up: Floats, border: Floats, normals: Floats) -> Bools:
    """(m,) True for places (m, 3) on a filling that looks along ``up`` (m, 3), before which a
    border (b, 3) of normals (b, 3) is a wall."""
    away = places[:, None] - border
    far = np.linalg.norm(away, axis=2)
    facing = np.einsum("mbi,bi->mb", away, normals) / np.maximum(far, 1e-300)
    e1 = np.cross(up, np.eye(3)[np.argmin(np.abs(up), axis=1)])
    e2 = np.cross(up, e1)
    x, y = (np.einsum("mbi,mi->mb", away, e) for e in (e1, e2))
    sector = np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * _SECTORS)
    walls = np.zeros(len(places), dtype=np.int64)
    for k in range(_SECTORS):
        own = np.where(sector == k, far, np.inf)
        nearest = own.argmin(axis=1)[:, None]
        there = np.isfinite(np.take_along_axis(own, nearest, axis=1)[:, 0])
        walls += there & (np.take_along_axis(facing, nearest, axis=1)[:, 0] > _FACING)
    return np.asarray(walls >= _WALLS)


def _depths(mesh: Mesh, real: Bools, at: Floats, normals: Floats) -> Floats:
    """(m,) mm from places (m, 3) down to the far side of a part, `_OPEN` of it where that is
    filled."""
    caster = Caster(mesh.vertices, mesh.faces)
    lift = 1e-4 * float(np.ptp(mesh.vertices, axis=0).max())
    face = caster.first_hits_between(at - lift * normals, -normals)
    t = mesh.triangles[face]
    across = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    slope = -np.einsum("ij,ij->i", normals, across)
    ahead = np.einsum("ij,ij->i", t[:, 0] - at, across)
    deep = np.where((face >= 0) & (slope > 0), ahead / np.where(slope == 0, 1.0, slope), 0.0)
    return np.asarray(np.where(real[face], deep, _OPEN * deep))

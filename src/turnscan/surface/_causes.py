"""Why a hole is there: from the rig, the surface that was measured, and what the frames showed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.points import RangeGrid, Volume
from turnscan.rig import Rig, rotation_z
from turnscan.stripes import Orientation, StripeFlag
from turnscan.surface._cast import Caster
from turnscan.surface._fill import patches, with_patches
from turnscan.surface._grid_mesh import vertex_normals
from turnscan.surface._holes import Cause, Hole
from turnscan.surface._mesh import Mesh

_CAUSES: tuple[Cause, ...] = get_args(Cause)
LASER, CAMERA, DARK, SATURATED, OUTSIDE, AMBIGUOUS, REMOVED, UNKNOWN = range(len(_CAUSES))
_GRAZING = float(np.cos(np.deg2rad(80.0)))
"""What is lit or seen further from face-on than this counts as hidden (as `Tears.grazing`)."""
_SMALL = 6.0
"""Usual sides of faces up to which a hole's patch has no direction of its own."""
_SAMPLES = 48
"""Places in a hole that are asked, at most."""
_ROOM = 4000
"""Places that are asked at once, which bounds the memory."""


@dataclass(frozen=True)
class Sought:
    """What one laser's scan could have found, and what it did."""

    rig: Rig
    grid: RangeGrid
    """As cleaned, with a flag for every line of the pictures: not resampled."""
    volume: Volume
    """What was kept of the scan."""
    orientation: Orientation = "vertical"


@dataclass(frozen=True)
class _Places:
    """Places on the flat patches that close the holes."""

    at: Floats
    """(m, 3) mm, lifted off the patch."""
    normal: Floats
    """(m, 3) outward."""
    start: Floats
    """(m,) mm: what is nearer than this hides nothing."""
    hole: Ints
    """(m,)."""

    def part(self, which: slice) -> _Places:
        return _Places(self.at[which], self.normal[which], self.start[which], self.hole[which])


def explain(mesh: Mesh, found: Sequence[Hole], views: Sequence[Sought]) -> list[Hole]:
    """The holes of an open mesh with their cause; without views, as they are.

    Each hole is closed by a flat patch, and places on it are followed through the scan (ALGORITHMS
    §5.3): at each table angle that carries a place through a laser's sheet, was it in the picture
    and in the volume, did the camera see it and did the light reach it, past the measured surface?
    Where both did, the frame says what was wrong with the light of that line. The place votes for
    what came nearest to a measurement; the most votes decide. What neither reached counts as
    hidden from the laser.
    """
    if not found or not views:
        return list(found)
    made = patches(mesh, [h.loop for h in found], "flat")
    closed = with_patches(mesh, made, "flat")
    owner = np.repeat(np.arange(len(found)), [len(p.faces) for p in made]).astype(np.int32)
    places = _places(mesh, closed, owner, found)
    caster = Caster(mesh.vertices, mesh.faces)
    best = np.full(len(places.at), UNKNOWN, dtype=np.int32)
    for start in range(0, len(best), _ROOM):
        part = slice(start, start + _ROOM)
        best[part] = _votes(places.part(part), views, caster)
    count = np.zeros((len(found), len(_CAUSES)))
    np.add.at(count, (places.hole, best), 1.0)
    return [replace(h, cause=_CAUSES[k]) for h, k in zip(found, count.argmax(axis=1), strict=True)]


def _places(mesh: Mesh, closed: Mesh, owner: Ints, found: Sequence[Hole]) -> _Places:
    """Places spread evenly over the patches, which ``closed`` adds; more in a larger hole."""
    t = closed.triangles[len(mesh.faces) :]
    cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    total = np.bincount(owner, area, len(found))
    sides = mesh.triangles[:, 0] - mesh.triangles[:, 1]
    usual = float(np.median(np.linalg.norm(sides, axis=1)))
    wanted = np.clip(np.ceil(4 * total / usual**2), 4, _SAMPLES).astype(np.int64)
    # Faces laid end to end, each hole of length `wanted`: a place at every half.
    share = area / np.maximum(total, 1e-30)[owner] * wanted[owner]
    ends = np.cumsum(share)
    at = np.arange(int(wanted.sum())) + 0.5
    face = np.minimum(np.searchsorted(ends, at), len(t) - 1)
    order = np.arange(1, len(at) + 1)
    plastic = 1.3247179572447460
    r1, r2 = np.sqrt((order / plastic) % 1.0), (order / plastic**2) % 1.0
    weights = np.stack([1.0 - r1, r1 * (1.0 - r2), r1 * r2], axis=-1)
    X = np.einsum("ni,nij->nj", weights, t[face])
    normal = cross / np.maximum(2 * area, 1e-30)[:, None]
    hole = owner[face].astype(np.int32)
    small = np.array([h.size for h in found]) < _SMALL * usual
    normal = np.where(small[owner, None], _about(mesh, found)[owner], normal)
    size = np.array([h.size for h in found])[hole]
    n = normal[face]
    lift = np.clip(0.05 * size, 0.25 * usual, usual)
    # A flat patch lies below a bulging surface, whose rim then stands before it: not as far off as
    # half the hole's width, which is what a long narrow shadow has little of.
    width = np.array([4 * h.area / max(h.perimeter, 1e-12) for h in found])[hole]
    start = np.maximum(0.5 * width, usual)
    return _Places(X + lift[:, None] * n, n, start, hole)


def _about(mesh: Mesh, found: Sequence[Hole]) -> Floats:
    """(h, 3) the mean normal of the surface about each hole: a small patch's own is chance."""
    normals = np.nan_to_num(vertex_normals(mesh))
    mean = np.stack([normals[h.loop].mean(axis=0) for h in found])
    return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None])


def _votes(places: _Places, views: Sequence[Sought], caster: Caster) -> Ints:
    """(m,) for each place the cause that came nearest to a measurement."""
    m = len(places.at)
    seen, lit, out, turned = np.zeros((4, m), dtype=np.bool_)
    light = np.full(m, -1, dtype=np.int32)
    for view in views:
        within = view.volume.contains(places.at)
        out |= ~within
        c = _crossings(view, places)
        ok = c.inside & within[c.place]
        s = np.zeros(len(c.place), dtype=np.bool_)
        s[ok] = _reached(caster, places, c.place[ok], c.eye[ok])
        b = np.zeros(len(c.place), dtype=np.bool_)
        b[ok] = _reached(caster, places, c.place[ok], c.source[ok])
        near = _faces(places, c.place, c.eye) | _faces(places, c.place, c.source)
        np.logical_or.at(turned, c.place, near)
        np.logical_or.at(seen, c.place, s)
        np.logical_or.at(lit, c.place, b)
        np.logical_or.at(out, c.place, ~c.inside)
        both = np.flatnonzero(s & b)
        why = _light(view.grid, c.step[both], c.line[both], places.at[c.place[both]])
        light[c.place[both]] = np.maximum(light[c.place[both]], why)
    if not any(view.grid.closed for view in views):
        out |= ~turned  # the scan ended before its turn came
    vote = np.full(m, LASER, dtype=np.int32)
    vote[out & ~seen & ~lit] = OUTSIDE
    vote[lit & ~seen] = CAMERA
    vote[seen] = LASER
    return np.where(light >= 0, light, vote)


@dataclass(frozen=True)
class _Crossings:
    """Moments at which places pass a laser's sheet."""

    place: Ints
    """(c,)."""
    step: Ints
    """(c,) index of the nearest step of the grid."""
    line: Ints
    """(c,) line of the picture, within the grid."""
    inside: Bools
    """(c,) True in the picture."""
    eye: Floats
    """(c, 3) mm: camera, object's frame."""
    source: Floats
    """(c, 3) mm: laser, object's frame."""


def _crossings(view: Sought, places: _Places) -> _Crossings:
    grid, rig = view.grid, view.rig
    sheet, T, camera = rig.sheet(grid.laser), rig.T_camera_table, rig.camera
    closed = grid.closed and len(grid.steps) >= 3
    turn = rotation_z(grid.angles)
    off = np.stack([sheet.distance(T.apply(places.at @ R.T)) for R in turn])
    after = np.roll(off, -1, axis=0) if closed else off[1:]
    k, place = np.nonzero((off[: len(after)] < 0) != (after < 0))
    share = off[k, place] / (off[k, place] - after[k, place])
    angles = np.unwrap(np.append(grid.angles, grid.angles[:1]))
    back = rotation_z(-(angles[k] + share * (angles[k + 1] - angles[k])))
    X = T.apply(np.einsum("cji,cj->ci", back, places.at[place]))
    uv = camera.project(X)
    with np.errstate(invalid="ignore"):
        inside = ((uv > -0.5) & (uv < (camera.width - 0.5, camera.height - 0.5))).all(axis=1)
    across = 1 if view.orientation == "vertical" else 0
    line = np.clip(np.nan_to_num(np.rint(uv[:, across])), 0, grid.flags.shape[1] - 1)
    from_table = T.inverse()
    return _Crossings(
        place.astype(np.int32),
        ((k + (share > 0.5)) % len(grid.steps)).astype(np.int32),
        line.astype(np.int32),
        np.asarray(inside),
        back @ from_table.translation,
        back @ from_table.apply(rig.light_source(grid.laser)),
    )


def _faces(places: _Places, which: Ints, end: Floats) -> Bools:
    """(c,) True where a place is turned towards the end, and not too flatly."""
    way = end - places.at[which]
    up = np.einsum("ij,ij->i", way, places.normal[which])
    return np.asarray(up > _GRAZING * np.linalg.norm(way, axis=1))


def _reached(caster: Caster, places: _Places, which: Ints, end: Floats) -> Bools:
    """(c,) True where a place is turned towards the end and nothing stands between."""
    out = _faces(places, which, end)
    at, end = which[out], end[out]
    way = end - places.at[at]
    skip = places.start[at] / np.linalg.norm(way, axis=1)
    out[out] = caster.visible(places.at[at] + skip[:, None] * way, places.normal[at], end)
    return out


def _light(grid: RangeGrid, step: Ints, line: Ints, at: Floats) -> Ints:
    """(c,) what was wrong with the light where the camera saw a lit place."""
    flags = grid.flags[step, line]
    out = np.full(len(step), DARK, dtype=np.int32)
    missing = (flags & (StripeFlag.DARK | StripeFlag.OUTSIDE)) != 0
    out[~missing] = REMOVED
    out[missing & ((flags & StripeFlag.AMBIGUOUS) != 0)] = AMBIGUOUS
    out[(flags & StripeFlag.SATURATED) != 0] = SATURATED
    return out

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
_BOTH = len(_CAUSES)
"""Hidden from the laser and from the camera: counts for either."""
_GRAZING = float(np.cos(np.deg2rad(80.0)))
"""What is lit or seen further from face-on than this counts as hidden (as `Tears.grazing`)."""
_HINT = 1e-3
"""Weight of a place whose own sample was measured: it says something where no other does."""
_MARGIN = 2.0
"""Usual sides of faces by which a surface ends before the volume does: a sample, and clean-up."""
_SMALL = 6.0
"""Usual sides of faces up to which a hole's patch has no direction of its own."""
_SAMPLES = 48
"""Places in a hole that are asked, at most."""
_RIM = 100
"""Corners of a rim that tell how the surface goes on, about."""
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
class _Scene:
    """What was measured, and rays against it."""

    mesh: Mesh
    caster: Caster


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
    """(m,), ascending."""
    margin: float
    """mm: what is nearer to a sample may be it, and what is nearer to the end of the volume lies
    beyond what is measured of it."""

    def part(self, which: slice) -> _Places:
        at, normal = self.at[which], self.normal[which]
        return _Places(at, normal, self.start[which], self.hole[which], self.margin)


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
    scene = _Scene(mesh, Caster(mesh.vertices, mesh.faces))
    count = np.zeros((len(found), _BOTH + 1))
    for start in range(0, len(places.at), _ROOM):
        part = places.part(slice(start, start + _ROOM))
        best, weight = _votes(part, views, scene)
        np.add.at(count, (part.hole, best), weight)
    count[:, [LASER, CAMERA]] += count[:, _BOTH, None]
    best = count[:, :_BOTH].argmax(axis=1)
    return [replace(h, cause=_CAUSES[k]) for h, k in zip(found, best, strict=True)]


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
    rise, rim = _rims(mesh, found, X, n, hole)
    at = X + (lift + np.clip(rise, 0.0, 0.25 * width))[:, None] * n
    start = np.maximum(0.5 * width, usual)
    # The border of an island bounds what is about it: a patch over it would lie on the island.
    normals, outward = _about_rims(mesh, found)
    island = np.einsum("ij,ij->i", n, normals[rim]) < -0.5
    beyond = mesh.vertices[rim] + _MARGIN * usual * outward[rim] + 0.25 * usual * normals[rim]
    at[island], n[island], start[island] = beyond[island], normals[rim][island], usual
    return _Places(at, n, start, hole, _MARGIN * usual)


def _rims(
    mesh: Mesh, found: Sequence[Hole], X: Floats, n: Floats, hole: Ints
) -> tuple[Floats, Ints]:
    """How far (m,) mm the surface about a hole would rise over places on its patch; nearest corner.

    A cap rises half as high as the tangent planes of its rim, here weighted by their inverse
    squared distance. Rims that turn down by more than 60° are edges and say nothing.
    """
    normals = np.nan_to_num(vertex_normals(mesh))
    rise, rim = np.zeros(len(X)), np.zeros(len(X), dtype=np.int32)
    ends = np.searchsorted(hole, np.arange(len(found) + 1))
    for h, begin, end in zip(found, ends[:-1], ends[1:], strict=True):
        loop = h.loop[:: max(1, len(h.loop) // _RIM)]
        way = mesh.vertices[loop] - X[begin:end, None]
        tilt = n[begin:end] @ normals[loop].T
        near = 1.0 / np.maximum(np.einsum("mli,mli->ml", way, way), 1e-12)
        up = np.einsum("mli,li->ml", way, normals[loop]) / np.maximum(tilt, 0.5)
        rise[begin:end] = 0.5 * np.sum(near * up * (tilt > 0.5), axis=1) / near.sum(axis=1)
        rim[begin:end] = loop[near.argmax(axis=1)]
    return rise, rim


def _about_rims(mesh: Mesh, found: Sequence[Hole]) -> tuple[Floats, Floats]:
    """Normals (v, 3) of the vertices, and (v, 3) along the surface away from it at the borders."""
    normals = np.nan_to_num(vertex_normals(mesh))
    along = np.zeros_like(mesh.vertices)
    for h in found:
        corners = mesh.vertices[h.loop]
        along[h.loop] = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
    outward = np.cross(along, normals)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    return normals, np.asarray(outward / np.maximum(length, 1e-12))


def _about(mesh: Mesh, found: Sequence[Hole]) -> Floats:
    """(h, 3) the mean normal of the surface about each hole: a small patch's own is chance."""
    normals = np.nan_to_num(vertex_normals(mesh))
    mean = np.stack([normals[h.loop].mean(axis=0) for h in found])
    return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None])


def _votes(places: _Places, views: Sequence[Sought], scene: _Scene) -> tuple[Ints, Floats]:
    """(m,) for each place the cause that came nearest to a measurement, and its weight."""
    m = len(places.at)
    seen, lit, out, turned, measured, faint = np.zeros((6, m), dtype=np.bool_)
    light = np.full(m, -1, dtype=np.int32)
    for view in views:
        within = view.volume.contains(places.at)
        out |= ~_inner(view.volume, places.margin).contains(places.at)
        c = _crossings(view, places)
        ok = c.inside & within[c.place]
        s = np.zeros(len(c.place), dtype=np.bool_)
        s[ok] = _reached(scene.caster, places, c.place[ok], c.eye[ok])
        b = np.zeros(len(c.place), dtype=np.bool_)
        b[ok] = _reached(scene.caster, places, c.place[ok], c.source[ok])
        faces = _faces(places, c.place, c.eye) | _faces(places, c.place, c.source)
        np.logical_or.at(turned, c.place, faces)
        np.logical_or.at(seen, c.place, s)
        np.logical_or.at(lit, c.place, b)
        np.logical_or.at(out, c.place, ~c.inside)
        both = np.flatnonzero(s & b).astype(np.int32)
        faint[c.place[both]] = True
        near = _sampled(view.grid, places.at[c.place[both]], c.step[both], c.line[both])
        np.logical_or.at(measured, c.place[both], near < places.margin)
        both = both[~_in_air(view, places, scene, c.part(both))]
        why = _light(view.grid, c.step[both], c.line[both])
        np.maximum.at(light, c.place[both], why)
    if not any(view.grid.closed for view in views):
        out |= ~turned  # the scan ended before its turn came
    vote = np.full(m, _BOTH, dtype=np.int32)
    vote[out & ~seen & ~lit] = OUTSIDE
    vote[lit & ~seen] = CAMERA
    vote[seen & ~lit] = LASER
    vote[measured] = REMOVED
    known = light >= 0
    return np.where(known, light, vote), np.where(faint & ~known, _HINT, 1.0)


def _inner(volume: Volume, margin: float) -> Volume:
    """What is left of a volume behind a margin; at least its middle."""
    half = min(margin, (volume.z_max - volume.z_min) / 4)
    r = max(volume.r_max - margin, volume.r_max / 2)
    return Volume(r, volume.z_min + half, volume.z_max - half)


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

    def part(self, which: Ints) -> _Crossings:
        place, step, line = self.place[which], self.step[which], self.line[which]
        eye, source = self.eye[which], self.source[which]
        return _Crossings(place, step, line, self.inside[which], eye, source)


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
    from_table = T.inverse()
    return _Crossings(
        place.astype(np.int32),
        ((k + (share > 0.5)) % len(grid.steps)).astype(np.int32),
        _line_of(view, uv),
        np.asarray(inside),
        back @ from_table.translation,
        back @ from_table.apply(rig.light_source(grid.laser)),
    )


def _line_of(view: Sought, uv: Floats) -> Ints:
    """(c,) the picture's line of pixels (c, 2); the nearest one where they lie outside."""
    line = np.rint(uv[:, 1 if view.orientation == "vertical" else 0])
    kept = np.clip(np.nan_to_num(line), 0, view.grid.flags.shape[1] - 1)
    return np.asarray(kept, dtype=np.int32)


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


def _in_air(view: Sought, places: _Places, scene: _Scene, c: _Crossings) -> Bools:
    """(c,) True where the patch lies off the part, as a lid does on a pocket or round a corner.

    Light that went through the place was measured beyond it, or would meet no back of the surface:
    through a part it would have to leave on the other side.
    """
    X = places.at[c.place]
    way = X - c.source
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    face = scene.caster.first_hits_between(X + places.start[c.place, None] * way, way)
    corners = scene.mesh.vertices[scene.mesh.faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slope = np.einsum("ij,ij->i", way, normal)
    out = face < 0
    k = np.flatnonzero(~out & (slope < 0))
    reach = np.einsum("ij,ij->i", corners[k, 0] - X[k], normal[k]) / slope[k]
    Y = X[k] + reach[:, None] * way[k]
    turned = np.einsum("cij,cj->ci", rotation_z(view.grid.angles[c.step[k]]), Y)
    line = _line_of(view, view.rig.camera.project(view.rig.T_camera_table.apply(turned)))
    out[k] = _sampled(view.grid, Y, c.step[k], line) < places.margin
    return np.asarray(out)


def _sampled(grid: RangeGrid, X: Floats, step: Ints, line: Ints) -> Floats:
    """(c,) mm from places (c, 3) to the samples of a grid; infinite where there is none."""
    away = np.linalg.norm(grid.points[step, line] - X, axis=1)
    return np.asarray(np.nan_to_num(away, nan=np.inf))


def _light(grid: RangeGrid, step: Ints, line: Ints) -> Ints:
    """(c,) what was wrong with the light where the camera saw a lit place; −1 where nothing was.

    One sample is not enough: where the light ends, the clean-up takes the last one, and a stray one
    may be found in the dark. What is missing beside the dark is missing for the dark.
    """
    flags = grid.flags
    missing = ~grid.found
    nothing = missing & ((flags & (StripeFlag.DARK | StripeFlag.OUTSIDE)) != 0)
    why = np.full(flags.shape, -1, dtype=np.int32)
    why[missing] = REMOVED
    why[missing & _beside(nothing, grid.closed)] = DARK
    why[nothing & ((flags & StripeFlag.AMBIGUOUS) != 0)] = AMBIGUOUS
    why[missing & ((flags & StripeFlag.SATURATED) != 0)] = SATURATED
    return np.asarray(why[step, line])


def _beside(cells: Bools, closed: bool) -> Bools:
    """(s, n) True in the cells (s, n) of a grid and in the eight about each."""
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if closed else "constant")
    padded = np.pad(padded, ((0, 0), (1, 1)))
    rows = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    return np.asarray(rows[:-2] | rows[1:-1] | rows[2:])

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
from turnscan.surface._hole_places import Places, places_in
from turnscan.surface._holes import Cause, Hole
from turnscan.surface._mesh import Mesh

_CAUSES: tuple[Cause, ...] = get_args(Cause)
LASER, CAMERA, DARK, SATURATED, OUTSIDE, AMBIGUOUS, REMOVED, UNKNOWN = range(len(_CAUSES))
_BOTH = len(_CAUSES)
"""Hidden from the laser and from the camera: counts for either."""
_GRAZING = float(np.cos(np.deg2rad(80.0)))
"""What is lit or seen further from face-on than this counts as hidden (as `Tears.grazing`)."""
_SAMPLED, _LID = 0.2, 0.02
"""Weights of a place that lies between samples, and of one that is no place of the part: they say
something where few others do."""
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


def explain(mesh: Mesh, found: Sequence[Hole], views: Sequence[Sought]) -> list[Hole]:
    """The holes of an open mesh with their cause; without views, as they are.

    Places on the surface that is missing (`places_in`) are followed through the scan (ALGORITHMS
    §5.3): at each table angle that carries a place through a laser's sheet, was it in the picture
    and in the volume, did the camera see it and did the light reach it, past the measured surface?
    Where both did, the frame says what was wrong with the light of that line. The place votes for
    what came nearest to a measurement; the most votes decide. What neither reached counts for
    hidden from either.
    """
    if not found or not views:
        return list(found)
    places = places_in(mesh, found)
    scene = _Scene(mesh, Caster(mesh.vertices, mesh.faces))
    count = np.zeros((len(found), _BOTH + 1))
    for start in range(0, len(places.at), _ROOM):
        part = places.part(slice(start, start + _ROOM))
        best, weight = _votes(part, views, scene)
        np.add.at(count, (part.hole, best), weight)
    count[:, [LASER, CAMERA]] += count[:, _BOTH, None]
    best = count[:, :_BOTH].argmax(axis=1)
    for k, h in enumerate(found):
        # Between three or four samples none is missing: the surface was torn or a face taken out.
        # A slit or a pinprick no wider than a face lacks none either: what is dark about it is what
        # lies beside an edge of the part.
        if len(h.loop) <= 4 or (best[k] == DARK and _lacks_nothing(h, places.face)):
            best[k] = REMOVED
    return [replace(h, cause=_CAUSES[k]) for h, k in zip(found, best, strict=True)]


def _lacks_nothing(hole: Hole, face: float) -> bool:
    slender = hole.size < face or 4 * hole.area < hole.size**2
    return slender and hole.area < hole.size * face


def _votes(places: Places, views: Sequence[Sought], scene: _Scene) -> tuple[Ints, Floats]:
    """(m,) for each place the cause that came nearest to a measurement, and its weight."""
    m = len(places.at)
    seen, lit, out, turned, measured, reached = np.zeros((6, m), dtype=np.bool_)
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
        reached[c.place[both]] = True
        near = _between_samples(view.grid, places, c.part(both))
        np.logical_or.at(measured, c.place[both], near)
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
    weak = np.where(measured, _SAMPLED, _LID)
    return np.where(known, light, vote), np.where(known | ~reached, 1.0, weak)


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


def _crossings(view: Sought, places: Places) -> _Crossings:
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


def _faces(places: Places, which: Ints, end: Floats) -> Bools:
    """(c,) True where a place is turned towards the end, and not too flatly."""
    way = end - places.at[which]
    up = np.einsum("ij,ij->i", way, places.normal[which])
    return np.asarray(up > _GRAZING * np.linalg.norm(way, axis=1))


def _reached(caster: Caster, places: Places, which: Ints, end: Floats) -> Bools:
    """(c,) True where a place is turned towards the end and nothing stands between."""
    out = _faces(places, which, end)
    at, end = which[out], end[out]
    out[out] = caster.visible(places.at[at], places.normal[at], end)
    return out


def _in_air(view: Sought, places: Places, scene: _Scene, c: _Crossings) -> Bools:
    """(c,) True where the patch lies off the part, as a lid does on a pocket or round a corner.

    Light that went through the place was measured beyond it; or, under a patch that turns off from
    the surface about it, would meet nothing more of the part, and so never was in it.
    """
    X = places.at[c.place]
    way = X - c.source
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    face = scene.caster.first_hits_between(X, way)
    corners = scene.mesh.vertices[scene.mesh.faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slope = np.einsum("ij,ij->i", way, normal)
    out = (face < 0) & places.bent[c.place]
    k = np.flatnonzero((face >= 0) & (slope < 0))
    reach = np.einsum("ij,ij->i", corners[k, 0] - X[k], normal[k]) / slope[k]
    Y = X[k] + reach[:, None] * way[k]
    turned = np.einsum("cij,cj->ci", rotation_z(view.grid.angles[c.step[k]]), Y)
    line = _line_of(view, view.rig.camera.project(view.rig.T_camera_table.apply(turned)))
    out[k] = _sampled(view.grid, Y, c.step[k], line) < places.margin
    return np.asarray(out)


def _between_samples(grid: RangeGrid, places: Places, c: _Crossings) -> Bools:
    """(c,) True where a place is as near to its sample as the steps leave the samples apart."""
    X, n = places.at[c.place], places.normal[c.place]
    way = c.source - X
    slope = np.einsum("ij,ij->i", way, n) / np.linalg.norm(way, axis=1)
    turn = float(np.median(np.abs(np.diff(np.unwrap(grid.angles))))) if len(grid.steps) > 1 else 0.0
    apart = np.hypot(X[:, 0], X[:, 1]) * turn / np.maximum(slope, _GRAZING)
    return np.asarray(_sampled(grid, X, c.step, c.line) < np.maximum(places.margin, apart))


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

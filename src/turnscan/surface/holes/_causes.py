"""Why a hole is there: from the rig, the surface that was measured, and what the frames showed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh._mesh import Mesh
from turnscan.mesh._parts import join
from turnscan.mesh._rays import Caster
from turnscan.points import RangeGrid, Volume
from turnscan.rig import rotation_z
from turnscan.stripes import StripeFlag
from turnscan.surface.holes._edges import faces_beyond
from turnscan.surface.holes._hole_places import Places, places_in
from turnscan.surface.holes._holes import Cause, Hole
from turnscan.surface.holes._left_out import LeftOut, deleted, left_out
from turnscan.surface.holes._through_holes import through, walls
from turnscan.surface.holes._visibility import GRAZING, Crossings, ScanCoverage, crossings, line_of

_CAUSES: tuple[Cause, ...] = get_args(Cause)
LASER, CAMERA, FLAT, DARK, SATURATED, OUTSIDE, AMBIGUOUS, REMOVED, UNKNOWN, DELETED = range(
    len(_CAUSES)
)
_BOTH, _FLAT_TO_LASER, _FLAT_TO_CAMERA, _FLAT_TO_BOTH = range(len(_CAUSES), len(_CAUSES) + 4)
"""Hidden from the laser and from the camera; and too flat to one of them, or to both."""
_COUNTS_FOR: Mapping[int, tuple[int, ...]] = {
    _BOTH: (LASER, CAMERA),
    _FLAT_TO_LASER: (LASER, FLAT),
    _FLAT_TO_CAMERA: (CAMERA, FLAT),
    _FLAT_TO_BOTH: (LASER, CAMERA, FLAT),
}
"""What is hidden from both counts for either. What lies too flatly to one of them is all but hidden
from it, for the tilt of a face that nobody saw is known to some degrees at best: it counts for
that, too."""
_SAMPLED, _LID = 0.05, 0.02
"""Weights of a place that lies between samples, and of one that is no place of the part: they say
something where few others do."""
_CARVED = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
"""Depths below a patch at which the part is looked for, in the size of its hole."""
_PATCH = 1.0
"""Weight of a flat patch beside the faces beyond the border, where no smooth surface spans it."""
_REACHED = 0.35
"""Of a face beyond the border: how much of it there is as a rule. It is searched as far as it could
go; ten large holes of lying parts have 0.3 to 1.2 of it, 0.39 in the median. The face that a part
stands on is known better: its rim was measured, which makes it a little too small."""
_SLANT = 0.5
"""Cosine of 60° off face-on, beyond which an island slants."""
_ROOM = 4000
"""Places that are asked at once, which bounds the memory."""
_RAYS = 500
"""Rays that are held against the removed points at once, which bounds it, too."""
_SOME = 0.25
"""Of what is too flat: as much that is hidden from light or look says that the rest turns away."""
_ALSO = 1 / 3
"""Part of all votes that a second cause must have by itself."""
_HIDDEN = (LASER, CAMERA, FLAT)
"""What a face in the shadow is named for."""
_REMOVED = 4000
"""Removed points that may stand before a place, at most."""


@dataclass(frozen=True)
class _Scene:
    """What was measured, and rays against it."""

    mesh: Mesh
    caster: Caster
    removed: Floats
    """(r, 3) mm: places of points that were found and removed; of many, evenly some."""

    @staticmethod
    def of(mesh: Mesh, views: Sequence[ScanCoverage]) -> _Scene:
        gone = [v.taken[~v.grid.found] for v in views if v.taken is not None]
        points = np.concatenate([np.zeros((0, 3)), *gone])
        points = points[~np.isnan(points[:, 0])]
        few = points[:: max(1, -(-len(points) // _REMOVED))]
        return _Scene(mesh, Caster(mesh.vertices, mesh.faces), few)

    def veiled(self, X: Floats, n: Floats, end: Floats, reach: Floats) -> Bools:
        """(m,) True where something that was removed stands between places X (m, 3), of normals n
        (m, 3), and ends (m, 3).

        Two of its points at least lie within ``reach`` (m,) mm, what samples are apart, of the ray,
        and by more than that off the place's own face. A stray stands alone, and what is strewn
        over a face hides none of it.
        """
        out = np.zeros(len(X), dtype=np.bool_)
        far = np.linalg.norm(end - X, axis=1)
        way = (end - X) / np.maximum(far, 1e-12)[:, None]
        for start in range(0, len(X), _RAYS):
            k = slice(start, start + _RAYS)
            off = self.removed - X[k, None]
            along = np.einsum("mri,mi->mr", off, way[k])
            near = np.einsum("mri,mri->mr", off, off) - along**2 < reach[k, None] ** 2
            over = np.einsum("mri,mi->mr", off, n[k]) > reach[k, None]
            out[k] = (near & over & (along < far[k, None])).sum(axis=1) > 1
        return out

    def hits(self, origins: Floats, ways: Floats) -> tuple[Ints, Floats, Floats]:
        """What rays from points (n, 3) along (n, 3) meet first.

        (n,) faces, −1 for none; (n,) how steeply, negative where they come upon one from outside
        and 0 for none; (n,) how far, in lengths of the way.
        """
        face = self.caster.first_hits_between(origins, ways)
        corners = self.mesh.vertices[self.mesh.faces[face]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        slope = np.where(face < 0, 0.0, np.einsum("ij,ij->i", ways, normal))
        ahead = np.einsum("ij,ij->i", corners[:, 0] - origins, normal)
        return face, slope, ahead / np.where(slope == 0.0, 1.0, slope)

    def ahead(self, origins: Floats, ways: Floats) -> Floats:
        """(n,) how far rays meet something, in lengths of the way; infinite for nothing."""
        face, _, reach = self.hits(origins, ways)
        return np.asarray(np.where(face < 0, np.inf, reach))


def explain(
    mesh: Mesh,
    found: Sequence[Hole],
    views: Sequence[ScanCoverage],
    cut: Floats | None = None,
    lost: LeftOut | None = None,
) -> list[Hole]:
    """The holes of an open mesh with their cause; without views, those that somebody asked for.

    A hole was deleted by hand where most of its border runs between places ``cut`` (k, 3) mm, the
    vertices that lost faces so. It was removed where most of it was ``lost`` for its uncertainty
    (`left_out`). The others are asked for what hid them, in the shadow of what was lost, too.

    Places on the surface that is missing (`places_in`) are followed through the scan: at each table
    angle that carries a place through a laser's sheet, was it in the picture and in the volume, did
    the camera see it and did the light reach it, past the measured surface?
    Where both did and a smooth surface could span the hole, the frame says what was wrong with the
    light of that line; where none could, the part lies further in (`_further_in`), or turns off at
    the border (`_beyond`). The most votes decide. What neither reached counts for hidden from
    either. For the two ends of a bore (`through`) its wall is asked instead.
    """
    by_hand = deleted(mesh, found, cut)
    asked = by_hand | left_out(mesh, found, lost)
    rest = iter(
        _explained(mesh, [h for h, a in zip(found, asked, strict=True) if not a], views, lost)
    )
    return [
        replace(h, cause="deleted" if d else "removed", also=None) if a else next(rest)
        for h, d, a in zip(found, by_hand, asked, strict=True)
    ]


def _explained(
    mesh: Mesh, found: Sequence[Hole], views: Sequence[ScanCoverage], lost: LeftOut | None
) -> list[Hole]:
    if not found or not views:
        return list(found)
    scene = _Scene.of(mesh if lost is None else join([mesh, lost.faces]), views)
    places = places_in(mesh, found)
    count = _counted(places, len(found), views, scene)
    beyond, known, sure = _beyond(mesh, found, places, views, scene)
    best = _most(count)
    # About an island that lies near other samples all places count as measured.
    known &= (best != REMOVED) | places.island
    if not any(view.grid.closed for view in views):
        known &= best != OUTSIDE  # its turn may not have come
    unsaid = (count.sum(axis=1) < 1.0) & ~known
    votes = np.where(known[:, None], _weighed(count, beyond, sure), count)
    said = best = _most(votes)
    also = _second(votes, said)
    # A bore is not dark; what names it otherwise is known better than its wall.
    deep = through(mesh, found, places, places.wide & (best != OUTSIDE))
    deep[(best == LASER) | (best == CAMERA) | (best == FLAT)] = 0.0
    if deep.any():
        count = _counted(walls(mesh, found, places, deep), len(found), views, scene)
        count[:, DARK : len(_CAUSES)] = 0.0
        best = np.where(count.any(axis=1), _most(count), best)
    best = np.where(
        _whole(found, places, unsaid | (best == DARK)) & (best != DELETED), REMOVED, best
    )
    best = _as_about(mesh, found, places, views, best)
    also[best != said] = -1
    return [
        replace(h, cause=_CAUSES[k], also=None if m < 0 else _CAUSES[m])
        for h, k, m in zip(found, best, also, strict=True)
    ]


def _as_about(
    mesh: Mesh, found: Sequence[Hole], places: Places, views: Sequence[ScanCoverage], best: Ints
) -> Ints:
    """(h,) causes, those of slanting islands in the dark as that of the hole that each lies in.

    What lies between them is missing at both borders. From an island that faces light and look it
    is known well. One that slants is likely to turn off further all round, and what its tangent
    planes say of the light is less than what is known from the border about it.
    """
    from scipy.spatial import cKDTree

    slanting = places.island & places.smooth & (best == DARK)
    islands = [int(k) for k in np.flatnonzero(slanting)]
    about = [int(k) for k in np.flatnonzero(~places.island & (best != REMOVED))]
    if not islands or not about:
        return best
    tree = cKDTree(mesh.vertices[np.concatenate([found[k].loop for k in about])])
    owner = np.repeat(about, [len(found[k].loop) for k in about])
    out = best.copy()
    for k in islands:
        own = places.some(np.flatnonzero(places.hole == k).astype(np.int32))
        if _steepest(own, views).mean() < _SLANT:
            nearest = owner[tree.query(mesh.vertices[found[k].loop])[1]]
            out[k] = best[np.bincount(nearest).argmax()]
    return out


def _steepest(places: Places, views: Sequence[ScanCoverage]) -> Floats:
    """(m,) cosine off face-on of both light and look, at the best moment of each place."""
    out = np.zeros(len(places.at))
    for view in views:
        c = crossings(view, places.at)
        both = np.minimum(_faces(places, c.place, c.eye), _faces(places, c.place, c.source))
        np.maximum.at(out, c.place, both)
    return out


def _whole(found: Sequence[Hole], places: Places, idle: Bools) -> Bools:
    """(h,) True for holes that lack no place of the part: the surface was torn or a face taken out.

    So it is between three or four samples. A slit or a pinprick no wider than a face lacks none
    either, where nothing (``idle``) or the dark is said of it: what is dark about it is what lies
    beside an edge of the part, and its patch may lie under the noise of its border. The border of
    an island encloses what is there, and says nothing of it.
    """
    few = np.array([len(h.loop) <= 4 for h in found])
    slight = np.array([_lacks_nothing(h, places.face) for h in found])
    return np.asarray(~places.island & (few | (idle & slight)))


def _weighed(patch: Floats, beyond: Floats, sure: Floats) -> Floats:
    """(h, causes) votes of flat patches and of the faces beyond their borders, of which ``sure``
    (h,) is known. A patch says less, the more that is, and next to nothing where most is."""
    share = _PATCH * patch / np.maximum(patch.sum(axis=1, keepdims=True), 1.0)
    return np.asarray(share * (1.0 - sure[:, None]) ** 2 + beyond)


def _most(count: Floats) -> Ints:
    """(h,) the cause that the most speaks for, of votes (h, causes) with those for several.

    What is too flat may have more votes than the laser and the camera. Where next to nothing else
    (`_SOME`) speaks for these, it is grazing. Where more does, the part turns away beyond what is
    flat, and most of it is hidden.
    """
    whole = _for_each(count)
    hidden = count[:, [LASER, CAMERA, _BOTH]].sum(axis=1)
    flat = whole[:, FLAT] >= whole.max(axis=1)
    turned = flat & (hidden > _SOME * whole[:, FLAT])
    from_one = np.where(whole[:, LASER] >= whole[:, CAMERA], LASER, CAMERA)
    best = np.where(flat, FLAT, whole.argmax(axis=1))
    return np.where(turned, from_one, best).astype(np.int32)


def _for_each(count: Floats) -> Floats:
    """(h, causes) what speaks for each cause, of votes with those for several last."""
    whole = count[:, : len(_CAUSES)].copy()
    for both, causes in _COUNTS_FOR.items():
        whole[:, causes] += count[:, both, None]
    return whole


def _second(count: Floats, best: Ints) -> Ints:
    """(h,) the second cause of holes that lack the face on which the part stands and one in its
    shadow; −1 for none.

    One border may run about both: two names are true of such a hole, and neither of most of it.
    The second is what has the most of the votes (h, causes) that the ``best`` leaves, and `_ALSO`
    of all. Other pairs are too often a guess: their faces are not known as that on the platter is.
    """
    left, rows = count.copy(), np.arange(len(count))
    left[rows, best] = 0.0
    for both, causes in _COUNTS_FOR.items():
        left[np.isin(best, causes), both] = 0.0
    second = _most(left)
    much = _for_each(left)[rows, second] >= _ALSO * np.maximum(count.sum(axis=1), 1e-9)
    foot = (best == OUTSIDE) & np.isin(second, _HIDDEN)
    foot |= np.isin(best, _HIDDEN) & (second == OUTSIDE)
    return np.where(much & foot, second, -1).astype(np.int32)


def _counted(places: Places, holes: int, views: Sequence[ScanCoverage], scene: _Scene) -> Floats:
    """(holes, causes) the votes of the places in each hole, those for several causes last."""
    count = np.zeros((holes, _FLAT_TO_BOTH + 1))
    for start in range(0, len(places.at), _ROOM):
        part = places.part(slice(start, start + _ROOM))
        best, weight = _votes(part, views, scene)
        np.add.at(count, (part.hole, best), weight)
    return count


def _beyond(
    mesh: Mesh, found: Sequence[Hole], places: Places, views: Sequence[ScanCoverage], scene: _Scene
) -> tuple[Floats, Bools, Floats]:
    """(holes, causes) shares of the faces beyond borders that no smooth surface spans
    (`faces_beyond`) by what hides them, (holes,) True where that says something, and (holes,) how
    much of these faces is known, and no guess: that of the face that the part stands on is, too."""
    inner = [_inner(view.volume, places.margin) for view in views]
    turn = max(_turn(view.grid) for view in views)
    sides, area, cut, known = faces_beyond(
        mesh, found, places, lambda p: _reachable(p, views, scene).both, scene.ahead,
        lambda X: ~np.any([v.contains(X) for v in inner], axis=0),
        lambda X: np.maximum(places.face, np.hypot(X[:, 0], X[:, 1]) * turn),
    )  # fmt: skip
    count = np.zeros((len(found), _FLAT_TO_BOTH + 1))
    reach = _reachable(sides, views, scene)
    name = reach.hider
    name[cut | (~reach.inside & ~reach.seen & ~reach.lit)] = OUTSIDE
    # What is thinner than samples are apart lies between them, though nothing hinders it.
    name[known & reach.both] = REMOVED
    lacking = cut | known | ~reach.both
    area = np.where(cut | known, area, _REACHED * area)
    np.add.at(count, (sides.hole[lacking], name[lacking]), area[lacking])
    whole = count.sum(axis=1)
    sure = np.bincount(sides.hole, area * (known | cut), len(found)) / np.maximum(
        np.bincount(sides.hole, area, len(found)), 1e-9
    )
    return count / np.maximum(whole, 1e-9)[:, None], np.asarray(whole > 0), sure


@dataclass(frozen=True)
class _Reachable:
    """What ever came to places (m,), each True or False."""

    seen: Bools
    """The camera had them in view, however flatly."""
    lit: Bools
    """The light fell on them, however flatly."""
    dim: Bools
    """Both at one moment, the light too flatly."""
    slant: Bools
    """Both at one moment, the look of the camera too flatly."""
    both: Bools
    """Both at one moment, steeply enough to be measured."""
    inside: Bools
    """In the picture, and in the volume."""

    @property
    def hider(self) -> Ints:
        """(m,) what hinders those that were not in reach of both."""
        return _hider(self.seen, self.lit, self.dim, self.slant)


def _hider(seen: Bools, lit: Bools, dim: Bools, slant: Bools) -> Ints:
    """(m,) the cause of places that were never lit and seen steeply at one moment."""
    name = np.where(seen == lit, _BOTH, np.where(seen, LASER, CAMERA))
    flat = np.where(dim == slant, _FLAT_TO_BOTH, np.where(dim, _FLAT_TO_LASER, _FLAT_TO_CAMERA))
    return np.asarray(np.where(dim | slant, flat, name), dtype=np.int32)


def _reachable(places: Places, views: Sequence[ScanCoverage], scene: _Scene) -> _Reachable:
    """Which places the camera sees and the light reaches."""
    seen, lit, dim, slant, both, inside = np.zeros((6, len(places.at)), dtype=np.bool_)
    for view in views:
        c, sight = _sight(places, view, scene)
        for some, what in (
            (sight.seen, seen), (sight.lit, lit), (sight.dim, dim), (sight.slant, slant),
            (sight.both, both), (c.inside, inside),
        ):  # fmt: skip
            np.logical_or.at(what, c.place, some)
        inside &= view.volume.contains(places.at)
    return _Reachable(seen, lit, dim, slant, both, inside)


def _lacks_nothing(hole: Hole, face: float) -> bool:
    slender = hole.size < face or 4 * hole.area < hole.size**2
    return slender and hole.area < hole.size * face


def _votes(places: Places, views: Sequence[ScanCoverage], scene: _Scene) -> tuple[Ints, Floats]:
    """(m,) for each place the cause that came nearest to a measurement, and its weight."""
    m = len(places.at)
    seen, lit, dim, slant, out, turned, measured, reached, buried, unlit, unseen = np.zeros(
        (11, m), dtype=np.bool_
    )
    light = np.full(m, -1, dtype=np.int32)
    for view in views:
        out |= ~_inner(view.volume, 0.25 * places.margin).contains(places.at)
        c, sight = _sight(places, view, scene)
        faces = np.maximum(_faces(places, c.place, c.eye), _faces(places, c.place, c.source))
        for some, what in (
            (sight.buried, buried), (faces > GRAZING, turned), (sight.seen, seen),
            (sight.lit, lit), (sight.dim, dim), (sight.slant, slant), (~c.inside, out),
        ):  # fmt: skip
            np.logical_or.at(what, c.place, some)
        both = np.flatnonzero(sight.both).astype(np.int32)
        reached[c.place[both]] = True
        near = _between_samples(view.grid, places, c.part(both))
        near &= ~view.faint[c.step[both], c.line[both]]
        np.logical_or.at(measured, c.place[both], near)
        both = both[~_in_air(view, places, scene, c.part(both))]
        why = _light(view, places, c.part(both))
        shadow, screen = _veils(view, places, scene, c.part(both), why)
        why[shadow | screen] = -1
        np.maximum.at(light, c.place[both], why)
        np.logical_or.at(unlit, c.place[both], shadow)
        np.logical_or.at(unseen, c.place[both], screen)
    if not any(view.grid.closed for view in views):
        out |= ~turned  # the scan ended before its turn came
    vote = _hider(seen, lit, dim, slant)
    vote[out & ~seen & ~lit] = OUTSIDE
    vote[measured] = REMOVED
    known = (light >= 0) & ~measured & ~places.bent & places.smooth[places.hole]
    veiled = (unlit | unseen) & ~known & ~measured
    vote[veiled] = np.where(unlit == unseen, _BOTH, np.where(unlit, LASER, CAMERA))[veiled]
    reached &= ~veiled
    reached |= buried & ~(seen | lit)  # within the part, so no place of its surface
    # No continuation of the surface, and yet in free sight: the part lies further in.
    free = np.flatnonzero(reached & ~measured & ~known & ~buried).astype(np.int32)
    behind = np.full(m, -1, dtype=np.int32)
    behind[free] = _further_in(places.some(free), views, scene)
    weak = np.where(measured, _SAMPLED, np.where(behind >= 0, 1.0, _LID))
    vote = np.where(behind >= 0, behind, vote)
    return np.where(known, light, vote), np.where(known | ~reached, 1.0, weak)


@dataclass(frozen=True)
class _Sight:
    """What came to places at the moments (c,) at which they pass a sheet, each True or False."""

    seen: Bools
    """In view of the camera, however flatly."""
    lit: Bools
    """In the light, however flatly."""
    dim: Bools
    """Seen and lit, the latter too flatly."""
    slant: Bools
    """Seen and lit, the former too flatly."""
    buried: Bools
    """Looking at the inner side of what was measured."""

    @property
    def both(self) -> Bools:
        """Seen and lit steeply enough to be measured."""
        return self.seen & self.lit & ~self.dim & ~self.slant


def _sight(places: Places, view: ScanCoverage, scene: _Scene) -> tuple[Crossings, _Sight]:
    """The moments at which places pass a sheet, and what came to them then."""
    c = crossings(view, places.at)
    ok = c.inside & view.volume.contains(places.at)[c.place]
    seen, lit, looked, shone, buried = np.zeros((5, len(c.place)), dtype=np.bool_)
    seen[ok], looked[ok], buried[ok] = _reached(scene, places, c.place[ok], c.eye[ok])
    lit[ok], shone[ok], deep = _reached(scene, places, c.place[ok], c.source[ok])
    buried[ok] |= deep
    both = seen & lit
    return c, _Sight(seen, lit, both & ~shone, both & ~looked, buried)


def _further_in(places: Places, views: Sequence[ScanCoverage], scene: _Scene) -> Ints:
    """(m,) what hides the outermost place below each that could not have been measured; −1 where
    there is none within the reach of its hole.

    Whatever stood in free sight of a laser and of the camera at once would have been found. So the
    part lies below the places that did, and they are carved off.
    """
    m = len(places.at)
    vote, left = np.full(m, -1, dtype=np.int32), np.arange(m, dtype=np.int32)
    for depth in _CARVED:
        if not len(left):
            break
        here = places.some(left)
        here = replace(here, at=here.at - (depth * here.reach[here.hole])[:, None] * here.normal)
        reach = _reachable(here, views, scene)
        vote[left[~reach.both]] = reach.hider[~reach.both]
        left = left[reach.both]
    return vote


def _veils(
    view: ScanCoverage, places: Places, scene: _Scene, c: Crossings, why: Ints
) -> tuple[Bools, Bools]:
    """(c,) where what was removed stands before the laser, and where before the camera, though
    nothing that was kept does; asked where the light says (``why``) that there was none."""
    out = np.zeros((2, len(c.place)), dtype=np.bool_)
    asked = np.flatnonzero(((why == DARK) | (why == REMOVED)) & places.smooth[places.hole[c.place]])
    if len(asked) and len(scene.removed):
        some = c.part(asked.astype(np.int32))
        X, n, reach = (
            places.at[some.place],
            places.normal[some.place],
            _near(view.grid, places, some),
        )
        for k, end in enumerate((some.source, some.eye)):
            out[k, asked] = scene.veiled(X, n, end, reach)
    return out[0], out[1]


def _inner(volume: Volume, margin: float) -> Volume:
    """What is left of a volume behind a margin; at least its middle."""
    half = min(margin, (volume.z_max - volume.z_min) / 4)
    r = max(volume.r_max - margin, volume.r_max / 2)
    return Volume(r, volume.z_min + half, volume.z_max - half)


def _faces(places: Places, which: Ints, end: Floats) -> Floats:
    """(c,) cosine off face-on under which places are looked at from the ends (c, 3)."""
    way = end - places.at[which]
    up = np.einsum("ij,ij->i", way, places.normal[which])
    return np.asarray(up / np.maximum(np.linalg.norm(way, axis=1), 1e-12))


def _reached(scene: _Scene, places: Places, which: Ints, end: Floats) -> tuple[Bools, Bools, Bools]:
    """(c,) where a place is turned towards the end and nothing stands between; where it is so, and
    not too flatly; and where it is turned there steeply and looks at the inner side of the
    surface, so that it lies within the part.

    Where its direction is but a guess, 80° off face-on and turned away are one: hidden.
    """
    cosine = _faces(places, which, end)
    out = cosine > np.where(places.bent[which], GRAZING, 0.0)
    at, normal, end = places.at[which[out]], places.normal[which[out]], end[out]
    free = scene.caster.visible(at, normal, end)
    within = np.zeros(len(out), dtype=np.bool_)
    within[out] = ~free & (scene.hits(at, end - at)[1] > 0)
    out[out] = free
    steep = cosine > GRAZING
    return out, out & steep, within & steep


def _in_air(view: ScanCoverage, places: Places, scene: _Scene, c: Crossings) -> Bools:
    """(c,) True where the patch lies off the part, as a lid does on a pocket or round a corner.

    Light that went through the place was measured beyond it; or, under a patch that turns off from
    the surface about it, would meet nothing more of the part, and so never was in it.
    """
    X = places.at[c.place]
    way = X - c.source
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    face, slope, reach = scene.hits(X, way)
    out = (face < 0) & places.bent[c.place]
    k = np.flatnonzero(slope < 0)
    Y = X[k] + reach[k, None] * way[k]
    turned = np.einsum("cij,cj->ci", rotation_z(view.grid.angles[c.step[k]]), Y)
    line = line_of(view, view.rig.camera.project(view.rig.T_camera_table.apply(turned)))
    out[k] = _sampled(view.grid, Y, c.step[k], line) < places.margin
    return np.asarray(out)


def _between_samples(grid: RangeGrid, places: Places, c: Crossings) -> Bools:
    """(c,) True where a place is as near to its sample as the steps leave the samples apart."""
    way = grid.points[c.step, c.line] - places.at[c.place]
    off = np.abs(np.einsum("ij,ij->i", way, places.normal[c.place]))
    with np.errstate(invalid="ignore"):
        near = (np.linalg.norm(way, axis=1) < _near(grid, places, c)) & (off < places.margin)
    return np.asarray(near)


def _near(grid: RangeGrid, places: Places, c: Crossings) -> Floats:
    """(c,) mm that the steps leave samples apart on the surface of places."""
    X, n = places.at[c.place], places.normal[c.place]
    way = c.source - X
    slope = np.einsum("ij,ij->i", way, n) / np.linalg.norm(way, axis=1)
    apart = np.hypot(X[:, 0], X[:, 1]) * _turn(grid) / np.maximum(slope, GRAZING)
    return np.asarray(np.maximum(places.margin, apart))


def _turn(grid: RangeGrid) -> float:
    """rad: the usual step of a grid; 0 for one step."""
    return float(np.median(np.abs(np.diff(np.unwrap(grid.angles))))) if len(grid.steps) > 1 else 0.0


def _sampled(grid: RangeGrid, X: Floats, step: Ints, line: Ints) -> Floats:
    """(c,) mm from places (c, 3) to the samples of a grid; infinite where there is none."""
    away = np.linalg.norm(grid.points[step, line] - X, axis=1)
    return np.asarray(np.nan_to_num(away, nan=np.inf))


def _light(view: ScanCoverage, places: Places, c: Crossings) -> Ints:
    """(c,) what was wrong with the light where the camera saw a lit place; −1 where nothing was.

    One sample is not enough: where the light ends, the clean-up takes the last one, and a stray one
    may be found in the dark. What is missing beside the dark is missing for the dark, and so is
    what shows no more than a dark place does where its speckle is bright. A point that was
    deleted by hand, alone or with its profile, was light, whatever its frame shows beside it.
    """
    flags, missing = view.grid.flags, ~view.grid.found
    nothing = missing & ((flags & (StripeFlag.DARK | StripeFlag.OUTSIDE)) != 0)
    why = np.full(flags.shape, -1, dtype=np.int32)
    why[missing] = REMOVED
    why[missing & _beside(nothing, view.grid.closed)] = DARK
    why[view.faint] = DARK
    why[nothing & ((flags & StripeFlag.AMBIGUOUS) != 0)] = AMBIGUOUS
    why[missing & ((flags & StripeFlag.SATURATED) != 0)] = SATURATED
    why = why[c.step, c.line]
    if view.taken is not None:
        # What was removed elsewhere on the line was no light of this place: here was none.
        away = np.linalg.norm(view.taken[c.step, c.line] - places.at[c.place], axis=1)
        why[(why == REMOVED) & ~(away < _near(view.grid, places, c))] = DARK
    why[(missing & (flags == StripeFlag.HAND))[c.step, c.line] | c.off] = DELETED
    return np.asarray(why)


def _beside(cells: Bools, closed: bool) -> Bools:
    """(s, n) True in the cells (s, n) of a grid and in the eight about each."""
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if closed else "constant")
    padded = np.pad(padded, ((0, 0), (1, 1)))
    rows = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    return np.asarray(rows[:-2] | rows[1:-1] | rows[2:])

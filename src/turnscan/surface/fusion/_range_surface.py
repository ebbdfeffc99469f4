"""RangeSurface: the mesh of one grid, with what a merge must know about each vertex."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.errors import InputError
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._normals import roughness, smoothed_normals, vertex_normals
from turnscan.points import RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.surface._grid_mesh import TearLimits, mesh_grid

_BENT = 3.0
"""Combined sigma by which two bends must each differ from the next to be those of an edge, …"""
_SURE = 11.2
"""… and by which both must together: three times what noise alone makes, the root of 14."""
_ALONE = 6.3
"""… and one by itself, of a profile beyond which nothing was seen: twice what noise makes of it."""
_EVEN, _EVEN_ELSE = 6.0, 10.0
"""Sigma by which a bend differs from those beside it at most, in the mean along the profiles, where
the surface bends evenly; and where slight edges are looked for by themselves."""
_CHORD = 1.7
"""Times what noise makes of it, beyond which a point lies off the chord of its neighbours, or the
mean along the profile does."""
_BULGE = 0.2
"""Part of a chord's sagitta that is doubted where it is made up for on an evenly bent surface."""
_LEDGE, _GOES_ON = 2.5, 3.0
"""Times what noise makes of it, by which one chord on a profile leads deeper than that beside it,
where they are two faces that meet; and in the mean over profiles."""
_CORNER = 0.4
"""Part of how far the corner of two rays lies off a chord, one standard deviation."""
_ALONG = 4
"""Times that what is known of a bend is averaged over neighbours on the profile, and what is known
of a line over the profiles about."""
_MEAN = 0.41
"""Of independent noise, what these leave."""
_NARROW, _REACH = 2, 4.0
"""Profiles, and thicknesses of the sheet, within which a face may have an edge on either side, so
that light of both sides of them moves its points alike; …"""
_RUNS = 12
"""… where they run along the profiles: on most of so many lines below and above."""


@dataclass(frozen=True)
class RangeSurface:
    """The mesh of one grid, and where the camera stood when it saw each vertex."""

    mesh: Mesh
    eyes: Floats
    """(v, 3) mm."""
    normals: Floats
    """(v, 3) unit normals, steady against noise (`smoothed_normals`)."""
    random: Floats | None = None
    """(v,) part of the variance of each vertex, 0 to 1, that moves it alone; None where the grid
    does not know (`RangeGrid.noise`)."""
    alike: float = 0.0
    """Correlation of that on adjacent lines (`RangeGrid.alike`)."""
    along: Floats | None = None
    """(v,) mm: sigma along the laser's sheet (`RangeGrid.sigma`); None where it is not known."""

    @property
    def cosine(self) -> Floats:
        """(v,) cosine of the camera ray's angle to the normal; 0 where not known."""
        ray = self.eyes - self.mesh.vertices
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        cosine: Floats = np.nan_to_num(np.einsum("ij,ij->i", self.normals, ray))
        return cosine

    @cached_property
    def sigma(self) -> Floats:
        """(v,) mm; where it is not known, the usual noise of the surface itself."""
        p = self.mesh.provenance
        sigma = np.full(len(self.mesh.vertices), np.nan) if p is None else p.sigma
        known = sigma[sigma > 0]
        usual = float(np.median(known)) if len(known) else roughness(self.mesh)
        return np.where(sigma > 0, sigma, usual)

    def noise(self, most: float) -> Floats:
        """(v,) mm: of `sigma`, what averages out; up to ``most`` mm of it where none is known."""
        if self.random is None:
            return np.minimum(self.sigma, most)
        return self.sigma * np.sqrt(self.random)

    @cached_property
    def ranks(self) -> Ints:
        """(v,) the profile of each vertex, numbered from 0 in the order of their steps.

        Raises TypeError for a mesh that does not know its steps.
        """
        return np.unique(self._known().step, return_inverse=True)[1].astype(np.int32)

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints]:
        """(v,) twice: the vertex on the same line of the profile before and after; −1: none.

        Raises TypeError for a mesh that does not know its steps.
        """
        from turnscan.surface.fusion import _overlap_kernels as kernels

        p = self._known()
        before, after = kernels.next_profile(self.mesh.faces, self.ranks, p.line)
        return before, after

    @cached_property
    def beside(self) -> tuple[Ints, Ints]:
        """(v,) twice: the vertex on the line before and after of the same profile; −1: none.

        Raises TypeError for a mesh that does not know its lines.
        """
        from turnscan.surface.fusion import _overlap_kernels as kernels

        lines = np.unique(self._known().line, return_inverse=True)[1].astype(np.int32)
        below, above = kernels.next_profile(self.mesh.faces, lines, self.ranks)
        return below, above

    @cached_property
    def bend(self) -> Floats:
        """(v,) 1/mm: how the surface bends from profile to profile, positive where it bulges; 0
        where nothing is known of it, and beside an edge.

        Of single points it would be noise: it is averaged along the profiles, where they lie close,
        and is that of most of the profiles about each (`_bend_kernels.settled`). Normals tell less
        of it: averaged over profiles, too, they turn on a plane before its edge.

        Raises TypeError for a mesh that does not know its steps.
        """
        from turnscan.surface.fusion import _bend_kernels as bends

        mesh = self.mesh
        before, after = self.neighbours
        below, above = self.beside
        n = bends.along(np.nan_to_num(vertex_normals(mesh)), below, above, _ALONG)
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)
        found = bends.curvatures(mesh.vertices, n, self.noise(np.inf), before, after)
        found = bends.along(found, below, above, _ALONG)
        return bends.settled(found[:, 0], _MEAN * found[:, 1], before, after)

    def _known(self) -> Provenance:
        if self.mesh.provenance is None:
            raise TypeError("the mesh of a grid knows its steps")
        return self.mesh.provenance

    def between(self, edges: float = 0.0, *, slight: bool = False, ends: bool = False) -> Floats:
        """(f,) mm: how far the surface may lie off the chords that each face spans from a profile
        to the next: the most that `beside_profiles` says of its vertices to that side.

        Raises TypeError for a mesh that does not know its steps.
        """
        faces, ranks = self.mesh.faces, self.ranks[self.mesh.faces]
        back, on = self.beside_profiles(edges, slight=slight, ends=ends)
        low, high = ranks.min(axis=1, keepdims=True), ranks.max(axis=1, keepdims=True)
        # Over the seam the last profile is before the first.
        first = np.where(high - low > 1, high, low)
        side = np.where(ranks == first, on[faces], back[faces])
        return np.asarray(np.where((low == high)[:, 0], 0.0, side.max(axis=1)))

    def beside_profiles(
        self, edges: float = 0.0, *, slight: bool = False, ends: bool = False
    ) -> tuple[Floats, Floats]:
        """(v,) mm twice: how far the surface may lie off its chords to the profile before, and
        after, each vertex.

        An eighth of its second difference from profile to profile, along the normal beyond what
        noise makes of it, by itself or in the mean along the profile, which is the sagitta of what
        bends evenly. There a merge bulges its faces (`bend`, `_variance_kernels.rise`); what that
        does not make up for of the sagitta counts, and a part of it. Where there are not three
        profiles in a row nothing is known of the bend; there it is an eighth of the usual distance
        between two profiles. Up to ``edges`` mm it counts what an edge between them does, with
        ``slight`` also one of which one profile shows little, with ``ends`` also one before a
        profile beyond which there is none. Where the surface is flat further out, an edge to the
        one side is all of the bend; else it may be on the other.
        """
        X, (before, after) = self.mesh.vertices, self.neighbours
        off, told = self._sagittas
        off = np.where(self._evenly(slight), np.fmin(off, told), off)
        aside = np.fmax(
            np.where(before < 0, np.nan, off[before]), np.where(after < 0, np.nan, off[after])
        )
        off = np.where(np.isnan(off), aside, off)
        side = np.linalg.norm(X[after] - X, axis=1)[after >= 0]
        off = np.where(np.isnan(off), float(np.median(side)) / 8.0 if len(side) else 0.0, off)
        if not edges > 0:
            return off, off
        back, on = self._creases(slight, ends)
        # Where nothing is known of the bend, no edge that was not seen says there is none.
        out = []
        for own, other, far in ((back, on, before), (on, back, after)):
            flat = (other > off) & (far >= 0) & (off[far] == 0.0)
            edge = np.minimum(np.where(flat, own, np.maximum(own, other)), edges)
            out.append(np.maximum(np.where(flat, 0.0, off), edge))
        return out[0], out[1]

    @cached_property
    def between_lines(self) -> Floats:
        """(v,) mm: how far a step between two lines may stand off the chords of a profile.

        Between the rays of two lines the surface may go along either and then across. So it lies
        up to the distance of the rays off their chord, times the cosine of the angle between both;
        a part of that counts, where one chord leads deeper than that beside it, beyond what noise
        makes of it: by itself, or in the mean over the profiles about it, for what is turned, or
        stands upright, goes on there. A surface that slopes steadily has no such step.
        """
        from turnscan.surface.fusion import _bend_kernels as bends

        X, above = self.mesh.vertices, self.beside[1]
        ray = X - self.eyes
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        chord = np.where((above < 0)[:, None], np.nan, X[above] - X)
        own = np.stack([np.einsum("ij,ij->i", chord, ray), np.linalg.norm(chord, axis=1)], axis=1)
        mean = bends.along(own, *self.neighbours, _ALONG)
        return np.maximum(self._steps(own, _LEDGE), self._steps(mean, _GOES_ON * _MEAN))

    def _steps(self, chords: Floats, least: float) -> Floats:
        """`between_lines` of ``chords`` (v, 2) to the next line, mm along the ray and mm long, of
        which one leads deeper by ``least`` times what noise makes of single ones."""
        deep, long = chords.T
        below, above = self.beside
        beside = (np.where(k < 0, np.nan, deep[k]) for k in (below, above))
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.sqrt(np.maximum(long**2 - deep**2, 0.0))
            off = _CORNER * np.nan_to_num(apart * np.abs(deep) / long)
            deeper = np.fmax(*(np.abs(deep - o) * (np.abs(deep) > np.abs(o)) for o in beside))
            # Rays and the sheet lead much the same way, the normal may not.
            noise = self.sigma if self.along is None else np.fmax(self.along, self.sigma)
            off = np.where(deeper > least * np.sqrt(6.0) * noise, off, 0.0)
        return np.asarray(np.maximum(off, np.where(below < 0, 0.0, off[below])))

    @cached_property
    def _seconds(self) -> tuple[Floats, Floats]:
        """(v,) mm twice: second differences from profile to profile, along the normal, and their
        means along the profile; NaN where there are not three in a row."""
        X, (before, after) = self.mesh.vertices, self.neighbours
        second, way = X[before] - 2.0 * X + X[after], X[after] - X[before]
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        up = self.normals - np.einsum("ij,ij->i", self.normals, way)[:, None] * way
        up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
        there = (before >= 0) & (after >= 0)
        own, square = (
            np.where(there, np.einsum("ij,ij->i", n, second), np.nan) for n in (self.normals, up)
        )
        # Along the chord unlike steps differ on a plane, too, and beside an edge normals lean that
        # way: three on a line do not bend.
        straight = self._sagitta(square, self._along(square)) == 0.0
        own = np.where(straight, square, own)
        return own, self._along(own)

    @cached_property
    def _sagittas(self) -> tuple[Floats, Floats]:
        """(v,) mm twice: of the chords to the profiles about, and what stays doubted of them where
        the faces of a merge bulge."""
        second, mean = self._seconds
        whole, left = self._sagitta(second, mean), second + self._bulge()
        return whole, np.hypot(self._sagitta(left, self._along(left)), _BULGE * whole)

    def _sagitta(self, second: Floats, mean: Floats) -> Floats:
        """(v,) mm: of second differences (v,) and their means along the profile (v,), beyond what
        noise makes of either."""
        # Noise bends three points by the root of six of it.
        noise = _CHORD * np.sqrt(6.0) * self.sigma
        more = np.maximum(second**2 - noise**2, mean**2 - (_MEAN * noise) ** 2)
        return np.asarray(np.sqrt(np.maximum(more, 0.0)) / 8.0)

    def _along(self, values: Floats) -> Floats:
        """(v,) means of ``values`` (v,) along the profiles; NaN where these are."""
        from turnscan.surface.fusion import _bend_kernels as bends

        return bends.along(values[:, None], *self.beside, _ALONG)[:, 0]

    def _bulge(self) -> Floats:
        """(v,) mm: by how much of their second difference merged faces bulge to both sides."""
        from turnscan.surface.fusion import _variance_kernels as kernels

        X, step = self.mesh.vertices, self.ranks
        before, after = (kernels.rises(X, self.bend, step, other) for other in self.neighbours)
        return np.asarray(before + after)

    def _evenly(self, slight: bool) -> Bools:
        """(v,) True where the profiles about a vertex bend like its own, the less so where
        ``slight`` edges are found by themselves."""
        before, after = self.neighbours
        mean = self._seconds[1]
        with np.errstate(invalid="ignore"):
            apart = [
                np.where(other < 0, np.nan, np.abs(mean - mean[other])) for other in (before, after)
            ]
            return np.asarray(np.fmax(*apart) <= (_EVEN_ELSE if slight else _EVEN) * self.sigma)

    def _creases(self, slight: bool, ends: bool) -> tuple[Floats, Floats]:
        """(v,) mm twice: how far an edge between a vertex and the profile before, and after, it
        stands off their chord, from the second differences along the normal.

        An edge that divides a step as t : 1 − t bends the profiles beside it by (1 − t) and t of
        its turn, and stands t (1 − t) of that off the chord: the product of the two bends over
        their sum. What the profiles further out bend as well is no edge, nor is what noise bends:
        each of the two, or, for a ``slight`` one, both together. Of a profile beyond which there is
        none nobody knows how the surface bends there: at the ``ends``, as much as before it.
        """
        (before, after), (second, _) = self.neighbours, self._seconds
        out = []
        for near, far in ((before, after), (after, before)):
            there = (near >= 0) & (far >= 0)
            beyond = np.where(there, near[near], -1)
            with np.errstate(invalid="ignore", divide="ignore"):
                sign = np.sign(second)
                mine = sign * (second - np.where(far >= 0, second[far], np.nan))
                other = sign * (second[near] - np.where(beyond >= 0, second[beyond], np.nan))
                noise = np.hypot(self.sigma, self.sigma[near])
                if ends:
                    last = there & (beyond < 0) & (mine > _ALONE * noise)
                    other = np.where(last, mine, other)
                sure = slight & (mine + other > _SURE * noise)
                least = np.where(sure, 0.0, _BENT * noise)
                mine, other = (
                    np.sqrt(np.maximum(e * np.abs(e) - least**2, 0)) for e in (mine, other)
                )
                off = mine * other / (mine + other)
            out.append(np.where(there, np.nan_to_num(off), 0.0))
        return out[0], out[1]

    @cached_property
    def at_ends(self) -> Floats:
        """(v,) mm: how far off the chord to the profile beside it the surface may lie, right before
        a vertex of a profile beyond which there is none; 0 at others, and where no edge was seen.

        Of an edge there the profile on its other side alone shows a bend. The nearer it is to the
        last one the more it turns for the same bend, so that all along the chord it stands off by
        up to that part of this which is its part of the way.
        """
        (before, after), seconds = self.neighbours, self._seconds
        out = np.zeros(len(self.ranks))
        for near, none in ((before, after), (after, before)):
            last = np.flatnonzero((near >= 0) & (none < 0))
            last = last[near[near[last]] >= 0]
            bent, far = near[last], near[near[last]]
            noise = _ALONE * np.hypot(self.sigma[last], self.sigma[bent])
            for second, part in zip(seconds, (1.0, _MEAN), strict=True):
                with np.errstate(invalid="ignore"):
                    more = (second[bent] - second[far]) ** 2 - (part * noise) ** 2
                out[last] = np.fmax(out[last], np.sqrt(np.maximum(more, 0.0)))
        return out


def range_surfaces(grid: RangeGrid, tears: TearLimits | None = None) -> list[RangeSurface]:
    """The surface of a grid, and apart from it what the sheet met beyond the rotation axis.

    Raises InputError for a grid that does not know where its camera stood.
    """
    behind = np.zeros(grid.flags.shape, bool) if grid.behind is None else grid.behind
    return [_surface(grid, part, tears) for part in (~behind, behind) if (part & grid.found).any()]


def _surface(grid: RangeGrid, keep: Bools, tears: TearLimits | None) -> RangeSurface:
    if grid.eyes is None:
        raise InputError(
            f"{grid.laser}: the camera position is unknown",
            hint=Remedy("merge with ", Option("merge", "paste")),
        )
    part = grid
    if (grid.found & ~keep).any():
        part = replace(grid, points=np.where(keep[..., None], grid.points, np.nan))
    mesh = mesh_grid(part, tears)
    if mesh.provenance is None:
        raise TypeError("the mesh of a grid knows its steps")
    order = np.argsort(grid.steps, kind="stable")
    at = order[np.searchsorted(grid.steps[order], mesh.provenance.step)]
    measured = grid if grid.origin is None else grid.origin.grid
    line = mesh.provenance.line
    return RangeSurface(
        mesh, grid.eyes[at], smoothed_normals(mesh), _random(measured, at, line), grid.alike,
        measured.sigma[at, line],
    )  # fmt: skip


def _random(grid: RangeGrid, step: Longs, line: Ints) -> Floats | None:
    """(v,) `RangeSurface.random` of the points at these rows and lines of a grid as measured."""
    lines = grid.lines_about()
    some = grid.of_lines(lines)
    if some.noise is None:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        part = (some.noise / some.sigma) ** 2
    part = np.minimum(np.nan_to_num(part, nan=1.0), 1.0)
    return np.asarray(np.minimum(part, _between_edges(part, some))[step, line - lines.start])


def _between_edges(random: Floats, grid: RangeGrid) -> Floats:
    """(s, n) the part of each point's variance that is ``random`` (s, n) beside it, on that side
    where it is more: little where edges run along the profiles close by on both sides, as points
    of the face between, which state no more than noise, are then moved by them alike.

    How far light reaches over an edge is not asked where nobody knows how thick the sheet is.
    """
    from scipy.ndimage import median_filter

    # One long line, on which the filter is eight times as fast as on many.
    ends = np.pad(random, ((0, 0), (_RUNS, _RUNS)), mode="edge")
    runs = median_filter(ends.ravel(), size=2 * _RUNS + 1).reshape(ends.shape)[:, _RUNS:-_RUNS]
    reach = _REACH * grid.thickness if grid.thickness > 0 else np.inf
    size, sides = len(random), np.ones((2, *random.shape))
    for side, way in zip(sides, (-1, 1), strict=True):
        for k in range(1, _NARROW + 1):
            at = np.arange(size) + way * k
            there = grid.closed | ((at >= 0) & (at < size))
            apart = np.linalg.norm(grid.points[at % size] - grid.points, axis=-1)
            near = there[:, None] & (apart <= reach)
            np.minimum(side, np.where(near, runs[at % size], 1.0), out=side)
    return np.asarray(sides.max(axis=0))


def spacing(surfaces: Sequence[RangeSurface]) -> float:
    """The usual distance between points, mm: the root of twice the area of the usual face."""
    from turnscan.mesh import _normal_kernels as kernels

    double = [kernels.doubles(s.mesh.vertices, s.mesh.faces) for s in surfaces]
    return float(np.sqrt(np.median(np.concatenate([d[d > 0] for d in double]))))


def rise(surfaces: Sequence[RangeSurface]) -> float:
    """The usual distance in height between points of a profile, mm."""
    from turnscan.mesh import _normal_kernels as kernels

    known = [(s.mesh, s.mesh.provenance) for s in surfaces]
    rises = [kernels.rises(m.vertices, m.faces, p.step) for m, p in known if p is not None]
    usual = np.concatenate([np.zeros(0), *rises])
    return float(np.median(usual, overwrite_input=True)) if len(usual) else spacing(surfaces)

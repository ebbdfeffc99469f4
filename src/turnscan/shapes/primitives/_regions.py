"""Regions of a mesh that lie on analytic surfaces: grown from patches, and judged by their misfit.

A smooth freeform patch fits any flexible surface as far as its tolerance reaches, and then its
misfit is larger than the noise that neighbours have among themselves, and has a pattern: the means
of small cells stand off by a good part of the tolerance. A true surface ends at an edge, and what
its points miss it by is noise. A region counts where both, `excess` and `pattern`, are small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh, vertex_normals
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._start import first_guesses
from turnscan.shapes.primitives._surface_kernels import (
    CONE,
    CYLINDER,
    FREE,
    PLANE,
    SPHERE,
    TORUS,
)

Index = npt.NDArray[np.int64]

LIMIT = 3.0
"""Standard deviations that a point may be off its surface."""
_CURVED = (1.2, 1.7)
"""Vertices that scatter so many times as much with the curvature as without it lie close together
on the surface, and so many times as far apart: then the curvature is no noise. Between the two, a
part of it is."""
_LINES, _LONG, _ENOUGH = 2000, (10, 20), 50
"""Lines of vertices that noise is asked of, about; vertices on each, in turn; and how many lines
must go on so far, straight over the mesh."""
_BENDS = 3.0
"""Times as much that a longer line stands off where the surface bends; noise that neighbours share
gives up to 2.2."""
_FOLLOWED = 1.3
"""Noise of points over what lines of them stand off their cubics, which follow some of it. Points
of simulated planes, cylinders and tori miss these by 1.1 to 1.5 times as much."""
_TWICE = 1.2582
"""Deviation of independent noise less the mean of its neighbours, taken twice, over once."""
_PATTERN = 0.15
"""Share of the tolerance that the means of cells may stand off the surface."""
_EXCESS = 0.22
"""Share of the tolerance by which points may miss their surface beyond what their neighbours say
is noise, root mean square. Freeform has 0.25 to 0.45, shapes of scans less than 0.17."""
WAVY = 0.2
"""The same for the means along stripes: shapes of scans have up to 0.12, freeform 0.27 and more."""
_TURN = float(np.cos(np.radians(25.0)))
"""Between the normal of the surface and the smooth normal of the mesh."""
_GENTLE = float(np.cos(np.radians(20.0)))
"""Between smooth normals of neighbours within the patch of a seed."""
_PATCH, _LARGE, _SMALL = 80, 320, 32
"""Vertices of the patch that a region starts from; then of a larger one where that gives nothing,
of a smaller one where no surface fits it: it reaches over the edges of a narrow face."""
_NARROW = (PLANE, CONE)
"""What narrow faces are: shoulders and chamfers; a strip of a cone lies on a cylinder, too."""
LEAST = (60, 400, 200, 400, 500)
"""Vertices that a region of each kind must have."""
_SIMPLEST = (PLANE, CYLINDER, CONE, SPHERE, TORUS)
SPAN = float(np.radians(20.0))
"""Angle that the normals of a curved region span at the least: less of it says no radius."""
_CELL = 9
"""Vertices of a cell, about."""
_AVERAGED, _TOGETHER = 1.4, (4.0, 16.0)
"""Usual sigmas over the noise between neighbours from which points are off together, as they are
where several lasers were merged; and so many at the least then, and at the most."""
_TELLING = (20, 30)
"""Cells that a plane and a curved surface must have then: few large ones fit anything."""
_CLEAR = 0.05
"""A plane whose pattern stays below this is not compared with curved surfaces."""
_FIT, _GROWING = 4000, 400
"""Points that a fit looks at, and while a region grows."""
_ROUNDS, _GROWTH = 24, 4
"""Of growth, each at most so many times as large as the one before: what turns out to be freeform
has not been looked at far and wide by then."""
_SETTLING = 3
"""Rounds of growth at the end, with fits to more points."""
_HOPELESS = (0.26, 0.38)
"""Excess beyond which a region that grows is given up: its surface is that through its points, and
`_GROWING` of them tell the excess to 0.02; and the same where neighbours are off together, all of
whose noise counts as excess: one standard deviation of it is a third."""
_TANGENT, _TRIMS, _LEVEL = (PLANE, CYLINDER), 8, 0.2
"""Kinds that others are tangent to; how often what such others have is taken off at most; and the
share of the limit that a point and those about it may stand off on average."""
_INNER, _LEFT, _FLAT = 0.4, 0.6, 0.08
"""Shares of a region that must be left while that goes on, and of it in one piece at the end: a
freeform wall has 0.2 to 0.5; and the pattern that it may have."""
_STEPS = 6
"""Of a fit while a region grows."""
_MISFIT = 2.0
"""Mean square, in standard deviations, that a patch may miss its first surface by."""
_ALMOST = 0.93
"""Share of the largest area that a simpler kind must reach."""
_GUESS = 1000
"""Points that a simpler kind is guessed from."""
_CALM = 0.10
"""Radians that a smooth normal may be uncertain by."""
_DOUBTFUL = 2.5
"""Medians of sigma beyond which a point may be doubtful, its stripe cut or bent by an edge, and how
many times worse than others about it such a point is known."""
_ABOUT, _MIXED = 60, 0.25
"""Vertices about a point that its sigma is compared with, and the share of them that is known so
much better where an edge is the cause: a whole face that is known worse has none."""
_POOR, _FEW, _MANY = 1.8, 8, 4
"""Usual sigmas from which a region is known badly, and the stripes that it then needs: bands of
three to five of them stand beside edges of scans where nothing is, up to 2 mm off the part. A scan
of less than four times as many stripes has no more of them on a whole face."""
_WIDE = 5.0
"""Times three standard deviations that a region must be wide: narrower bands lie on anything. Bands
of edges that are known to a millimetre have up to 3.3, shapes of scans 20 and more."""
_ROWS = (3.5, 4.5)
"""Rows of vertices side by side that a plane must have, and a round across its curve, where no
sigma tells which of them an edge has bent: three lie on a hollow round over each gap of a gear."""
_WRAPPED = 0.5
"""Length of the mean normal of a round that goes so far about its axis that its rows are many."""
_FIRM = 0.65
"""Share of a region's points that must not be doubtful: stripes that an edge bends lie on smooth
bands, too, across the corners of keyways and beside silhouettes. Those have up to 0.55 of them."""


@dataclass(frozen=True)
class Ground:
    """A mesh prepared for growing."""

    vertices: Floats
    """(v, 3) mm."""
    normals: Floats
    """(v, 3) smooth, outward."""
    start: Index
    near: npt.NDArray[np.int32]
    """Neighbours, near[start[i]:start[i + 1]]."""
    border: Bools
    """(v,) beside an open border of what was measured."""
    scale: Floats
    """(v,) mm: one standard deviation of each vertex."""
    limit: Floats
    """(v,) mm: how far each may lie off its surface."""
    firm: Bools
    """(v,) False where a point is doubtful; what is said of a region rests on the others."""
    area: Floats
    """(v,) mm² that belongs to each."""
    turn: Floats
    """(v,) how far smooth normals turn to the neighbours, 1 − cos."""
    off: Floats
    """(v,) mm: how far each stands off the mean of its neighbours, scaled to its noise."""
    spacing: float
    """mm between neighbours."""
    stripe: Index | None
    """(v,) number of the stripe that measured each; None where not known."""
    along: Index | None
    """(v,) place of each in the order of stripes and of the lines on them; None as for stripes."""
    stripes: int
    """How many there are."""
    usual: float
    """mm: the median of ``scale``."""

    size: float
    """mm: diagonal of the box around it."""
    together: float
    """Neighbours that are off together, about, as a merge leaves them that averages; 1 for none."""
    blind: bool
    """Whether no sigma tells which points an edge has bent or cut."""

    @property
    def neighbourhood(self) -> region.Neighbourhood:
        """What the kernels of growing take of it."""
        return region.Neighbourhood(self.vertices, self.normals, self.limit, self.start, self.near)


@dataclass
class Region:
    """Vertices on one surface, while regions are looked for."""

    kind: int
    q: Floats
    side: float
    """+1 where the surface's normal looks outward."""
    member: Index

    def rank(self) -> int:
        """The simplest kind first. A sphere comes after a cone, although it has fewer parameters: a
        narrow ring, such as a chamfer, lies on both, and its curvature across is not seen."""
        return _SIMPLEST.index(self.kind)


def prepared(
    mesh: Mesh, sigma: Floats | None, tolerance: float | None, swept: bool = False
) -> Ground:
    """A mesh ready for growing; ``sigma`` (v,) mm of its points, ``tolerance`` mm if given.

    ``swept`` for a search that averages over places some neighbours wide: what the surface does
    between neighbours counts as noise then.
    """
    X = mesh.vertices
    start, near = region.neighbours(mesh.faces, len(X))
    raw = np.nan_to_num(vertex_normals(mesh))
    tail = np.repeat(np.arange(len(X)), np.diff(start))
    steps = np.linalg.norm(X[tail] - X[near], axis=1)
    spacing = float(np.median(steps)) if len(steps) else 0.0
    rounds = _rounds_for(raw, tail, near)
    normals = region.smoothed(raw, start, near, rounds)
    off, turn = region.scatter(X, normals, start, near)
    size = float(np.linalg.norm(np.ptp(X, axis=0)))
    if sigma is not None or not swept:
        off = _less_curved(off, tail, near)
    lines = (math.nan, math.nan) if swept else _along_lines(X, normals, start, near)
    off, noise, alone = _noise(off, lines, sigma is None and not swept)
    noise, alone = max(noise, 1e-5 * size), max(alone, 1e-5 * size)
    scale = np.full(len(X), alone) if sigma is None else np.maximum(sigma, noise)
    floor = max(LIMIT * noise, 1e-4 * size)
    limit = np.full(len(X), tolerance) if tolerance else np.maximum(LIMIT * scale, floor)
    if tolerance:
        scale = np.minimum(scale, tolerance / LIMIT)
    firm = _firm(scale, region.Neighbourhood(X, normals, limit, start, near))
    t = mesh.triangles
    faces = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 6
    area = np.bincount(mesh.faces.ravel(), np.repeat(faces, 3), minlength=len(X)).astype(float)
    many = np.bincount(mesh.faces.ravel(), minlength=len(X))
    border = np.diff(start) > many
    stripe, along = _stripe_numbers(mesh), None
    if stripe is not None and mesh.provenance is not None:
        along = np.empty(len(X), dtype=np.int64)
        along[np.lexsort((mesh.provenance.line, stripe))] = np.arange(len(X))
    return Ground(
        X, normals, start, near, border, scale, limit, firm, area, turn, off, spacing,
        stripe, along, 0 if stripe is None else len(np.unique(stripe)),
        float(np.median(scale)) if len(scale) else 0.0, size, _together(scale, noise),
        sigma is None,
    )  # fmt: skip


def _usual(off: Floats) -> float:
    """mm: the noise of vertices that stand (v,) off the mean of their neighbours."""
    seen = np.abs(off[off != 0.0])
    return 1.4826 * float(np.median(seen)) if len(seen) else 0.0


def _along_lines(
    X: Floats, normals: Floats, start: Index, near: npt.NDArray[np.int32]
) -> tuple[float, float]:
    """mm: the noise that lines of neighbours have about smooth ones, and as much of it as is surely
    noise; NaN where there are too few.

    Neighbours on a line lie closer than those across it where the turn is coarse, so that a cubic
    takes what the surface does; and noise that a few neighbours share is seen, too. What stands off
    far more than a line of half its length may bend as no cubic does.
    """
    seeds = np.arange(0, len(X), max(1, len(X) // _LINES))
    known = list[float]()
    for many in _LONG:
        off = region.off_lines(seeds, many, X, normals, start, near)
        off = off[np.isfinite(off)]
        if len(off) < _ENOUGH:
            return math.nan, math.nan
        known.append(_FOLLOWED * float(np.median(off)))
    short, long = known
    return long, long if long <= _BENDS * short else short


def _noise(off: Floats, lines: tuple[float, float], unknown: bool) -> tuple[Floats, float, float]:
    """What vertices stand off their neighbours (v,) mm, the noise that these differ by, and all of
    it; ``lines`` have so much of it, and surely so much (`_along_lines`).

    What neighbours differ by beyond that is what the surface does between them. Where sigma is
    ``unknown`` each counts as if neighbours shared none of theirs; nowhere more than in the middle:
    what is rougher may be freeform as well, and nothing tells.
    """
    noise = _usual(off)
    most, sure = lines
    if most < noise:
        off, noise = off * (most / noise), most
    alone = noise if math.isnan(sure) else max(noise, sure)
    if unknown:
        middle = alone / 1.4826
        off = np.clip(off * (alone / max(noise, 1e-300)), -middle, middle)
    return off, noise, alone


def _less_curved(off: Floats, tail: Index, near: npt.NDArray[np.int32]) -> Floats:
    """(v,) How vertices stand off the mean of their neighbours, with as much of the curvature taken
    off as these are far apart on the surface."""
    flat = _without_curvature(off, tail, near)
    ratio = _usual(off) / max(_usual(flat), 1e-300)
    share = float(np.clip((ratio - _CURVED[0]) / (_CURVED[1] - _CURVED[0]), 0.0, 1.0))
    return np.asarray(off + share * (flat - off))


def _without_curvature(off: Floats, tail: Index, near: npt.NDArray[np.int32]) -> Floats:
    """(v,) How vertices stand off the mean of their neighbours, less what these do: between the
    profiles of a coarse turn all of a curved surface does. Scaled to one standard deviation of
    independent noise, on a mesh of six neighbours."""
    many = np.bincount(tail, minlength=len(off))
    mean = np.bincount(tail, off[near], minlength=len(off)) / np.maximum(many, 1)
    return np.asarray(np.where(off == 0.0, 0.0, (off - mean) / _TWICE))


def _together(scale: Floats, noise: float) -> float:
    """How many neighbours are off together: these differ by less than each of them is off."""
    share = float(np.median(scale)) / noise if len(scale) else 1.0
    return float(np.clip(share * share, *_TOGETHER)) if share > _AVERAGED else 1.0


def _stripe_numbers(mesh: Mesh) -> Index | None:
    known = mesh.provenance
    if known is None or not (known.step >= 0).any():
        return None
    return known.step.astype(np.int64) * (len(known.lasers) + 1) + known.laser


def _firm(scale: Floats, ground: region.Neighbourhood) -> Bools:
    """(v,) False where a point is known worse than most of the part and than others about it."""
    if not len(scale):
        return np.ones(0, dtype=np.bool_)
    firm = np.asarray(scale <= _DOUBTFUL * float(np.median(scale)), dtype=np.bool_)
    worse = np.flatnonzero(~firm)
    share = region.better_about(worse, scale / _DOUBTFUL, scale, ground, _ABOUT, _TURN)
    firm[worse] = share < _MIXED
    return firm


def _rounds_for(raw: Floats, tail: Index, near: npt.NDArray[np.int32]) -> int:
    """Rounds of smoothing after which normals are calm: k rounds average about 3 k² of them."""
    if not len(tail):
        return 0
    dots = np.einsum("ij,ij->i", raw[tail[::7]], raw[near[::7]])
    angle = float(np.median(np.arccos(np.clip(dots, -1, 1))))
    return int(np.clip(np.ceil(angle / _CALM), 1, 8))


def grow_regions(ground: Ground, least: float, most: int) -> list[Region]:
    """Regions of at least ``least`` mm², at most ``most`` of them, in the order they were found."""
    label = np.full(len(ground.vertices), -1, dtype=np.int64)
    seen = np.zeros(len(ground.vertices), dtype=np.int64)
    search = _Search(ground, label, seen, least)
    found: list[Region] = []
    order = np.argsort(np.round(np.log2(np.maximum(ground.turn, 1e-7)) * 2), kind="stable")
    for seed in order:
        if len(found) >= most:
            break
        if label[seed] != -1 or ground.turn[seed] > 1.0 - _GENTLE:
            continue
        best = search.from_seed(int(seed))
        if best is None:
            continue
        label[best.member] = len(found)
        found.append(best)
    return found


class _Search:
    """The search for one region after the other; marks what it has tried."""

    def __init__(self, ground: Ground, label: Index, seen: Index, least: float) -> None:
        self.ground, self.label, self.seen, self.least = ground, label, seen, least
        self.near = ground.neighbourhood
        share = least / max(float(ground.area.sum()), 1e-300)
        self.tried = max(_LARGE, int(share * len(label)))
        """Vertices about a seed of no surface that are no seeds either: of a dense mesh as many as
        the smallest region has."""
        self.place = np.full(len(label), -1, dtype=np.int64)
        """Room for what is asked of a region's members."""
        self.mark = 0
        self.reached = 0
        """Vertices of the smallest region that was given up since a patch was tried."""

    def _marks(self) -> region.Marks:
        return region.Marks(self.label, self.seen, self.mark)

    def from_seed(self, seed: int) -> Region | None:
        """The simplest region that says about all that any says, or None."""
        many = _PATCH
        while many:
            self.mark += 1
            ball = region.patch(seed, many, self.near, self._marks(), _GENTLE)
            if len(ball) < min(many, _PATCH) // 2:
                break
            self.reached = _LARGE
            best, begun = self._from_patch(ball)
            if best is not None:
                return self._simplest(best)
            # A larger patch says more only where some surface was given up before it was as large.
            larger = _LARGE if self.reached < _LARGE else 0
            many = 0 if many != _PATCH else larger if begun else _SMALL
        self.mark += 1
        tried = region.patch(seed, self.tried, self.near, self._marks(), _GENTLE)
        self.label[tried] = np.where(self.label[tried] == -1, -2, self.label[tried])
        return None

    def _from_patch(self, ball: Index) -> tuple[Region | None, bool]:
        """The best region that grows from a patch, and whether any surface fits the patch itself.

        A plane that fits well goes alone. From a small patch, planes and cones alone are tried.
        """
        g, begun, options = self.ground, False, list[Region]()
        for kind, guess in first_guesses(g.vertices[ball], g.normals[ball]):
            if len(ball) <= _SMALL and kind not in _NARROW:
                continue
            q = self._begun(kind, guess, ball)
            if q is None:
                continue
            begun = True
            r = self._grown(kind, q, ball)
            if r is None:
                continue
            if kind == PLANE and pattern(g, kind, r.q, r.member) < _CLEAR:
                return r, True
            options.append(r)
        if not options:
            return None, begun
        top = max(map(self._area, options))
        return min((o for o in options if self._area(o) >= _ALMOST * top), key=Region.rank), True

    def _begun(self, kind: int, guess: Floats, member: Index) -> Floats | None:
        """The surface of one kind through members, from a guess, where it fits them."""
        g = self.ground
        some = surface.some_of(member, _FIT)
        q, cost = surface.fitted(
            kind, guess, g.vertices, g.scale, some, FREE[kind], 6.0, 4 * g.size, 2 * _STEPS,
            surface.ROUGH,
        )  # fmt: skip
        return q if cost <= _MISFIT * len(some) else None

    def _area(self, r: Region) -> float:
        return float(self.ground.area[r.member].sum())

    def _simplest(self, best: Region) -> Region:
        """The region as a simpler kind that says about as much, begun from all of its vertices.

        A patch may be too small to tell the radius of a cylinder by, and a cone finds its way.
        """
        g = self.ground
        some = surface.some_of(best.member, _GUESS)
        guesses = first_guesses(g.vertices[some], g.normals[some])
        for kind, guess in sorted(guesses, key=lambda o: _SIMPLEST.index(o[0])):
            if _SIMPLEST.index(kind) >= best.rank():
                break
            q = self._begun(kind, guess, best.member)
            other = None if q is None else self._grown(kind, q, best.member)
            if other is not None and self._area(other) >= _ALMOST * self._area(best):
                return other
        return best

    def _grown(self, kind: int, q: Floats, ball: Index) -> Region | None:
        """The region of one kind that grows from a patch, if it is one."""
        g = self.ground
        q, member = self._spread(kind, q, ball)
        if not len(member):
            return None
        self.reached = min(self.reached, len(member))
        side = _side(g, kind, q, ball)
        for _ in range(_SETTLING):
            self.mark += 1
            on = region.Surface(kind, q, side)
            most = len(g.vertices)
            member = region.grown(on, self.near, self._marks(), member, _TURN, most)
            q, cost = refit(g, kind, q, member) if len(member) else (q, np.inf)
            if not np.isfinite(cost):
                return None
        if not self._enough(kind, q, member):
            return None
        if not fair(g, kind, q, member):
            return self._trimmed(kind, q, member)
        return Region(kind, q, _side(g, kind, q, member), member)

    def _enough(self, kind: int, q: Floats, member: Index) -> bool:
        """Whether members are as many, as much of the surface, and as round as a shape must be."""
        g = self.ground
        if len(member) < LEAST[kind] or float(g.area[member].sum()) < self.least:
            return False
        return kind == PLANE or _span(g, kind, q, member) >= SPAN

    def _trimmed(self, kind: int, q: Floats, member: Index) -> Region | None:
        """A region without what it took of surfaces that it runs into without an edge, such as the
        fillets beside a wall; None where that is no shape.

        What stands off the surface together with those about it does not count, until nothing else
        does. Of freeform surface less than half is left then, for the width within which it bends
        by some part of the limit goes with the root of that part.
        """
        g = self.ground
        if kind not in _TANGENT:
            return None
        inner, kept = member, member[:0]
        for _ in range(_TRIMS):
            d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
            level = region.levelled(member, d, g.start, g.near, 2, self.place)
            inner = member[np.abs(level) <= _LEVEL]
            if len(inner) < _INNER * len(member):
                return None
            q, cost = refit(g, kind, q, inner)
            if not np.isfinite(cost):
                return None
            if len(inner) == len(kept):
                break
            kept = inner
        inner = region.largest_piece(inner, g.start, g.near, self.place)
        if len(inner) < _LEFT * len(member) or not self._enough(kind, q, inner):
            return None
        if not fair(g, kind, q, inner) or pattern(g, kind, q, inner) > _FLAT:
            return None
        return Region(kind, q, _side(g, kind, q, inner), inner)

    def _spread(self, kind: int, q: Floats, ball: Index) -> tuple[Floats, Index]:
        """The surface and the vertices that a patch grows to; none where that is hopeless."""
        g, member = self.ground, ball
        none = np.zeros(0, dtype=np.int64)
        side = _side(g, kind, q, ball)
        for turn in range(_ROUNDS):
            self.mark += 1
            on = region.Surface(kind, q, side)
            most = _GROWTH * len(member)
            grown = region.grown(on, self.near, self._marks(), member, _TURN, most)
            if len(grown) < 0.6 * len(ball):
                self.reached = 0
                return q, none
            enough = len(grown) <= 1.01 * len(member) and turn > 1
            member = grown
            some = surface.some_of(member, _GROWING)
            q, cost, misfit = surface.refitted(
                kind, q, g.vertices, g.scale, g.limit, g.off, some, 4 * g.size, _STEPS
            )
            if not np.isfinite(cost):
                return q, none
            if enough:
                break
            if len(member) > len(ball) and misfit > _HOPELESS[_together_on(g, kind) > 1.0]:
                self.reached = min(self.reached, len(member))
                return q, none
        return q, member


def _span(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """Radians between normals of the surface over a region."""
    return spanned(surface.distances(kind, q, g.vertices[surface.some_of(member, 500)])[1])


def spanned(normals: Floats) -> float:
    """Radians between normals (n, 3): twice the widest from their mean; π where they go round."""
    mean = normals.mean(axis=0)
    long = float(np.linalg.norm(mean))
    if long < 0.5:
        return float(np.pi)
    return 2 * float(np.arccos(np.clip(np.quantile(normals @ (mean / long), 0.02), -1, 1)))


def merged(g: Ground, regions: list[Region]) -> list[Region]:
    """Regions of one surface joined: a side that a groove or a shadow cuts in two is one side."""
    done: list[Region] = []
    for r in sorted(regions, key=lambda r: -len(r.member)):
        for k, other in enumerate(done):
            both = _joined(g, other, r)
            if both is not None:
                done[k] = both
                break
        else:
            done.append(r)
    return done


def _joined(g: Ground, a: Region, b: Region) -> Region | None:
    """One region of both, where one surface says both as well as two."""
    if a.kind != b.kind or a.side != b.side:
        return None
    some = surface.some_of(b.member, 200)
    d = np.abs(surface.distances(a.kind, a.q, g.vertices[some])[0]) / g.limit[some]
    if float(np.median(d)) > 5.0:
        return None
    member = np.concatenate([a.member, b.member])
    even = np.concatenate(
        [surface.some_of(a.member, _FIT // 2), surface.some_of(b.member, _FIT // 2)]
    )
    q, cost = refit(g, a.kind, a.q, even)
    if not np.isfinite(cost) or _side(g, a.kind, q, b.member) != b.side:
        return None
    if max(pattern(g, a.kind, q, part.member) for part in (a, b)) > _PATTERN:
        return None
    return Region(a.kind, q, a.side, member)


def _side(g: Ground, kind: int, q: Floats, member: Index) -> float:
    some = surface.some_of(member, 200)
    n = surface.distances(kind, q, g.vertices[some])[1]
    return 1.0 if float(np.einsum("ij,ij->", n, g.normals[some])) >= 0 else -1.0


def refit(
    g: Ground, kind: int, q: Floats, member: Index, most: int = _FIT, steps: int = _STEPS
) -> tuple[Floats, float]:
    """The surface through members again, and its cost per point."""
    some = surface.some_of(member, most)
    q = surface.slid(kind, q, g.vertices, some)
    q, cost = surface.fitted(
        kind, q, g.vertices, g.scale, some, FREE[kind], surface.BOUND, 4 * g.size, steps
    )
    return q, cost / len(some)


def cells(g: Ground, member: Index, together: float = 1.0) -> Index:
    """(n,) number of the cell of space that each member is in; about `_CELL` share one, or so many
    times as many as are off ``together``."""
    side = max(g.spacing * np.sqrt(_CELL * together), 1e-9)
    at = np.floor((g.vertices[member] - g.vertices[member].min(axis=0)) / side).astype(np.int64)
    wide = at.max(axis=0) + 1
    keys = (at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2]
    return np.unique(keys, return_inverse=True)[1].astype(np.int64)


def fair(g: Ground, kind: int, q: Floats, member: Index) -> bool:
    """Whether firm members are enough, in number and share, and miss the surface by noise."""
    enough = max(LEAST[kind], _FIRM * len(member))
    if int(g.firm[member].sum()) < enough or bent(g, member):
        return False
    if g.blind and rows(g, kind, q, member) < (_ROWS[0] if kind == PLANE else _ROWS[1]):
        return False
    return close(g, kind, q, member)


def rows(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """How many rows of vertices lie side by side across a region: of a plane where it is narrowest,
    of a cylinder or cone round its axis, which tells the radius; infinite for the others."""
    X = g.vertices[member]
    if kind == PLANE:
        across = np.linalg.eigh(np.cov(X.T))[1][:, 1:]
        along = (X - X.mean(axis=0)) @ across
    elif kind in (CYLINDER, CONE):
        n = surface.distances(kind, q, X)[1]
        turn = np.cross(q[3:6], n.mean(axis=0))
        if np.linalg.norm(n.mean(axis=0)) < _WRAPPED:
            return math.inf
        along = ((X - q[:3]) @ (turn / np.linalg.norm(turn)))[:, None]
    else:
        return math.inf
    at = np.full((len(g.vertices), along.shape[1]), np.nan)
    at[member] = along
    some = surface.some_of(member, _FIT)
    most = np.zeros((len(some), along.shape[1]))
    first, many = g.start[some], g.start[some + 1] - g.start[some]
    for k in range(int(many.max(initial=0))):
        near = g.near[first + np.minimum(k, many - 1)]
        most = np.fmax(most, np.abs(at[near] - at[some]))
    wide = np.quantile(along, 0.98, axis=0) - np.quantile(along, 0.02, axis=0)
    return float((wide / np.maximum(np.median(most, axis=0), 1e-9)).min()) + 1.0


def bent(g: Ground, member: Index) -> bool:
    """Whether members are a few stripes that are known badly, as beside edges: what bends a stripe
    there does so alike all along it, and a band of such stripes is as smooth as a face."""
    if g.stripe is None or not poor(g, member):
        return False
    many = np.unique(g.stripe[member], return_counts=True)[1].astype(float)
    # A stripe of which a point or two lie at the end of the band is no stripe of it.
    full = float(many.sum()) ** 2 / float((many**2).sum())
    return full < _FEW <= g.stripes / _MANY


def poor(g: Ground, member: Index) -> bool:
    """Whether members are known worse than most of the part."""
    return float(np.median(g.scale[member])) > _POOR * g.usual


def wide(g: Ground, member: Index) -> bool:
    """Whether members cover a band that is much wider than what each is known to."""
    X = g.vertices[member]
    long = math.sqrt(12.0 * float(np.linalg.eigvalsh(np.cov(X.T))[-1]))
    return float(g.area[member].sum()) >= _WIDE * LIMIT * float(np.median(g.scale[member])) * long


def close(g: Ground, kind: int, q: Floats, member: Index) -> bool:
    """Whether what firm members miss the surface by is noise: that of each, or of neighbours that
    are off together. Cones, spheres and tori bend to too much of a freeform wall for the latter."""
    firm = member[g.firm[member]]
    if not len(firm):
        return False
    plain, together = excess(g, kind, q, firm), _together_on(g, kind)
    if plain <= _EXCESS and pattern(g, kind, q, firm) <= _PATTERN:
        return True
    return (
        together > 1.0
        and plain <= _HOPELESS[1]
        and excess(g, kind, q, firm, together=together) <= _EXCESS
        and pattern(g, kind, q, firm, together) <= _PATTERN
    )


def _together_on(g: Ground, kind: int) -> float:
    return g.together if kind in (PLANE, CYLINDER) else 1.0


def excess(
    g: Ground, kind: int, q: Floats, member: Index, most: int = _FIT, together: float = 1.0
) -> float:
    """How far members miss the surface beyond their own noise, each over its own tolerance.

    The noise is what each stands off its neighbours by, half of them less and half of them more;
    where so many are off ``together``, what each stands off the mean of its cell by.
    """
    some = surface.some_of(member, most)
    d = surface.distances(kind, q, g.vertices[some])[0] / g.limit[some]
    noise = 1.4826 * float(np.median(np.abs(g.off[some] / g.limit[some])))
    if together > 1.0:
        cell = cells(g, some, together)
        count = np.bincount(cell)
        mean = np.bincount(cell, d) / np.maximum(count, 1)
        free = max(len(some) - int((count > 0).sum()), 1)
        noise = max(noise, float(np.sqrt(((d - mean[cell]) ** 2).sum() / free)))
    return float(np.sqrt(max(float(np.mean(d * d)) - noise**2, 0.0)))


def pattern(g: Ground, kind: int, q: Floats, member: Index, together: float = 1.0) -> float:
    """How far the means of cells stand off the surface, root mean square, over its tolerance.

    What independent noise gives them is taken off, and the worst tenth, which lies at edges. Where
    so many points are off ``together``, fewer cells than tell anything say that it is no surface.
    """
    d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
    off = _means_off(
        d, cells(g, member, together), 6 if together == 1.0 else _TELLING[kind != PLANE]
    )
    if off is not None:
        return off
    return 0.0 if kind == PLANE and together == 1.0 else float("inf")


def waves(g: Ground, kind: int, q: Floats, member: Index) -> float:
    """The same of the means of `_CELL` neighbours on one stripe; 0 where stripes are not known.

    Where stripes stand further apart than the points on them, a cell of space averages the waves
    out that a freeform surface makes along each stripe.
    """
    if g.stripe is None or g.along is None:
        return 0.0
    member = member[np.argsort(g.along[member])]
    d = surface.distances(kind, q, g.vertices[member])[0] / g.limit[member]
    first = np.diff(g.stripe[member], prepend=-1) != 0
    number = np.arange(len(member))
    run = (number - np.maximum.accumulate(np.where(first, number, 0))) // _CELL
    off = _means_off(d, np.cumsum(first | (np.diff(run, prepend=0) != 0)) - 1)
    return 0.0 if off is None else off


def _means_off(d: Floats, cell: Index, least: int = 6) -> float | None:
    """Root mean square of the means of values over cells; None where there are too few."""
    count = np.bincount(cell)
    good = count >= 4
    if good.sum() < least:
        return None
    mean = np.bincount(cell, d)[good] / count[good]
    spread = np.bincount(cell, d * d)[good] / count[good] - mean**2
    keep = np.abs(mean) <= np.quantile(np.abs(mean), 0.9)
    noise = float((spread / (count[good] - 1))[keep].mean())
    return float(np.sqrt(max(float((mean[keep] ** 2).mean()) - noise, 0.0)))

"""Regions of a mesh that lie on analytic surfaces: grown from patches, trimmed, and joined."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import _fit_kernels as fit
from turnscan.shapes.primitives import _growth_kernels as growth
from turnscan.shapes.primitives import _region_kernels as region
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._ground import TURN, Ground, Index
from turnscan.shapes.primitives._judged import (
    HOPELESS,
    LEAST,
    PATTERN,
    continues,
    enough,
    fair,
    pattern,
    together_on,
)
from turnscan.shapes.primitives._region import FIT, SIMPLEST, STEPS, Region, refit, side_of
from turnscan.shapes.primitives._start import first_guesses
from turnscan.shapes.primitives._surface_kernels import CONE, FREE, PLANE
from turnscan.shapes.primitives._trimmed import trimmed

_GENTLE = float(np.cos(np.radians(20.0)))
"""Between smooth normals of neighbours within the patch of a seed."""
_PATCH, _LARGE, _SMALL = 80, 320, 32
"""Vertices of the patch that a region starts from; then of a larger one where that gives nothing,
of a smaller one where no surface fits it: it reaches over the edges of a narrow face."""
_NARROW = (PLANE, CONE)
"""What narrow faces are: shoulders and chamfers; a strip of a cone lies on a cylinder, too."""
_CLEAR = 0.05
"""A plane whose pattern stays below this is not compared with curved surfaces."""
_ROUNDS, _GROWTH = 24, 4
"""Of growth, each at most so many times as large as the one before: what turns out to be freeform
has not been looked at far and wide by then."""
_SETTLING = 3
"""Rounds of growth at the end, with fits to more points."""
_GROWING = 400
"""Points that a fit looks at while a region grows."""
_MISFIT = 2.0
"""Mean square, in standard deviations, that a patch may miss its first surface by."""
_ALMOST = 0.93
"""Share of the largest area that a simpler kind must reach."""
_GUESS = 1000
"""Points that a simpler kind is guessed from."""


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
        some = surface.some_of(member, FIT)
        q, cost = fit.fitted(
            kind, guess, g.vertices, g.scale, some, FREE[kind], 6.0, 4 * g.size, 2 * STEPS,
            fit.ROUGH,
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
        for kind, guess in sorted(guesses, key=lambda o: SIMPLEST.index(o[0])):
            if SIMPLEST.index(kind) >= best.rank():
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
        side = side_of(g, kind, q, ball)
        for _ in range(_SETTLING):
            self.mark += 1
            on = region.Surface(kind, q, side)
            most = len(g.vertices)
            member = region.grown(on, self.near, self._marks(), member, TURN, most)
            q, cost = refit(g, kind, q, member) if len(member) else (q, np.inf)
            if not np.isfinite(cost):
                return None
        if not enough(g, kind, q, member, self.least):
            return None
        if not fair(g, kind, q, member):
            return trimmed(g, kind, q, member, self.least, self.place)
        return Region(kind, q, side_of(g, kind, q, member), member)

    def _spread(self, kind: int, q: Floats, ball: Index) -> tuple[Floats, Index]:
        """The surface and the vertices that a patch grows to; none where that is hopeless."""
        g = self.ground
        on = region.Surface(kind, q, side_of(g, kind, q, ball))
        how = growth.Growth(
            g.scale, g.off, 4 * g.size, _GROWING, STEPS, _ROUNDS, _GROWTH,
            HOPELESS[together_on(g, kind) > 1.0],
        )  # fmt: skip
        self.mark += 1
        q, member, reached = growth.spread_out(on, self.near, self._marks(), ball, TURN, how)
        self.mark += _ROUNDS
        if reached >= 0:
            self.reached = min(self.reached, reached)
        return q, member


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


def continued(g: Ground, regions: list[Region], least: float) -> list[Region]:
    """Regions with further pieces of at least ``least`` mm² that lie on their surfaces.

    The far side of a bore, seen badly, is no shape by itself, but the near side says what it is.
    """
    label = np.full(len(g.vertices), -1, dtype=np.int64)
    for k, r in enumerate(regions):
        label[r.member] = k
    out = list[Region]()
    for k, r in enumerate(regions):
        for piece in _pieces_on(g, r, label):
            if len(piece) < LEAST[r.kind] // 2 or float(g.area[piece].sum()) < least:
                continue
            both = _joined(g, r, Region(r.kind, r.q, r.side, piece))
            if both is not None and continues(g, r.kind, both.q, piece):
                label[piece] = k
                r = both
        out.append(r)
    return out


def _pieces_on(g: Ground, r: Region, label: Index) -> Iterator[Index]:
    """Connected pieces of free vertices that lie on a region's surface."""
    on = region.Surface(r.kind, r.q, r.side)
    seen, many = np.zeros(len(label), dtype=np.int64), len(label)
    free = np.flatnonzero(label < 0)
    every = region.grown(on, g.neighbourhood, region.Marks(label, seen, 1), free, TURN, many)
    for seed in every:
        if seen[seed] != 2:
            marks = region.Marks(label, seen, 2)
            yield region.grown(on, g.neighbourhood, marks, np.array([seed]), TURN, many)


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
        [surface.some_of(a.member, FIT // 2), surface.some_of(b.member, FIT // 2)]
    )
    q, cost = refit(g, a.kind, a.q, even)
    if not np.isfinite(cost) or side_of(g, a.kind, q, b.member) != b.side:
        return None
    if max(pattern(g, a.kind, q, part.member) for part in (a, b)) > PATTERN:
        return None
    return Region(a.kind, q, a.side, member)

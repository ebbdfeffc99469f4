"""Views placed by what they measured alone, one after the other, round the first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.errors import InputError
from turnscan.poses._fit import AGREE, LEAST, TIGHT, Fit, fit
from turnscan.poses._free_space import Empty, empty
from turnscan.poses._links import link
from turnscan.poses._match import Sampled, placements, sampled
from turnscan.poses._observability import explains, freedoms
from turnscan.poses._refine import (
    all_links,
    approach,
    both_ways,
    equations,
    middles_of,
    refine,
    samples_of,
)
from turnscan.poses._view import View, coarse, thinned
from turnscan.remedy import Option, Remedy
from turnscan.rig import Pose
from turnscan.threads import in_parts

_TRIED = 20
"""Placements of a view in another one that are looked at."""
_FEW, _MANY = 400, 1500
"""Samples of a view that try a placement, and that settle it."""
_FIRST, _TRIAL, _SETTLED = 4, 11, 60
"""Rounds of refinement: until a trial must promise something, after that, and of a place."""
_PROMISE = 0.7
"""Of what a place needs, how much a trial must have after the first rounds: that many of its
samples lie tightly on the other view. Of 114 trials that ended in a good place (ten range scans of
a figure) two had less, and other trials found their places; of the 580 others six in ten."""
_REST = 0.005
"""Sample spacings that a round may still move a trial by, when it is done."""
_FINE = 4.0
"""Usual spacings between points, or …"""
_CLOSE = 0.2
"""… sample spacings: the length of the last links of a trial."""
_THIN = 0.5
"""Spacing of the points that trials are looked for on at first, in lengths of the last links."""
_SAME = 0.5
"""Placements whose points lie fewer sample spacings apart are one."""
_BASIN = 1.0
"""Starts that lie fewer sample spacings from a place that was found lead to it: the first links are
that long."""
_VAGUE = 0.1
"""Noise leaves the direction of an undetermined motion uncertain by this part of it."""
_SURE = 0.7
"""Views with less than this part of the best score wait until more are placed."""
_RIVAL = 0.85
"""A second placement with this much of the first one's score could be meant as well."""


Placed = dict[int, Pose]
"""Views by number, and where they lie."""


@dataclass(frozen=True)
class _Found:
    pose: Pose
    fit: Fit


@dataclass
class Desk:
    """The views, what is derived from them once, and where those lie that have been placed."""

    views: Sequence[View]
    step: float = field(init=False)
    few: list[Ints] = field(init=False)
    many: list[Ints] = field(init=False)
    spaces: list[Empty] = field(init=False)
    pairs: list[Sampled] = field(init=False)
    light: list[View] = field(init=False)
    """The views with no more points than the first rounds of a trial need."""

    def __post_init__(self) -> None:
        self.step = coarse(self.views)
        size = max(v.size for v in self.views)
        self.few = samples_of(self.views, self.step, _FEW)
        self.many = samples_of(self.views, self.step / 2, _MANY)
        n = len(self.views)
        self.spaces = in_parts(lambda k, _: empty(self.views[k], self.step), n, n)
        self.pairs = [sampled(v, self.step, size) for v in self.views]
        self.light = [thinned(v, _THIN * self._last([v])) for v in self.views]

    def trial(self, i: int, placed: Placed, start: Pose) -> _Found:
        """View i, refined from ``start`` against the placed views, and how it fits there."""
        return self._judged(i, placed, self._settled(i, placed, start), self.many)

    def _judged(self, i: int, placed: Placed, pose: Pose, samples: Sequence[Ints]) -> _Found:
        """How view i fits the placed views where it lies."""
        some = sorted(placed)
        views, picked = self._together(i, some, samples)
        spaces = [self.spaces[j] for j in [*some, i]]
        n = len(some)
        poses = [*(placed[j] for j in some), pose]
        return _Found(pose, fit(views, poses, spaces, picked, n, range(n), self.step))

    def refined(
        self, i: int, j: int, start: Pose, rounds: int, begin: float | None = None,
        quick: bool = False,
    ) -> Pose:  # fmt: skip
        """Where view i comes to lie on view j, in its frame, from ``start``, in so many rounds.

        Its few samples alone are looked for on the other: that comes near. Their links are
        ``begin`` mm long at first, a sample spacing without. ``quick``: on no more points of the
        other than that needs; by edges of a part they can lead astray.
        """
        other = (self.light if quick else self.views)[j]
        last = self._last([other, self.views[i]])
        still = _REST * self.step
        return approach(
            self.views[i], other, start, self.few[i], (begin or self.step, last), rounds, still
        )

    def _last(self, views: Sequence[View]) -> float:
        """mm: length of the last links of a trial."""
        return max(_FINE * max(v.spacing for v in views), _CLOSE * self.step)

    def _settled(self, i: int, placed: Placed, start: Pose) -> Pose:
        """Where view i comes to lie on the placed views in the end, and they on it."""
        some = sorted(placed)
        views, samples = self._together(i, some, self.many)
        n = len(some)
        poses = [*(placed[j] for j in some), start]
        reach = self.step, self._last(views)
        return refine(views, poses, both_ways(samples, n), reach, fixed=n, rounds=_SETTLED)[n]

    def _promising(self, i: int, j: int, pose: Pose) -> bool:
        """True where enough of view i lies tightly on view j for the place to be a good one yet."""
        views, some = [self.views[j], self.views[i]], self.few[i]
        links, _ = link(views, [Pose(), pose], 1, 0, some, self.step)
        tight = float((np.abs(links.offsets) < TIGHT * self.step).sum()) / len(some)
        return tight >= _PROMISE * LEAST * AGREE

    def _together(
        self, i: int, some: list[int], samples: Sequence[Ints]
    ) -> tuple[list[View], list[Ints]]:
        """The placed views and view i behind them, with their samples."""
        numbers = [*some, i]
        return [self.views[j] for j in numbers], [samples[j] for j in numbers]

    def candidates(self, i: int, j: int) -> list[Pose]:
        """Where view i fits view j, in the frame of view j; each place once."""
        points, limit = self.views[i].points[self.few[i]], _SAME * self.step
        out: list[Pose] = []
        for start, _ in placements(self.pairs[j], self.pairs[i], _TRIED):
            if any(_apart(start, o, points) < _BASIN * self.step for o in out):
                continue
            near = self.refined(i, j, start, _FIRST, quick=True)
            if not self._promising(i, j, near):
                continue
            last = self._last([self.views[j], self.views[i]])
            pose = self.refined(i, j, near, _TRIAL, last)
            found = self._judged(i, {j: Pose()}, pose, self.few)
            if found.fit.good and all(_apart(found.pose, o, points) > limit for o in out):
                out.append(found.pose)
        return out

    def all_candidates(self, pairs: Sequence[tuple[int, int]]) -> list[list[Pose]]:
        """The `candidates` of so many pairs of views, in their order."""
        return in_parts(lambda k, _: self.candidates(*pairs[k]), len(pairs), len(pairs))

    def same(self, i: int, placed: Placed, a: Pose, b: Pose) -> bool:
        """True where two placements of view i differ by no more than what is undetermined."""
        some = sorted(placed)
        views = [*(self.views[j] for j in some), self.views[i]]
        poses = [*(placed[j] for j in some), a]
        points, limit = views[-1].points[self.few[i]], _SAME * self.step
        plain = _apart(a, b, points)
        if plain < limit:
            return True
        middles = middles_of(views, poses)
        n = len(some)
        asked = both_ways([self.many[j] for j in [*some, i]], n)
        links = all_links(views, poses, asked, self.step / 2)
        found = freedoms(equations(links, middles), middles, n)
        apart = explains(found, n, a, b, points)
        return bool(np.sqrt((apart**2).mean()) < limit + _VAGUE * plain)


def place(views: Sequence[View], tick: Callable[[], None] = lambda: None) -> list[Pose]:
    """Where each view belongs in the frame of the first one, from their surfaces alone.

    Views are placed one by one where pairs of oriented points vote for it (`placements`), where
    what lies on the views placed before agrees as well as noise allows, and where no view stands
    in space that another one saw to be empty. A view that fits in several ways waits for others
    to be placed; places that differ by a motion that the surface does not determine (a cup turned
    about its axis) count as one. ``tick`` is called for each view placed.

    Raises InputError naming views that fit nowhere, or in several ways.
    """
    desk = Desk(views)
    placed: Placed = {0: Pose()}
    tried: dict[tuple[int, int], list[Pose]] = {}
    tick()
    while len(placed) < len(views):
        clear: dict[int, _Found] = {}
        unclear: list[int] = []
        left = [k for k in range(len(views)) if k not in placed]
        pairs = [(i, j) for i in left for j in placed if (i, j) not in tried]
        tried.update(zip(pairs, desk.all_candidates(pairs), strict=True))
        for i in left:
            starts = [placed[j] @ p for j in placed for p in tried[i, j]]
            found = _distinct(desk, i, placed, starts)
            if len(found) == 1:
                clear[i] = found[0]
            elif found:
                unclear.append(i)
        if not clear:
            raise _nowhere(views, placed, unclear)
        surest = max(f.fit.score for f in clear.values())
        for i, one in clear.items():
            if one.fit.score >= _SURE * surest:
                placed[i] = one.pose
                tick()
    return [placed[i] for i in range(len(views))]


def ways(first: View, second: View) -> list[Pose]:
    """The ways in which one view fits another one, in the frame of the first, the best first.

    Several of a part that is alike from several sides; none where the second one fits nowhere.
    """
    desk = Desk((first, second))
    return [found.pose for found in _distinct(desk, 1, {0: Pose()}, desk.candidates(1, 0))]


def _distinct(desk: Desk, i: int, placed: Placed, starts: Sequence[Pose]) -> list[_Found]:
    """The good placements of view i that differ, the best first."""
    good: list[_Found] = []
    points, limit = desk.views[i].points[desk.few[i]], _SAME * desk.step
    for start in starts:
        if all(_apart(start, o.pose, points) > limit for o in good):
            found = desk.trial(i, placed, start)
            if found.fit.good:
                good.append(found)
    good.sort(key=lambda f: -f.fit.score)
    out: list[_Found] = []
    for one in good:
        if out and one.fit.score < _RIVAL * out[0].fit.score:
            break
        if not any(desk.same(i, placed, o.pose, one.pose) for o in out):
            out.append(one)
    return out


def _apart(a: Pose, b: Pose, points: Floats) -> float:
    """mm rms between points in two poses."""
    return float(np.sqrt(((a.apply(points) - b.apply(points)) ** 2).sum(axis=1).mean()))


def _nowhere(views: Sequence[View], placed: Placed, unclear: Sequence[int]) -> InputError:
    there = ", ".join(views[j].name for j in sorted(placed))
    if unclear:
        return InputError(
            f"{views[unclear[0]].name}: fits {there} in several ways",
            hint=Remedy(
                "pick at least three point pairs that tell them apart (",
                Option("points"),
                ")",
            ),
        )
    lost = ", ".join(v.name for k, v in enumerate(views) if k not in placed)
    return InputError(
        f"{lost}: no place where its surface agrees with {there}",
        hint=Remedy(
            "scan poses that overlap by a third, pick point pairs (",
            Option("points"),
            "), or leave it out",
        ),
    )

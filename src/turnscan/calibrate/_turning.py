"""Which way, and how far, a table turned between pictures without markers: what the part says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, frozen

_HEIGHTS = 16
_TRIES = 161
_FACTORS = 4.0
"""Steps up to so many times the one given, and down to that part of it, are tried."""
_FEWEST_STEPS, _FEWEST = 12, 100
_GAP = 3.0
"""Usual spacings between points of an outline, over which it is not interpolated."""
_ROUND = 0.02
"""Of the radius: an outline that varies less is round about the axis, and tells nothing."""
_FAR = 0.2
"""Of the outline's variation: outlines farther apart do not agree."""
_RUNG = 0.018
"""Of a step: how far apart those are that are tried."""
_BETTER = 3.0
"""Times: so much farther apart than with the right step."""
_SEAM = 2.0
"""Times the largest difference from step to step: more at the seam, and it is open."""
_ALIKE, _SAME = 1.5, 0.12
"""Times the best: a step that is as good. Of a step: those nearer to each other are one."""


@dataclass(frozen=True)
class Outline:
    """A part as one laser sees it pass: where its stripe stands at some heights."""

    step: Floats
    """(s,) step numbers."""
    radius: Floats
    """(s, h) mm from the axis, NaN where nothing was seen."""
    azimuth: Floats
    """(s, h) rad about the axis, in the table frame at rest."""

    def __post_init__(self) -> None:
        s = len(self.step)
        object.__setattr__(self, "step", frozen(self.step, (s,), "Outline.step"))
        for name in ("radius", "azimuth"):
            values = frozen(getattr(self, name), (s, None), f"Outline.{name}", nan=True)
            object.__setattr__(self, name, values)

    def open_seam(self, step: float, count: int) -> float | None:
        """mm by which the outline of a part fails to close after a whole turn; 0 where it does.

        ``count`` is how many steps of ``step`` rad were made, of which the outline has some. What
        was passed twice must be alike; where the steps make one whole turn, the last of them must
        lead on to the first, by no more than they differ elsewhere. None where they make less than
        a turn, or the part is round about the axis: nothing is said then. A wrong sense closes as
        well.
        """
        o, turned = self, abs(step) * count
        if len(o.step) < _FEWEST_STEPS or np.count_nonzero(np.isfinite(o.radius)) < _FEWEST:
            return None
        seen = np.isfinite(o.radius).sum(axis=0) >= _FEWEST_STEPS
        if not seen.any():
            return None
        usual = float(np.nanmedian(o.radius))
        varies = float(np.median(np.nanstd(o.radius[:, seen], axis=0)))
        if varies < _ROUND * usual:
            return None
        begin = np.abs(step) * (o.step - o.step.min())
        again = begin >= 2 * np.pi
        if np.count_nonzero(again) >= _FEWEST_STEPS:
            one, two = (Outline(o.step[w], o.radius[w], o.azimuth[w]) for w in (~again, again))
            off = _apart(two, one, step)
            return off if off > max(_FAR * varies, _ROUND * usual / 2) else 0.0
        if abs(turned - 2 * np.pi) > abs(step) / 2:
            return None
        jumps = np.abs(np.diff(o.radius, axis=0, append=o.radius[:1]))
        known = np.isfinite(jumps).sum(axis=1) >= max(_HEIGHTS // 4, 1)
        if not known[-1] or np.count_nonzero(known) < _FEWEST_STEPS:
            return None
        each = np.nanmedian(jumps[known], axis=1)
        off, most = float(each[-1]), float(each[:-1].max())
        return off if off > max(_SEAM * most, _ROUND * usual) else 0.0


def outlines_of(
    stripes: Sequence[tuple[Floats, Sequence[Floats]]],
) -> list[Outline]:
    """Outlines of lasers at heights that all of them see.

    ``stripes`` has for each laser its step numbers (s,) and the points (n, 3) mm of each of these
    steps, table frame at rest.
    """
    seen = [p[:, 2] for _, steps in stripes for p in steps if len(p)]
    if not seen:
        return []
    z = np.concatenate(seen)
    low, high = (float(q) for q in np.quantile(z, [0.1, 0.9]))
    heights = np.linspace(low, high, _HEIGHTS)
    reach = float(heights[-1] - heights[0]) / _HEIGHTS
    out = []
    for step, points in stripes:
        place = np.full((len(points), _HEIGHTS, 2), np.nan)
        for k, p in enumerate(points):
            if len(p) < 2:
                continue
            q = p[np.argsort(p[:, 2])]
            near = np.clip(np.searchsorted(q[:, 2], heights), 1, len(q) - 1)
            known = (np.abs(q[near, 2] - heights) < reach) & (
                np.abs(q[near - 1, 2] - heights) < reach
            )
            for c in range(2):
                place[k, :, c] = np.where(known, np.interp(heights, q[:, 2], q[:, c]), np.nan)
        x, y = place[..., 0], place[..., 1]
        out.append(Outline(np.asarray(step, np.float64), np.hypot(x, y), np.arctan2(y, x)))
    return out


def contradicted_step(outlines: Sequence[Outline], step: float) -> tuple[float, ...]:
    """The steps (rad, signed) that two lasers' outlines of a part allow, where ``step`` is none.

    What one laser sees at a place of the part the other one sees there after the part has turned
    from the one sheet to the other. With a wrong step, or sense, the two outlines differ. Empty
    where they agree, or where the part is round about the axis or seen by one laser only, so that
    nothing is said against it; several where the part is alike from several sides.
    """
    if len(outlines) < 2 or min(len(o.step) for o in outlines) < _FEWEST_STEPS:
        return ()
    a, b = outlines[:2]
    radius = np.concatenate([a.radius, b.radius])
    if np.count_nonzero(np.isfinite(radius)) < _FEWEST:
        return ()
    seen = np.isfinite(radius).sum(axis=0) >= _FEWEST_STEPS
    varies = float(np.median(np.nanstd(radius[:, seen], axis=0)))
    usual = float(np.nanmedian(radius))
    given = _apart(a, b, step)
    if varies < _ROUND * usual or not given > max(_FAR * varies, _ROUND * usual / 2):
        return ()
    ladder = np.exp(np.linspace(-np.log(_FACTORS), np.log(_FACTORS), _TRIES))
    tries = np.concatenate([[-step], abs(step) * ladder, -abs(step) * ladder])
    tries = tries[np.abs(tries) < np.pi]
    apart = np.array([_apart(a, b, float(t)) for t in tries])
    apart[~np.isfinite(apart)] = np.inf
    best = float(apart.min())
    if best > _FAR * varies or given < _BETTER * best:
        return ()
    if apart[0] < max(_ALIKE * best, _FAR * varies) and given > _BETTER * apart[0]:
        return (-step,)  # the same step the other way is what goes wrong most
    out: list[float] = []
    for k in np.argsort(apart):
        if apart[k] < _ALIKE * best and all(abs(tries[k] / t - 1) > _SAME for t in out):
            out.append(float(tries[k]))
    return tuple(out) if len(out) > 1 else (_finer(a, b, out[0]),)


def _finer(a: Outline, b: Outline, step: float) -> float:
    tries = step * np.linspace(1 - _RUNG, 1 + _RUNG, 49)
    apart = [_apart(a, b, float(t)) for t in tries]
    return float(tries[int(np.argmin(apart))])


def _apart(a: Outline, b: Outline, step: float) -> float:
    """Median distance of two outlines for steps of this size, mm; NaN where they do not overlap."""
    one, other = _turned(a, step), _turned(b, step)
    some = np.concatenate([_differences(*one, *other), _differences(*other, *one)])
    return float(np.median(some)) if len(some) >= _FEWEST else float("nan")


def _turned(o: Outline, step: float) -> tuple[Floats, Floats]:
    """(h, s) angles about the part, and radii, of an outline at each height, in order; NaN last."""
    angle = np.mod(o.azimuth - step * o.step[:, None], 2 * np.pi).T
    angle = np.where(np.isfinite(o.radius.T), angle, np.nan)
    order = np.argsort(angle, axis=1)
    return np.take_along_axis(angle, order, axis=1), np.take_along_axis(o.radius.T, order, axis=1)


def _differences(at: Floats, radius: Floats, angle: Floats, other: Floats) -> Floats:
    """(m,) mm between radii (h, s) at the angles ``at`` and another outline, of radii ``other`` at
    ``angle``, between whose points they lie. Heights of few points are left out."""
    count = np.isfinite(angle).sum(axis=1)
    rows = np.flatnonzero(count >= _FEWEST_STEPS)
    at, radius, angle, other, count = (v[rows] for v in (at, radius, angle, other, count))
    height, k = np.nonzero(np.isfinite(at))
    at, radius = at[height, k], radius[height, k]
    # One ring a height: its last point stands before the first one as well, and its first behind
    # the last. Three turns lie between two heights, so that one search does for all of them.
    h = np.arange(len(rows))
    ring, values = (np.pad(v, ((0, 0), (1, 1)), constant_values=np.nan) for v in (angle, other))
    for column, source, turn in ((0, count, -2 * np.pi), (count + 1, 1, 2 * np.pi)):
        ring[h, column] = ring[h, source] + turn
        values[h, column] = values[h, source]
    apart = 6 * np.pi * h
    sorted_rings = np.nan_to_num(ring, nan=4 * np.pi) + apart[:, None]
    after = np.searchsorted(sorted_rings.ravel(), at + apart[height])
    ring, values = ring.ravel(), values.ravel()
    near = ring[after] - ring[after - 1] < _GAP * 2 * np.pi / count[height]
    at, after = at[near], after[near]
    low, high = ring[after - 1], ring[after]
    # The chord from point to point: 1/r is a wave of the angle on a straight line.
    across = np.maximum(np.sin(high - low), 1e-9)
    inverse = np.sin(high - at) / values[after - 1] + np.sin(at - low) / values[after]
    return np.asarray(np.abs(radius[near] - across / inverse))

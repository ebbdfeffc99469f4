"""Clean-up of a range grid before it becomes a surface: edges of the light, strays, spikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.findings import Finding
from turnscan.points import RangeGrid, without
from turnscan.remedy import Option, Remedy
from turnscan.stripes import StripeFlag
from turnscan.surface._grid_mesh import behind_of, eyes_of
from turnscan.surface._noise import noise, spacing
from turnscan.surface.clean._despike import despike
from turnscan.threads import in_parts

_BEND = float(np.cos(np.deg2rad(25.0)))
"""Two sides in a row go on alike where they bend by less than this."""
_FADES, _INNER = 6, 6
"""Last points of a run in which its light may fade, and the points before that tell what is usual
…"""
_FAINT, _APART = 0.75, 8.0
"""… of which, and of the profile beside, they keep less than this part, and how far, in sigma, they
lie off the line that the points before make."""
_OFF, _RUN, _NEXT = 4.5, 7, 1
"""Sigma by which a point may lie off the line of its run, the points to either side that make that
line, and those next to it that do not at the end of a run, …"""
_OFF_END = 3.0
"""… fewer at an end itself, where the light may lie on two surfaces; chance takes one of a few
hundred, …"""
_ALIKE, _LINES = 0.5, 2
"""… unless in the profiles beside one lies this part as far off, so many lines away at most."""
_CLOSE, _SPENT = 3, 0.5
"""Lines to either side that tell how much light there is, and the part of it that is little."""
_TOGETHER = 32
"""Profiles that a thread takes at a time."""
_DOUBTED = 3.0
"""Usual sigma beyond which a point by itself at a border is not believed."""


@dataclass(frozen=True)
class Clean:
    """What is removed from the points of a scan before they become a surface."""

    edge: int = 1
    """Points dropped where a run of points ends at a jump in depth, or in one-sided light."""
    support: int = 3
    """A point stays while at least this many of its eight neighbours in the grid lie on one surface
    with it; 0 keeps all."""
    outlier: float | None = None
    """Points further than this many sigma off the surface of their neighbours go; None keeps them.
    Where a surface bends within a few points, as on a coarse scan, it bends by many sigma."""
    piece: float = 0.005
    """A patch of linked points stays when it has at least this share of the largest one's."""
    stretch: float = 3.0
    """Neighbours are on one surface up to this many usual spacings apart; further only where the
    spacing before or after is alike."""
    jump: float = 5.0
    """… or up to this many combined sigma."""
    grazing: float = float(np.deg2rad(80.0))
    """Radians: neighbours seen further from face-on than this lie behind each other, not on one
    surface."""

    def __post_init__(self) -> None:
        if self.edge < 0 or not 0 <= self.support <= 8:
            raise ValueError(f"Clean: edge {self.edge}, support {self.support} (0 to 8)")
        if not (self.stretch > 1 and self.jump >= 0 and 0 < self.grazing <= np.pi / 2):
            raise ValueError(f"Clean: stretch {self.stretch}, jump {self.jump}, {self.grazing} rad")


def clean(grid: RangeGrid, settings: Clean | None = None) -> tuple[RangeGrid, list[Finding]]:
    """The grid without mixed pixels and strays, and a finding for each step that took points.

    Two neighbours in the grid are linked where they can be one surface (see `Clean`). First the
    last points of each run go where the light is one-sided (flag EDGE) or a jump in depth follows:
    there the stripe falls on two surfaces and its centre on neither. So do up to six that fade
    and bend away from the line of the run, where the stripe slides off the surface aslant, and
    points by themselves at a border, of more than three times the usual sigma. Then those that
    `despike` takes, where ``outlier`` is given. Then points with too few linked neighbours go,
    again and again: single strays, and spikes of one line's or one profile's width. What is removed
    is flagged EDGE or AMBIGUOUS. Last go points far off the line of their run, unless the profiles
    beside have them alike and there is light left. A grid of one profile or one line has no
    neighbours to judge by and stays as it is.
    """
    c = settings or Clean()
    s, n = grid.flags.shape
    if s < 2 or n < 2 or not grid.found.any():
        return grid, []
    out, findings = grid, []
    where = f"laser {grid.laser}"
    if c.edge:
        drop = _run_ends(grid, c)
        out = without(out, drop, StripeFlag.EDGE)
        if drop.any():
            text = f"{int(drop.sum())} points at the ends of profile runs are removed"
            findings.append(
                Finding(
                    "surface.edges",
                    "note",
                    text,
                    where,
                    Remedy("keep them with ", Option("edge", 0)),
                )
            )
    if c.outlier is not None:
        out, taken = despike(out, c.outlier)
        findings += taken
    drop = _strays(out, c)
    if drop.any():
        out = without(out, drop, StripeFlag.AMBIGUOUS)
        if c.edge:  # what is beside a gap since then
            out = without(out, _badly_known(out, c), StripeFlag.EDGE)
        text = f"{int(drop.sum())} isolated points are removed"
        findings.append(
            Finding(
                "surface.strays",
                "note",
                text,
                where,
                Remedy("keep them with ", Option("keep_strays")),
            )
        )
    drop = _off_run(out) if c.edge else np.zeros_like(out.found)
    if drop.any():
        out = without(out, drop, StripeFlag.EDGE)
        text = f"{int(drop.sum())} points far off the line of their profile are removed"
        remedy = Remedy("keep them with ", Option("edge", 0))
        findings.append(Finding("surface.spikes", "note", text, where, remedy))
    return out, findings


def _strays(grid: RangeGrid, c: Clean) -> Bools:
    from turnscan.surface.clean import _clean_kernels as kernels

    to_step, to_line = _links(grid, c)
    found, closed = grid.found, grid.closed and len(grid.steps) >= 3
    left = kernels.core(found, to_step, to_line, closed, c.support)
    size = kernels.piece_sizes(left, to_step, to_line, closed)
    return np.asarray(found & (size < c.piece * max(1, int(size.max()))))


def _run_ends(grid: RangeGrid, c: Clean) -> Bools:
    """(s, n) True for the last points of each run, where the light is cut or a jump follows."""
    found = grid.found
    one_sided = (grid.flags & StripeFlag.EDGE) != 0
    jumps = np.zeros_like(found)
    jumps[:, :-1] = _behind_each_other(grid, c)
    drop = np.zeros_like(found)
    for towards in (1, -1):
        jump = jumps if towards == 1 else _shifted(jumps, 1)
        ends = found & (jump | (one_sided & ~_shifted(found, -towards)))
        for _ in range(c.edge):
            drop |= ends
            ends = _shifted(ends, -towards) & found
    return np.asarray(drop | _badly_known(grid, c) | _fading(grid))


def _badly_known(grid: RangeGrid, c: Clean) -> Bools:
    """(s, n) True for points beside a gap between profiles whose light is one-sided, or which are
    by themselves in their profile, of a large sigma: the rest of a stripe on two surfaces."""
    found, known = grid.found, grid.sigma[grid.found]
    usual = float(np.nanmedian(known)) if np.isfinite(known).any() else np.inf
    alone = found & ~_shifted(found, 1) & ~_shifted(found, -1)
    with np.errstate(invalid="ignore"):
        alone &= grid.sigma > _DOUBTED * usual
    one_sided = (grid.flags & StripeFlag.EDGE) != 0
    return np.asarray((alone | one_sided) & _beside_gaps(grid, c))


def _fading(grid: RangeGrid) -> Bools:
    """(s, n) True for the last points of runs whose light fades and leaves the surface.

    Where a round part is lit and seen more and more flatly the profiles beside fade alike.
    """
    from turnscan.surface.clean import _clean_kernels as kernels

    light = np.where(grid.found, grid.amplitude, 0.0)
    beside = np.maximum(np.roll(light, 1, axis=0), np.roll(light, -1, axis=0))
    if not grid.closed:
        beside[0], beside[-1] = light[1], light[-2]
    fades: Bools = kernels.fading(
        grid.points, noise(grid), light, beside, _FADES, _INNER, _FAINT, _APART
    )
    return fades


def _off_run(grid: RangeGrid) -> Bools:
    """(s, n) True for points far off the line of their run that the profiles beside do not have,
    and for the last of a run whose light is one-sided and spent, whatever those have. What a person
    set stays.

    Where the stripe's last light falls on two surfaces, or something glows through, one or two
    centres jump; an edge or a groove goes on in the next profile.
    """
    from turnscan.surface.clean import _clean_kernels as kernels

    points, sigma = grid.points.copy(), noise(grid)
    off, ratio, rows = np.zeros_like(points), np.zeros_like(sigma), np.arange(len(points))
    drop, spent, claims = np.zeros_like(grid.found), _spent(grid), np.nan_to_num(grid.sigma)
    for _ in range(2):  # what was next to the last of a run is the last one then

        def part(first: int, end: int, rows: Longs = rows) -> None:
            kernels.off_runs(points, sigma, claims, _RUN, _NEXT, rows[first:end], off, ratio)

        in_parts(part, len(rows), -(-len(rows) // _TOGETHER))
        there = ~np.isnan(points[..., 0])
        inside = _shifted(there, 1) & _shifted(there, -1)
        far = ratio > np.where(inside, _OFF, _OFF_END)
        step, line = np.nonzero(far & ((grid.flags & StripeFlag.HAND) == 0))
        alone = ~_alike(off, step, line, grid.closed) | (spent & ~inside)[step, line]
        step, line = step[alone], line[alone]
        drop[step, line], points[step, line] = True, np.nan
        rows = np.unique(step)
    return drop


def _spent(grid: RangeGrid) -> Bools:
    """(s, n) True for points in one-sided light of less than half of that close by on the profile:
    its last on two surfaces."""
    light = np.where(grid.found, grid.amplitude, 0.0)
    close = np.zeros_like(light)
    for lines in range(1, _CLOSE + 1):
        np.fmax(close[:, lines:], light[:, :-lines], out=close[:, lines:])
        np.fmax(close[:, :-lines], light[:, lines:], out=close[:, :-lines])
    one_sided = (grid.flags & StripeFlag.EDGE) != 0
    return np.asarray(one_sided & (light < _SPENT * close))


def _alike(off: Floats, step: Longs, line: Longs, closed: bool) -> Bools:
    """(m,) True for points which a profile beside follows, ``off`` (s, n, 3) as far as they."""
    s, n, _ = off.shape
    own = off[step, line]
    far, alike = np.einsum("mi,mi->m", own, own), np.zeros(len(step), dtype=np.bool_)
    for other in (step - 1, step + 1):
        for at in (line + k for k in range(-_LINES, _LINES + 1)):
            there = (at >= 0) & (at < n) & (closed | ((other >= 0) & (other < s)))
            beside = off[other % s, at % n]
            alike |= there & (np.einsum("mi,mi->m", beside, own) > _ALIKE * far)
    return alike


def _beside_gaps(grid: RangeGrid, c: Clean) -> Bools:
    """(s, n) True where the profile before or after has no point on one surface with this one."""
    found, side = grid.found, spacing(grid)[0]
    closed = grid.closed and len(grid.steps) >= 3
    far = np.linalg.norm(np.diff(grid.points, axis=0, append=grid.points[:1]), axis=2)
    with np.errstate(invalid="ignore"):
        after = ~(far <= c.stretch * side)
    after[-1] &= closed
    before = np.roll(after, 1, axis=0)
    before[0] &= closed
    return np.asarray(found & (after | before))


def _behind_each_other(grid: RangeGrid, c: Clean) -> Bools:
    """(s, n−1) True where two points in a row lie one behind the other along the camera's ray."""
    if grid.eyes is None:
        return np.zeros((len(grid.steps), grid.flags.shape[1] - 1), dtype=np.bool_)
    side = np.diff(grid.points, axis=1)
    ray = grid.points[:, :-1] - grid.eyes[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = np.abs(np.einsum("sni,sni->sn", side, ray)) / np.linalg.norm(ray, axis=2)
        sigma = noise(grid)
        limit = c.jump * np.hypot(sigma[:, 1:], sigma[:, :-1])
        return np.asarray(
            (depth > np.sin(c.grazing) * np.linalg.norm(side, axis=2)) & (depth > limit)
        )


def _shifted(values: Bools, lines: int) -> Bools:
    """The array moved by one line up (1) or down (−1), False coming in."""
    out = np.zeros_like(values)
    if lines > 0:
        out[:, 1:] = values[:, :-1]
    else:
        out[:, :-1] = values[:, 1:]
    return out


def _links(grid: RangeGrid, c: Clean) -> tuple[Bools, Bools]:
    from turnscan.surface.clean import _clean_kernels as kernels

    s = len(grid.flags)
    side, eyes = behind_of(grid), eyes_of(grid)
    sigma = noise(grid)
    usual = spacing(grid)
    closed = grid.closed and s >= 3
    limits = kernels.Limits(c.stretch, c.jump, float(np.cos(np.pi / 2 - c.grazing)), _BEND)

    def linked(way: int, _: int) -> Bools:
        steps = way == 0
        return kernels.links(grid.points, side, eyes, sigma, usual[way], steps, closed, limits)

    both = in_parts(linked, 2, 2)
    return both[0], both[1]

"""Kernels of stripes in the kept runs of a picture (`_runs`): the same search, there alone.

The kernels of whole pictures read pixels by line and column; they do so here too, on a work surface
that holds the runs of one frame. Around them it holds what the last frames left, so the ground that
a frame stands for is laid before it is looked at: next to each run for the search, and under each
candidate's window for its measurement.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Flags, Floats, Image, Longs, Region
from turnscan.compiled import njit
from turnscan.stripes._kernels import list_peaks, measure_candidates
from turnscan.stripes._list import ROW, START
from turnscan.stripes._scan import (
    PEAK_COLUMNS,
    PEAKS,
    PLATEAU,
    Row,
    Terms,
    difference,
    keep_run,
    limits_of,
)

BESIDE = PLATEAU + 1
"""px of ground on either side of a run: the search ends on the first, a plateau before the last."""


class Surface(NamedTuple):
    """The work surface; what is not there has no rows."""

    lit: Image
    dark: Image
    behind: Image
    """The background that all frames share."""
    mask: Bools
    """True where light counts."""
    ground: tuple[int, int]
    """Levels of lit and dark where nothing is kept."""


class Order(NamedTuple):
    """The runs of a frame, line after line."""

    ends: Longs
    """(H,) the end of each line's runs among the following."""
    starts: Longs
    """First pixel of each."""
    lengths: Longs
    """px."""


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def lay_ground(surface: Surface, order: Order, v: int, first: int, stop: int) -> None:
    """Lay the ground on the pixels first … stop-1 of a line, but not on its runs."""
    lit, dark, behind, mask, ground = surface
    ends, starts, lengths = order
    top = int(np.iinfo(lit.dtype).max)
    i = ends[v - 1] if v > 0 else 0
    x = max(first, 0)
    stop = min(stop, lit.shape[1])
    while x < stop:
        while i < ends[v] and starts[i] + lengths[i] <= x:
            i += 1
        end = stop
        if i < ends[v]:
            if starts[i] <= x:
                x = starts[i] + lengths[i]
                continue
            end = min(end, starts[i])
        for u in range(x, end):
            off = ground[1]
            if behind.shape[0] > 0:
                off = int(behind[v, u])
            elif dark.shape[0] > 0:
                dark[v, u] = off
            here = ground[0]
            if behind.shape[0] > 0:
                here = min(max(off + here, 0), top)
            lit[v, u] = here if mask.shape[0] == 0 or mask[v, u] else off
        x = end


@njit(cache=True, nogil=True, error_model="numpy")
def lay_runs(surface: Surface, order: Order, values: Image, off: Image, terms: Terms) -> bool:
    """Lay the runs of a frame and what stands beside them; light outside the mask is put out.

    ``values`` are the pixels of the runs, ``off`` theirs with the laser off. Returns False where
    runs are not in order, or where the ground is no ground: above the level at which the search
    ends.
    """
    lit, dark, behind, mask, ground = surface
    ends, starts, lengths = order
    masked = mask.shape[0] > 0
    added = ground[0] if behind.shape[0] > 0 else ground[0] - ground[1]
    _, low = limits_of(lit, terms)
    if max(0, added) > low:
        return False
    n = 0
    i = 0
    for v in range(ends.size):
        last = 0
        for k in range(i, ends[v]):
            start, stop = starts[k], starts[k] + lengths[k]
            if start < last:
                return False
            last = stop
            lay_ground(surface, order, v, start - BESIDE, start)
            lay_ground(surface, order, v, stop, stop + BESIDE)
            end = n + stop - start
            if dark.shape[0] > 0:
                dark[v, start:stop] = off[n:end]
            lit[v, start:stop] = values[n:end]
            n = end
            if not masked:
                continue
            for x in range(start, stop):
                if not mask[v, x]:
                    lit[v, x] = ground[1]
                    if behind.shape[0] > 0:
                        lit[v, x] = behind[v, x]
                    elif dark.shape[0] > 0:
                        lit[v, x] = dark[v, x]
        i = ends[v]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def first_pass_of_runs(
    lit: Image, dark: Image, order: Order, roi: Region, terms: Terms, peaks: Floats, counts: Longs
) -> None:
    """What `first_pass` finds in the whole picture."""
    u0, v0, u1, v1 = roi
    ends, starts, lengths = order
    paired = dark.shape[0] > 1
    limit, low = limits_of(lit, terms)
    run = np.empty(u1, np.int32)
    line = 0
    for v in range(v0, v1):
        w = v if paired else 0
        row = Row(v, w, u1, low)
        count = 0
        done = u0
        for i in range(ends[v - 1] if v > 0 else 0, ends[v]):
            x = max(starts[i], done)
            stop = min(starts[i] + lengths[i], u1)
            while x < stop:
                if difference(lit, dark, v, w, x) <= limit:
                    x += 1
                    continue
                x, count = keep_run(lit, dark, row, x, done, run, peaks, line, count, terms)
                done = x
        counts[v - v0] = count
        line += count


@njit(cache=True, nogil=True, error_model="numpy")
def find_in_runs(
    surface: Surface,
    lit: Image,
    dark: Image,
    order: Order,
    roi: Region,
    terms: Terms,
    table: Floats,
    bits: Flags,
) -> None:
    """What `detect_lines` finds in the whole picture; ``lit`` is the read-only surface."""
    _, v0, _, v1 = roi
    peaks = np.empty(((v1 - v0) * PEAKS, PEAK_COLUMNS))
    counts = np.zeros(v1 - v0, np.int64)
    first_pass_of_runs(lit, dark, order, roi, terms, peaks, counts)
    listed = list_peaks(lit, roi, terms, peaks, counts, table.shape[2])
    some, stops = listed.some, listed.stops
    for i in range(listed.size):
        v, left = int(some[i, ROW]), int(some[i, START])
        last = stops[i] - (stops[i - 1] if i else 0) - 2
        # A window may reach beyond the pixels that measure it by half of their number.
        beyond = last // 2 + 3
        lay_ground(surface, order, v, left - beyond, left + last + 1 + beyond)
    measure_candidates(lit, dark, roi, terms, listed, table, bits)

"""Which candidate of a line is the stripe: kernels of the choice, and the flags that follow."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Flags, Floats, Ints
from turnscan.compiled import njit
from turnscan.stripes._levels import typical

DARK, OUTSIDE, AMBIGUOUS, SATURATED, HALO, EDGE, MULTI, GRAZING = 1, 2, 4, 8, 16, 32, 64, 128
BRIGHTEST, FIRST, LAST, NEAREST = range(4)

GLOW_WIDTH, GLOW_AMPLITUDE = 3.0, 0.35
"""A candidate this much wider and weaker than the usual one is glow without a stripe in it."""
GRAZING_WIDTH = 2.5
"""A stripe this much wider than usual is lit or seen at a grazing angle."""
NONE_COST, GAP_COST = 4.0, 1.5
"""Path: cost of a line without stripe, and of going from or to one."""
JUMP_LIMIT = 6.0
"""Path: a jump costs its length in usual widths, at most this: surfaces do have edges."""
WEAK_COST, WIDTH_COST = 0.5, 0.5
"""Path: cost per e-fold below the usual amplitude, and away from the usual width."""
MARGIN = 2.0
"""Path: a second candidate whose path costs less than this more is ambiguous."""
GLOW_REACH = 4.0
"""Own widths from a brighter centre within which a haloed one is that one's glow."""
EDGE_JUMP = 4.0
"""A stripe that jumps by more than this many widths to the next line ends there."""
LAGS = (1, 2, 4)
"""Lines between the centres whose difference shows their scatter."""
THIRD = (1.0, -3.0, 3.0, -1.0)
MEDIAN_SQUARE = 0.4549
"""Median of the square of a standard normal variable."""
ENOUGH_LINES = 20
SURELY_MORE = 5.0
"""Twice the uncertainty of a variance from the median of n squares, as a part, times √n."""


@njit(cache=True, nogil=True, error_model="numpy")
def usual(table: Floats) -> tuple[float, float]:
    """Median amplitude and width of the brightest candidates of the lines."""
    _, lines, k = table.shape
    amplitudes = np.empty(lines)
    widths = np.empty(lines)
    n = 0
    for v in range(lines):
        if np.isnan(table[0, v, 0]):
            continue
        best = 0
        for j in range(1, k):
            if table[2, v, j] > table[2, v, best]:
                best = j
        amplitudes[n] = table[2, v, best]
        widths[n] = table[3, v, best]
        n += 1
    return typical(amplitudes, n), typical(widths, n)


@njit(cache=True, nogil=True, error_model="numpy")
def drop_glow(table: Floats, bits: Flags) -> None:
    """Forget the candidates that are light spread around the stripe; mark the grazing ones."""
    amplitude, width = usual(table)
    _, lines, k = table.shape
    for v in range(lines):
        kept = 0
        for j in range(k):
            if np.isnan(table[0, v, j]):
                break
            wide = table[3, v, j] > GLOW_WIDTH * width
            if wide and table[2, v, j] < GLOW_AMPLITUDE * amplitude:
                continue
            if kept < j:
                for i in range(table.shape[0]):
                    table[i, v, kept] = table[i, v, j]
                bits[v, kept] = bits[v, j]
            if table[3, v, j] > GRAZING_WIDTH * width:
                bits[v, kept] |= GRAZING
            kept += 1
        for j in range(kept, k):
            for i in range(table.shape[0]):
                table[i, v, j] = np.nan
            bits[v, j] = 0
        if kept > 1:
            for j in range(kept):
                bits[v, j] |= MULTI


@njit(cache=True, nogil=True, error_model="numpy")
def brighter(table: Floats, bits: Flags, v: int, j: int, best: int) -> bool:
    """Amplitude decides, and the width where both are clipped at the same level."""
    if bits[v, j] & bits[v, best] & SATURATED:
        return table[2, v, j] * table[3, v, j] > table[2, v, best] * table[3, v, best]
    return table[2, v, j] > table[2, v, best]


@njit(cache=True, nogil=True, error_model="numpy")
def simple_choice(table: Floats, bits: Flags, how: int, chosen: Ints) -> None:
    """The brightest, the first or the last candidate of each line; -1 where there is none."""
    _, lines, k = table.shape
    for v in range(lines):
        best = -1
        for j in range(k):
            if np.isnan(table[0, v, j]):
                break
            if best < 0 or how == LAST or (how == BRIGHTEST and brighter(table, bits, v, j, best)):
                best = j
        chosen[v] = best


@njit(cache=True, nogil=True, error_model="numpy")
def sweep(
    own: Floats, table: Floats, width: float, costs: Floats, back: Ints, reverse: bool
) -> None:
    """Cheapest path from one end to each state; state K is 'no stripe here'."""
    lines, states = own.shape
    k = states - 1
    for step in range(lines):
        v = lines - 1 - step if reverse else step
        w = v + 1 if reverse else v - 1
        for j in range(states):
            best = 0.0
            source = -1
            if step > 0:
                best = np.inf
                for i in range(states):
                    if i < k and j < k:
                        jump = abs(table[0, v, j] - table[0, w, i]) / width
                        move = min(jump, JUMP_LIMIT)
                    else:
                        move = 0.0 if i == j else GAP_COST
                    if costs[w, i] + move < best:
                        best = costs[w, i] + move
                        source = i
            costs[v, j] = best + own[v, j]
            back[v, j] = source


@njit(cache=True, nogil=True, error_model="numpy")
def path_choice(table: Floats, bits: Flags, chosen: Ints) -> None:
    """The cheapest path through all lines (Viterbi), and where it is nearly a tie.

    A path prefers candidates near their neighbours, not weaker than usual and of the usual width;
    being brighter than usual earns nothing, so that a bright reflection cannot pull it away.
    """
    _, lines, k = table.shape
    amplitude, width = usual(table)
    width = max(width, 0.5)
    own = np.full((lines, k + 1), np.inf)
    for v in range(lines):
        own[v, k] = NONE_COST
        for j in range(k):
            if np.isnan(table[0, v, j]):
                break
            weak = max(0.0, np.log(amplitude / max(table[2, v, j], 1e-3)))
            odd = abs(np.log(max(table[3, v, j], 1e-3) / width))
            own[v, j] = WEAK_COST * weak + WIDTH_COST * odd
        if np.isnan(table[0, v, 0]):
            own[v, k] = 0.0
    ahead = np.empty((lines, k + 1))
    behind = np.empty((lines, k + 1))
    back = np.empty((lines, k + 1), np.int32)
    sweep(own, table, width, behind, back, True)
    sweep(own, table, width, ahead, back, False)
    state = int(np.argmin(ahead[lines - 1]))
    for v in range(lines - 1, -1, -1):
        chosen[v] = state if state < k else -1
        if state < k:
            through = ahead[v, state] + behind[v, state] - own[v, state]
            for j in range(k):
                other = ahead[v, j] + behind[v, j] - own[v, j]
                if j != state and own[v, j] < np.inf and other - through < MARGIN:
                    bits[v, state] |= AMBIGUOUS
        state = back[v, state]


@njit(cache=True, nogil=True, error_model="numpy")
def glow_of(table: Floats, bits: Flags, beyond: Floats, v: int, j: int) -> bool:
    """Whether a candidate is haloed and near a brighter one ``beyond`` the region that counts.

    Where a stripe leaves the region, as at the foot of a part for the platter, the light it spreads
    shines on in the region, and would be the brightest there is.
    """
    if bits[v, j] & HALO:
        for i in range(beyond.shape[1]):
            near = abs(table[0, v, j] - beyond[v, i]) <= GLOW_REACH * table[3, v, j]
            if near and table[2, v, i] > table[2, v, j]:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def restrict_lines(table: Floats, bits: Flags, inside: Bools, beyond: Floats) -> None:
    """Keep the candidates at pixels where ``inside`` (lines, columns) is True.

    Lines that lose all are OUTSIDE; the places of those that are not inside go to ``beyond``
    (lines, K), NaN where there are none, and their glow goes with them.
    """
    _, lines, k = table.shape
    last = inside.shape[1] - 1
    lost = np.empty(k, np.bool_)
    for v in range(lines):
        others = False
        for j in range(k):
            beyond[v, j] = np.nan
            at = table[0, v, j]
            if not np.isnan(at) and not inside[v, int(min(max(np.rint(at), 0.0), last))]:
                beyond[v, j] = at
                others = True
        if not others:
            continue
        for j in range(k):
            lost[j] = (
                np.isnan(table[0, v, j])
                or not np.isnan(beyond[v, j])
                or glow_of(table, bits, beyond, v, j)
            )
        kept = 0
        for j in range(k):
            if not lost[j]:
                for i in range(table.shape[0]):
                    table[i, v, kept] = table[i, v, j]
                bits[v, kept] = bits[v, j]
                kept += 1
        for j in range(kept, k):
            table[:, v, j] = np.nan
            bits[v, j] = 0
        if kept == 0:
            bits[v, 0] = OUTSIDE


@njit(cache=True, nogil=True, error_model="numpy")
def gather(
    table: Floats, bits: Flags, chosen: Ints, beyond: Floats, out: Floats, flags: Flags
) -> None:
    """Copy the chosen candidates into ``out`` (6, lines), and flag where the stripe ends.

    It goes on where a centre of the next line is near, be it one ``beyond`` the region that counts.
    """
    lines = chosen.size
    for v in range(lines):
        j = chosen[v]
        if j >= 0:
            for i in range(table.shape[0]):
                out[i, v] = table[i, v, j]
            flags[v] = bits[v, j]
        else:
            for i in range(table.shape[0]):
                out[i, v] = np.nan
            left_out = not np.isnan(table[0, v, 0])
            flags[v] = (bits[v, 0] & OUTSIDE) or (DARK | (AMBIGUOUS if left_out else 0))
    for v in range(lines):
        if chosen[v] < 0:
            continue
        for w in (v - 1, v + 1):
            if 0 <= w < lines:
                reach = EDGE_JUMP * max(out[3, v], 1.0)
                goes_on = abs(out[0, w] - out[0, v]) <= reach
                for j in range(beyond.shape[1]):
                    goes_on |= abs(beyond[w, j] - out[0, v]) <= reach
                if not goes_on:
                    flags[v] |= EDGE


@njit(cache=True, nogil=True, error_model="numpy")
def scatter(out: Floats, flags: Flags) -> float:
    """Variance of the centres, per px of width, that their sigmas leave unexplained; px²/px.

    Speckle's variance is proportional to the width. The scatter comes from third differences
    along the stripe, in which smooth shape cancels. They are taken at several spacings, because
    adjacent lines may share an error: a grain taller than a pixel, interpolated colours, JPEG. A
    wider one counts where it shows more by twice its own uncertainty: the largest of several that
    chance alone parts would be too large. Lines with other flags than MULTI and HALO (light beside
    a stripe moves its centre smoothly) only count where the rest is too few. NaN where all are.
    """
    best = 0.0
    surely = 1.0 + SURELY_MORE / math.sqrt(max(np.sum(~np.isnan(out[0])), 1))
    for clean in (True, False):
        enough = False
        for lag in LAGS:
            value, count = unexplained(out, flags, lag, clean, surely * best)
            if count >= ENOUGH_LINES:
                if value > surely * best:
                    best = value
                enough = True
        if enough:
            return best
    return math.nan


@njit(cache=True, nogil=True, error_model="numpy")
def scatter_by_lag(out: Floats, flags: Flags, values: Floats, counts: Floats) -> None:
    """What `scatter` looks at: the variance at each of ``LAGS``, and from how many differences."""
    for clean in (True, False):
        enough = False
        for i, lag in enumerate(LAGS):
            values[i], count = unexplained(out, flags, lag, clean, -np.inf)
            counts[i] = count if count >= ENOUGH_LINES else 0.0
            enough = enough or count >= ENOUGH_LINES
        if enough:
            return


@njit(cache=True, nogil=True, error_model="numpy")
def unexplained(
    out: Floats, flags: Flags, lag: int, clean: bool, least: float
) -> tuple[float, int]:
    """The same at one spacing, and the number of differences it comes from.

    The value s is where half of the squared differences lie below the median of a Gaussian's with
    the variance sigma² + s·width: the median of the values that solve it line by line. Where that
    is not above ``least``, it is not sought: ``least`` is returned. A difference across a line that
    does not count is that of two surfaces.
    """
    lines = out.shape[1]
    values = np.empty(lines)
    n = 0
    above = 0
    last = -1
    for end in range(lines):
        if np.isnan(out[0, end]) or (clean and flags[end] & ~np.uint16(MULTI | HALO)):
            last = end
        if last >= end - 3 * lag or end < 3 * lag:
            continue
        difference = explained = width = 0.0
        for k in range(4):
            w = end - k * lag
            factor = THIRD[k]
            difference += factor * out[0, w]
            explained += factor * factor * out[1, w] ** 2
            width += factor * factor * out[3, w]
        values[n] = (difference**2 / MEDIAN_SQUARE - explained) / width
        above += values[n] > least
        n += 1
    return (np.median(values[:n]) if 2 * above > n else least), n


@njit(cache=True, nogil=True, error_model="numpy")
def choose_lines(
    table: Floats,
    bits: Flags,
    how: int,
    with_scatter: bool,
    beyond: Floats,
    out: Floats,
    flags: Flags,
) -> float:
    """From all candidates to ``out`` (6, lines) and ``flags`` (lines): choose, gather, flag.

    ``with_scatter`` raises the sigmas to the scatter of the centres along the stripe; ``beyond``
    (lines, J) are the centres outside the region that counts. The `scatter` is returned: 0
    where it is not asked for, NaN where the lines are too few to tell.
    """
    chosen = np.empty(flags.size, np.int32)
    if how == NEAREST:
        path_choice(table, bits, chosen)
    else:
        simple_choice(table, bits, how, chosen)
    gather(table, bits, chosen, beyond, out, flags)
    if not with_scatter:
        return 0.0
    per_width = scatter(out, flags)
    if per_width > 0.0:
        for v in range(flags.size):
            out[1, v] = math.sqrt(out[1, v] ** 2 + per_width * out[3, v])
    return per_width

"""Kernels of the space-time refinement: the light of one surface element while the sheet passes.

Import inside functions only. Lines and columns are along and across the stripe, whichever way the
camera lies.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats, Longs, Singles
from turnscan.compiled import njit

TERMS = 3
"""Powers of the angle, from the first on."""
TURN = 0.2
"""rad up to which the powers are right."""
HALF, SOFT = 2.5, 0.5
"""Light counts up to ± this many thicknesses from the sheet, fading over the last of them."""
GAP = 1.6
"""Thicknesses that an element may move in a step: with fewer samples of its light, where that
balances depends on where they fall."""
ROUNDS = 16
SETTLED = 2e-3
"""px of imbalance that is none."""
FLAT, STEEP = 0.3, 1.2
"""Imbalance, px, per px that a centre is off: about 1, and more only where brightness jumps, which
makes nothing more certain."""
FIRST_MOVE = 0.05
"""px: a shorter first step would not show the slope."""
LONGEST, FARTHEST = 1.0, 3.0
"""A step, and all of them together, in thicknesses."""
BLUR = 0.3
"""px²: half the variance of a blur by lens and demosaicing, at most."""
VAGUE = 1.0
"""Thicknesses of uncertainty from which light says nothing."""
FULL = 0.92
"""rms distance from the sheet of the light that counts, for a Gaussian sheet, in thicknesses."""
NARROW, USUAL, WIDE = 0.6, 0.15, 1.4
"""That distance over what it must be: outside the outer two this is not one element's light, and
what exceeds the middle one counts as uncertain."""

Seen = tuple[Singles, int, Longs, Floats]
"""Pieces of successive frames, and where they lie: see `refine_lines`."""


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def path_at(paths: Floats, pitch: float, line: float, column: float, out: Floats) -> None:
    """``paths`` (rows, columns, 3, TERMS), known every ``pitch`` px, at one place → ``out``."""
    y = min(max(line / pitch, 0.0), paths.shape[0] - 1.000001)
    x = min(max(column / pitch, 0.0), paths.shape[1] - 1.000001)
    i, j = int(y), int(x)
    fy, fx = y - i, x - j
    for k in range(3):
        for n in range(TERMS):
            low = (1.0 - fx) * paths[i, j, k, n] + fx * paths[i, j + 1, k, n]
            high = (1.0 - fx) * paths[i + 1, j, k, n] + fx * paths[i + 1, j + 1, k, n]
            out[k, n] = (1.0 - fy) * low + fy * high


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def power_sum(terms: Floats, k: int, angle: float) -> float:
    """The polynomial of row ``k`` of ``terms`` (3, TERMS), without its constant."""
    return angle * (terms[k, 0] + angle * (terms[k, 1] + angle * terms[k, 2]))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def light_at(light: Singles, line: float, x: float) -> tuple[float, float]:
    """Light between the pixels, and the sum of the squares of their weights.

    Linear along the stripe, where light is smooth, cubic (Catmull-Rom) across it. No light outside
    of the piece of picture.
    """
    rows, columns = light.shape
    i, j = math.floor(line), math.floor(x)
    if i < 0 or i + 1 >= rows:
        if line < -0.5 or line > rows - 0.5:
            return 0.0, 0.0
        i = min(max(i, 0), rows - 2)
    if j < 1 or j + 2 >= columns:
        return 0.0, 0.25
    fy, f = min(max(line - i, 0.0), 1.0), x - j
    a = f * (-0.5 + f * (1.0 - 0.5 * f))
    b = 1.0 + f * f * (-2.5 + 1.5 * f)
    c = f * (0.5 + f * (2.0 - 1.5 * f))
    d = f * f * (-0.5 + 0.5 * f)
    low = a * light[i, j - 1] + b * light[i, j] + c * light[i, j + 1] + d * light[i, j + 2]
    i += 1
    high = a * light[i, j - 1] + b * light[i, j] + c * light[i, j + 1] + d * light[i, j + 2]
    squares = (a * a + b * b + c * c + d * d) * (fy * fy + (1.0 - fy) * (1.0 - fy))
    return (1.0 - fy) * low + fy * high, squares


@njit(cache=True, nogil=True, error_model="numpy")
def follow(
    seen: Seen, path: Floats, line: int, column: float, thickness: float, samples: Floats
) -> tuple[int, bool]:
    """Follow a surface element through the frames of ``seen``: its samples near the sheet.

    ``path`` (3, TERMS) is the element's. A row of ``samples`` is the distance d from the sheet, mm,
    the share of d that it stands for, light, and the squares of the pixels' weights in it. Returns
    their number, and whether frames that are near enough to each other cover the whole sheet.
    """
    light, top, starts, turns = seen
    m = turns.size
    reach, gap = HALF * thickness, GAP * thickness
    count = 0
    whole = True
    before = power_sum(path, 2, turns[0])
    here = before
    for j in range(m):
        after = power_sum(path, 2, turns[min(j + 1, m - 1)])
        if abs(here) < reach:
            whole &= 0 < j < m - 1 and abs(turns[j]) < TURN
            whole &= max(abs(after - here), abs(here - before)) <= gap
            y = line - top + power_sum(path, 0, turns[j])
            x = column - starts[j] + power_sum(path, 1, turns[j])
            samples[count, 0] = here
            samples[count, 1] = 0.5 * abs(after - before)
            samples[count, 2], samples[count, 3] = light_at(light[j], y, x)
            count += 1
        before = here
        here = after
    return count, whole and count > 0


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def share(d: float, thickness: float) -> float:
    """Weight of light at ``d`` mm from the sheet: 1 in the middle, 0 from `HALF` sigma on."""
    return min(max((HALF - abs(d) / thickness) / SOFT, 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def balance(samples: Floats, count: int, thickness: float) -> float:
    """Where the light balances: its mean distance from the sheet, mm; NaN without light."""
    s0 = s1 = 0.0
    for j in range(count):
        w = share(samples[j, 0], thickness) * samples[j, 1] * samples[j, 2]
        s0 += w
        s1 += w * samples[j, 0]
    return s1 / s0 if s0 > 0.0 else np.nan


@njit(cache=True, nogil=True, error_model="numpy")
def imbalance(
    seen: Seen,
    sweep: tuple[Floats, float],
    line: int,
    at: float,
    thickness: float,
    path: Floats,
    samples: Floats,
) -> tuple[float, float]:
    """Off balance by how many px a centre ``at`` that column is, and mm per px; NaN if unknown.

    ``path`` becomes that of the element there.
    """
    paths, pitch = sweep
    path_at(paths, pitch, line, at, path)
    pixel = path[2, 0] / path[1, 0]
    count, whole = follow(seen, path, line, at, thickness, samples)
    off = balance(samples, count, thickness) / pixel
    return off if whole else np.nan, pixel


@njit(cache=True, nogil=True, error_model="numpy")
def solve(
    seen: Seen,
    sweep: tuple[Floats, float],
    line: int,
    centre: float,
    thickness: float,
    path: Floats,
    samples: Floats,
) -> tuple[float, float, float]:
    """The centre, px, whose element's light balances on the sheet, the slope of the balance there,
    mm/px, and how far off balance ``centre`` was, px.

    Before the new centre the light balances on one side of the sheet, beyond it on the other:
    secant steps, halved where they leave what is known of it. NaN where there is none near;
    ``path`` is the element's then.
    """
    at = centre
    low, high = -np.inf, np.inf
    first = old_at = old = 0.0
    steep = 1.0
    for turn in range(ROUNDS):
        off, pixel = imbalance(seen, sweep, line, at, thickness, path, samples)
        if np.isnan(off):
            return np.nan, 0.0, first if turn > 0 else np.nan
        limit = LONGEST * thickness / abs(pixel)
        move = off
        if turn == 0:
            first = abs(off)
            move = math.copysign(max(first, FIRST_MOVE), off)
        elif at != old_at:
            steep = (old - off) / (at - old_at)
            if abs(off) < SETTLED or high - low < SETTLED:
                return at, min(max(steep, FLAT), STEEP) * pixel, first
            move = off / max(steep, FLAT)
        if off > 0.0:
            low = at
        else:
            high = at
        old_at = at
        old = off
        at += min(max(move, -limit), limit)
        if not low < at < high:
            at = 0.5 * (low + high)
        if abs(at - centre) > FARTHEST * limit:
            break
    return np.nan, 0.0, first


@njit(cache=True, nogil=True, error_model="numpy")
def uncertainty(
    seen: Seen,
    path: Floats,
    line: int,
    column: float,
    terms: tuple[float, float, float],
    samples: Floats,
) -> tuple[float, float, float, float]:
    """Variance of the balance, mm², by noise and by doubt; the light's rms distance from the sheet
    over what it must be; and by how many mm a blur moves the balance, per px² of half its variance:
    it adds so much of the light's second derivative.

    Doubt is about a blur of `BLUR`, and about a sheet that seems too thick or thin.
    """
    thickness, noise, per_level = terms
    s0 = s1 = s2 = spread = 0.0
    count, _ = follow(seen, path, line, column, thickness, samples)
    for j in range(count):
        d, value = samples[j, 0], samples[j, 2]
        w = share(d, thickness) * samples[j, 1]
        s0 += w * value
        s2 += w * d * d * value
        pixels = noise * noise + per_level * max(value, 0.0)
        spread += (w * d) ** 2 * pixels * samples[j, 3]
    if s0 <= 0.0 or s2 <= 0.0:
        return np.inf, 0.0, 0.0, 0.0
    for side in (-1.0, 1.0):
        follow(seen, path, line, column + side, thickness, samples)
        for j in range(count):
            s1 += share(samples[j, 0], thickness) * samples[j, 1] * samples[j, 0] * samples[j, 2]
    # The middle one of the three places of the second difference balances.
    pull = s1 / s0
    wide = math.sqrt(s2 / s0) / (FULL * thickness)
    odd = max(abs(wide - 1.0) - USUAL, 0.0) * thickness
    return spread / (s0 * s0), (BLUR * pull) ** 2 + odd * odd, wide, pull


@njit(cache=True, nogil=True, error_model="numpy")
def refine_lines(
    seen: Seen,
    sweep: tuple[Floats, float],
    position: Floats,
    terms: tuple[float, float, float],
    out: Floats,
) -> None:
    """Centres of one frame, moved to where the light of their own surface elements balances.

    ``seen`` is pieces (m, lines, columns) of successive frames, their first line, their first
    columns (m,), and their angles (m,) rad from the frame of the centres ``position`` (n,) px,
    which is one of them. ``sweep`` is paths and their pitch, ``terms`` the sheet's rms thickness,
    mm, the noise of a pixel and its variance per level of light.

    ``out`` (6, n): centre, px, its variance, px², by noise and by doubt, and the light's rms
    distance from the sheet over what it must be, where there is an answer; px that ``position`` was
    off balance where the frames cover the sheet; and, where there is an answer, px by which a blur
    pulls the centre per px² of half its variance. All else is NaN.
    """
    thickness = terms[0]
    samples = np.empty((seen[3].size, 4))
    path = np.empty((3, TERMS))
    out[:] = np.nan
    for line in range(position.size):
        if np.isnan(position[line]):
            continue
        centre, slope, first = solve(seen, sweep, line, position[line], thickness, path, samples)
        out[4, line] = first
        if np.isnan(centre):
            continue
        noise, doubt, wide, pull = uncertainty(seen, path, line, centre, terms, samples)
        if noise + doubt < (VAGUE * thickness) ** 2 and NARROW < wide < WIDE:
            out[0, line] = centre
            out[1, line] = noise / (slope * slope)
            out[2, line] = doubt / (slope * slope)
            out[3, line] = wide
            out[5, line] = pull / slope

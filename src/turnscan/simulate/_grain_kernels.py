"""Compiled kernels of the speckle model. It imports numba; import it inside functions."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit
from turnscan.simulate._airy import Keys, Numbers, Singles
from turnscan.simulate._random import mix, normal, uniform_pair

Complexes = npt.NDArray[np.complex64]


class Roughness(NamedTuple):
    """What the speckle of a surface depends on besides its shape; object frame, mm."""

    size: float
    """Edge of a scatterer; 0 where no speckle is wanted."""
    laser: Numbers
    """(3,) where the light comes from."""
    lens: Numbers
    """(3,)."""
    per_wave: float
    """Waves per mm."""


class Cells(NamedTuple):
    """What the cells of pixels near a stripe send."""

    energy: Singles
    """(n, oy, ox) photons."""
    keys: Keys
    """(n, oy, ox) scatterers, or (0, oy, ox) without speckle."""
    cycles: Singles
    """(n, oy, ox) fractions of a cycle, or (0, …) where these are not wanted."""
    wanted: npt.NDArray[np.bool_]
    """(n, by, bx) of the blocks of cells: whether they count."""


@njit(cache=True, nogil=True)
def block_of(cell: int, cells: int, blocks: int) -> int:
    """Which of some blocks along a pixel's side holds a cell."""
    return cell * blocks // cells


@njit(cache=True, nogil=True)
def index(pixels: npt.NDArray[np.int32], cells: Cells, lit: npt.NDArray[np.int32]) -> bool:
    """Fill ``lit``; pixels without energy stay dark. True where a pixel is listed twice."""
    twice = False
    _, oy, ox = cells.energy.shape
    _, by, bx = cells.wanted.shape
    for i in range(len(pixels)):
        r, c = pixels[i, 0], pixels[i, 1]
        if _is_lit(cells, i, (oy, ox), (by, bx)):
            twice |= lit[r, c] >= 0
            lit[r, c] = i
    return twice


@njit(cache=True, nogil=True)
def _is_lit(cells: Cells, i: int, shape: tuple[int, int], blocks: tuple[int, int]) -> bool:
    for ky in range(blocks[0]):
        for kx in range(blocks[1]):
            if not cells.wanted[i, ky, kx]:
                continue
            for y in range(shape[0]):
                if block_of(y, shape[0], blocks[0]) != ky:
                    continue
                for x in range(shape[1]):
                    if block_of(x, shape[1], blocks[1]) == kx and cells.energy[i, y, x] > 0.0:
                        return True
    return False


@njit(cache=True, nogil=True)
def hash_cells(points: Floats, per_mm: float, keys: Keys) -> None:
    """Hash of the cubic cell that holds each point."""
    for i in range(len(points)):
        word = _cell_word(points[i, 0], points[i, 1], points[i, 2], per_mm)
        keys[i] = np.uint32(word >> np.uint64(32))


@njit(cache=True, nogil=True, inline="always")
def _cell_word(x: float, y: float, z: float, per_mm: float) -> np.uint64:
    word = mix(np.uint64(0), np.uint64(np.int64(math.floor(x * per_mm))))
    word = mix(word, np.uint64(np.int64(math.floor(y * per_mm))))
    return mix(word, np.uint64(np.int64(math.floor(z * per_mm))))


@njit(cache=True, nogil=True, inline="always")
def _inside(x: float, word: np.uint64, shift: np.uint64, size: float) -> float:
    """Where the scatterer lies in its cell along one axis, from 21 bits of the cell's hash."""
    part = float((word >> shift) & np.uint64(0x1FFFFF)) / 2097152.0
    return (math.floor(x * (1.0 / size)) + part) * size


@njit(cache=True, nogil=True)
def scatterer(x: float, y: float, z: float, rough: Roughness) -> tuple[np.uint32, np.float32]:
    """Key of the cubic cell that holds a point, and the fraction of a cycle of the path laser,
    scatterer, lens.

    A scatterer lies anywhere in its cell, by the cell's hash: on a regular lattice all phases
    would come round together, as a grating's do, when the table has turned far enough.
    """
    size, laser, lens = rough.size, rough.laser, rough.lens
    word = _cell_word(x, y, z, 1.0 / size)
    px = _inside(x, word, np.uint64(0), size)
    py = _inside(y, word, np.uint64(21), size)
    pz = _inside(z, word, np.uint64(42), size)
    there = (px - laser[0]) ** 2 + (py - laser[1]) ** 2 + (pz - laser[2]) ** 2
    back = (px - lens[0]) ** 2 + (py - lens[1]) ** 2 + (pz - lens[2]) ** 2
    cycles = (math.sqrt(there) + math.sqrt(back)) * rough.per_wave
    part = np.float32(cycles - math.floor(cycles))
    return np.uint32(word >> np.uint64(32)), part if part < 1.0 else np.float32(0.0)


@njit(cache=True, nogil=True)
def path_cycles(points: Floats, rough: Roughness, phase: Singles) -> None:
    """Fraction of a cycle of the path laser, scatterer, lens, of points (n, 3)."""
    for i in range(len(points)):
        at = points[i]
        _, phase[i] = scatterer(at[0], at[1], at[2], rough)


@njit(cache=True, nogil=True)
def gather(
    lit: npt.NDArray[np.int32],
    place: tuple[int, int, int, int],
    cells: Cells,
    light: Singles,
    ids: Keys,
    turns: Singles,
) -> None:
    """Lay the cells of the lit pixels of a ``place``, rows r0 to r1 and columns c0 to c1, into
    sheets; keys and phase where there are any."""
    r0, r1, c0, c1 = place
    energy, keys, cycles, wanted = cells
    _, oy, ox = energy.shape
    _, by, bx = wanted.shape
    for r in range(max(r0, 0), min(r1, lit.shape[0])):
        for c in range(c0, c1):
            i = lit[r, c]
            if i < 0:
                continue
            left, whole = (c - c0) * ox, wanted[i].all()
            for y in range(oy):
                row = (r - r0) * oy + y
                for x in range(ox):
                    own = whole or wanted[i, block_of(y, oy, by), block_of(x, ox, bx)]
                    light[row, left + x] = energy[i, y, x] if own else 0.0
                if len(ids):
                    for x in range(ox):
                        ids[row, left + x] = keys[i, y, x]
                if len(turns):
                    for x in range(ox):
                        turns[row, left + x] = cycles[i, y, x]


@njit(cache=True, nogil=True)
def amplitudes(light: Singles, ids: Keys, lobe: Singles, amplitude: Singles) -> None:
    """Root of the energy over the coherent gain of the cells that share a scatterer.

    n cells with one phasor would give n² times the energy of one cell instead of n times.
    """
    rows, columns = light.shape
    ry, rx = lobe.shape[0] // 2, lobe.shape[1] // 2
    gains = np.empty(columns, np.float32)
    for r in range(rows):
        first, end = _lit_part(light[r])
        energy, own, gain = light[r, first:end], ids[r, first:end], gains[first:end]
        gain[:] = 0.0
        # Row by row with one distance at a time: the compiler then does many cells at once.
        for y in range(max(r - ry, 0), min(r + ry + 1, rows)):
            for x in range(-rx, rx + 1):
                a, b = max(first + x, 0), min(end + x, columns)
                other, lit, weight = ids[y, a:b], light[y, a:b], lobe[y - r + ry, x + rx]
                here, sum_ = own[a - x - first :], gain[a - x - first :]
                for c in range(b - a):
                    same = (other[c] == here[c]) & (lit[c] > 0.0)
                    sum_[c] += weight if same else np.float32(0.0)
        target = amplitude[r, first:end]
        for c in range(end - first):
            e = max(energy[c], np.float32(0.0))
            target[c] = math.sqrt(e / max(gain[c], np.float32(1.0)))


@njit(cache=True, nogil=True)
def _lit_part(light: Singles) -> tuple[int, int]:
    """The first cell with light, and the one after the last; 0, 0 where there is none."""
    end = len(light)
    while end > 0 and light[end - 1] <= 0.0:
        end -= 1
    first = 0
    while first < end and light[first] <= 0.0:
        first += 1
    return first, end


@njit(cache=True, nogil=True)
def dress(
    amplitude: Singles,
    ids: Keys,
    turns: Singles,
    seed: np.uint64,
    phasors: Complexes,
    factors: Complexes,
    field: Complexes,
) -> None:
    """Give every cell the phasor of its scatterer."""
    rows, columns = amplitude.shape
    phased = turns.size > 0
    which, step = np.empty(columns, np.uint16), np.empty(columns, np.int32)
    for r in range(rows):
        first, end = _lit_part(amplitude[r])
        field[r, :first] = 0.0
        field[r, end:] = 0.0
        a, own, out = amplitude[r, first:end], ids[r, first:end], field[r, first:end]
        for c in range(end - first):
            which[c] = mix(seed, np.uint64(own[c])) >> np.uint64(48)
        if phased:
            turn = turns[r, first:end]
            for c in range(end - first):
                step[c] = min(np.int32(turn[c] * np.float32(4096.0)), np.int32(4095))
            for c in range(end - first):
                phasor, factor = phasors[which[c]], factors[step[c]]
                re, im = a[c] * phasor.real, a[c] * phasor.imag
                out[c] = complex(
                    re * factor.real - im * factor.imag, re * factor.imag + im * factor.real
                )
        else:
            for c in range(end - first):
                out[c] = a[c] * phasors[which[c]]


@njit(cache=True, nogil=True)
def low_frequencies(spectrum: Complexes, ends: tuple[int, int]) -> Complexes:
    """The first and the last columns, so many of each."""
    low, high = ends
    rows, columns = spectrum.shape
    out = np.empty((rows, low + high), np.complex64)
    for r in range(rows):
        out[r, :low] = spectrum[r, :low]
        out[r, low:] = spectrum[r, columns - high :]
    return out


@njit(cache=True, nogil=True)
def filtered(spectrum: Complexes, filter_: Singles, ends: tuple[int, int]) -> None:
    """Multiply what `low_frequencies` left by a filter of the whole spectrum, in place."""
    low, high = ends
    rows, columns = filter_.shape
    for r in range(rows):
        for c in range(low):
            spectrum[r, c] *= filter_[r, c]
        for c in range(high):
            spectrum[r, low + c] *= filter_[r, columns - high + c]


@njit(cache=True, nogil=True)
def whole_spectrum(part: Complexes, first: int, end: int, columns: int, low: int) -> Complexes:
    """Rows of what `low_frequencies` left (of ``low`` first columns), with nothing in between."""
    out = np.empty((end - first, columns), np.complex64)
    high = part.shape[1] - low
    for r in range(end - first):
        out[r, :low] = part[first + r, :low]
        out[r, low : columns - high] = 0.0
        out[r, columns - high :] = part[first + r, low:]
    return out


@njit(cache=True, nogil=True)
def intensity(seen: Complexes) -> Singles:
    """Squared modulus."""
    out = np.empty(seen.shape, np.float32)
    for r in range(seen.shape[0]):
        for c in range(seen.shape[1]):
            value = seen[r, c]
            out[r, c] = value.real * value.real + value.imag * value.imag
    return out


@njit(cache=True, nogil=True)
def integrate(
    light: Singles,
    share: float,
    down: Singles,
    across: Singles,
    place: tuple[int, int, int],
    out: Singles,
) -> None:
    """Add the light of each pixel to the picture; ``light`` has one row more at either end.

    ``place`` is the first row and column of the picture that it falls on, and how many columns.
    """
    r0, c0, columns = place
    oy, ox = len(down) - 2, len(across) - 2
    width = light.shape[1]
    rows = (light.shape[0] - 2) // oy
    strip = np.empty(width, np.float32)
    for r in range(rows):
        strip[:] = 0.0
        for y in range(oy + 2):
            for x in range(width):
                strip[x] += down[y] * light[r * oy + y, x]
        for c in range(columns):
            total = np.float32(0.0)
            for x in range(ox + 2):
                total += across[x] * strip[(c * ox + x - 1 + width) % width]
            out[r0 + r, c0 + c] += np.float32(share) * max(total, np.float32(0.0))


@njit(cache=True, nogil=True)
def white(keys: Keys, seed: np.uint64, out: Singles, centre: Floats, tail: Floats) -> None:
    """Standard normal numbers (H, W) by key and seed."""
    rows, columns = keys.shape
    for r in range(rows):
        for c in range(columns):
            u, _ = uniform_pair(mix(seed, np.uint64(keys[r, c])))
            out[r, c] = normal(u, centre, tail)

"""Compiled kernels of the speckle model. It imports numba; import it inside functions."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit
from turnscan.simulate._airy import Keys, Singles
from turnscan.simulate._random import mix, normal, uniform_pair

Complexes = npt.NDArray[np.complex64]


@njit(cache=True, nogil=True)
def index(pixels: npt.NDArray[np.int32], energy: Singles, lit: npt.NDArray[np.int32]) -> bool:
    """Fill ``lit``; pixels without energy stay dark. True where a pixel is listed twice."""
    twice = False
    for i in range(len(pixels)):
        r, c = pixels[i, 0], pixels[i, 1]
        if energy[i].max() > 0.0:
            twice |= lit[r, c] >= 0
            lit[r, c] = i
    return twice


@njit(cache=True, nogil=True)
def hash_cells(points: Floats, per_mm: float, keys: Keys) -> None:
    """Hash of the cubic cell that holds each point."""
    for i in range(len(points)):
        word = _cell_word(points, i, per_mm)
        keys[i] = np.uint32(word >> np.uint64(32))


@njit(cache=True, nogil=True, inline="always")
def _cell_word(points: Floats, i: int, per_mm: float) -> np.uint64:
    word = np.uint64(0)
    for axis in range(3):
        whole = np.int64(math.floor(points[i, axis] * per_mm))
        word = mix(word, np.uint64(whole))
    return word


@njit(cache=True, nogil=True)
def path_cycles(
    points: Floats, size: float, laser: Floats, lens: Floats, per_wave: float, phase: Singles
) -> None:
    """Fraction of a cycle of the path laser, scatterer, lens.

    A scatterer lies anywhere in its cell, by the cell's hash: on a regular lattice all phases
    would come round together, as a grating's do, when the table has turned far enough.
    """
    per_mm = 1.0 / size
    for i in range(len(points)):
        word = _cell_word(points, i, per_mm)
        there, back = 0.0, 0.0
        for axis in range(3):
            within = float((word >> np.uint64(21 * axis)) & np.uint64(0x1FFFFF)) / 2097152.0
            place = (math.floor(points[i, axis] * per_mm) + within) * size
            there += (place - laser[axis]) ** 2
            back += (place - lens[axis]) ** 2
        cycles = (math.sqrt(there) + math.sqrt(back)) * per_wave
        phase[i] = cycles - math.floor(cycles)


@njit(cache=True, nogil=True)
def gather(
    lit: npt.NDArray[np.int32],
    r0: int,
    c0: int,
    r1: int,
    c1: int,
    energy: Singles,
    keys: Keys,
    light: Singles,
    ids: Keys,
) -> None:
    """Lay the cells of the lit pixels of rows r0 to r1, columns c0 to c1 into one sheet."""
    oy, ox = energy.shape[1], energy.shape[2]
    for r in range(max(r0, 0), min(r1, lit.shape[0])):
        for c in range(c0, c1):
            i = lit[r, c]
            if i < 0:
                continue
            for y in range(oy):
                for x in range(ox):
                    light[(r - r0) * oy + y, (c - c0) * ox + x] = energy[i, y, x]
                    ids[(r - r0) * oy + y, (c - c0) * ox + x] = keys[i, y, x]


@njit(cache=True, nogil=True)
def gather_phase(
    lit: npt.NDArray[np.int32], r0: int, c0: int, r1: int, c1: int, phase: Singles, turns: Singles
) -> None:
    """The same for the phases of the cells."""
    oy, ox = phase.shape[1], phase.shape[2]
    for r in range(max(r0, 0), min(r1, lit.shape[0])):
        for c in range(c0, c1):
            i = lit[r, c]
            if i >= 0:
                for y in range(oy):
                    for x in range(ox):
                        turns[(r - r0) * oy + y, (c - c0) * ox + x] = phase[i, y, x]


@njit(cache=True, nogil=True, fastmath=True)
def amplitudes(light: Singles, ids: Keys, lobe: Singles, amplitude: Singles) -> None:
    """Root of the energy over the coherent gain of the cells that share a scatterer.

    n cells with one phasor would give n² times the energy of one cell instead of n times.
    """
    rows, columns = light.shape
    ry, rx = lobe.shape[0] // 2, lobe.shape[1] // 2
    for r in range(rows):
        low, high = max(r - ry, 0), min(r + ry + 1, rows)
        for c in range(columns):
            e = light[r, c]
            if e <= 0.0:
                continue
            own = ids[r, c]
            left, right = max(c - rx, 0), min(c + rx + 1, columns)
            gain = np.float32(0.0)
            for y in range(low, high):
                for x in range(left, right):
                    if ids[y, x] == own and light[y, x] > 0.0:
                        gain += lobe[y - r + ry, x - c + rx]
            amplitude[r, c] = math.sqrt(e / max(gain, np.float32(1.0)))


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
    for r in range(rows):
        for c in range(columns):
            a = amplitude[r, c]
            if a == 0.0:
                field[r, c] = 0.0
                continue
            word = mix(seed, np.uint64(ids[r, c]))
            value = a * phasors[np.int64(word >> np.uint64(48))]
            if phased:
                value *= factors[min(int(turns[r, c] * np.float32(4096.0)), 4095)]
            field[r, c] = value


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

"""The working parts of the speckle model. This module imports numba; import it inside functions."""
# mypy: disable-error-code="untyped-decorator,no-any-return"

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numba import njit

from turnscan.arrays import Floats
from turnscan.simulate._random import (
    mix,
    normal,
    normal_tables,
    phasor_table,
    seed64,
    uniform_pair,
)
from turnscan.simulate._speckle import Grain, Keys, Singles, Window, jinc

Complexes = npt.NDArray[np.complex64]

_TURN = 4096
"""Steps of the table of phase factors."""


def hashed_cells(points: Floats, size: float) -> Keys:
    """(n, 3) → (n,) hash of the cubic cell of edge ``size`` that holds the point."""
    keys = np.empty(len(points), np.uint32)
    _hash_cells(points, 1.0 / size, keys)
    return keys


def index_of_lit(
    pixels: npt.NDArray[np.int32], energy: Singles, shape: tuple[int, int]
) -> npt.NDArray[np.int32]:
    """(H, W) index of each lit pixel in the list, -1 where dark.

    Raises ValueError where a pixel is listed twice.
    """
    lit = np.full(shape, -1, np.int32)
    if _index(pixels, energy, lit):
        raise ValueError("speckled: a pixel is listed twice")
    return lit


def expose_window(
    window: Window,
    lit: npt.NDArray[np.int32],
    cells: tuple[Singles, Keys, Singles | None],
    grain: Grain,
    seed: int,
    mixture: tuple[float, tuple[float, ...]],
    apron: int,
    out: Singles,
) -> None:
    """Add the picture of one window to ``out``, from the lit cells in it and in its apron.

    ``cells`` are energy, keys and phase of every lit pixel, ``mixture`` as of `pattern_weights`.
    """
    from scipy import fft

    energy, keys, phase = cells
    plain, shares = mixture
    per_pixel = energy.shape[1:]
    r0, r1, c0, c1 = window
    box = ((r1 - r0 + 2 * apron) * per_pixel[0], (c1 - c0) * per_pixel[1])
    size = (fft.next_fast_len(box[0]), fft.next_fast_len(box[1]))
    light = np.zeros(size, np.float32)
    ids = np.zeros(size, np.uint32)
    turns = np.zeros(size if phase is not None else (0, 0), np.float32)
    _gather(lit, r0 - apron, c0, r1 + apron, c1, energy, keys, light, ids)
    if phase is not None:
        _gather_phase(lit, r0 - apron, c0, r1 + apron, c1, phase, turns)
    amplitude = np.zeros(size, np.float32)
    _amplitudes(light, ids, _lobe(grain, per_pixel), amplitude)
    # One row of cells more at either end: the rule that integrates a pixel reaches over its edge.
    core = slice(apron * per_pixel[0] - 1, (apron + r1 - r0) * per_pixel[0] + 1)
    place = (r0, c0, c1 - c0)
    rules = [_rule(n, g) for n, g in zip(per_pixel, grain, strict=True)]
    field = np.empty(size, np.complex64)
    for k, share in enumerate(shares):
        _dress(amplitude, ids, turns, seed64(seed, k), phasor_table(), _turns(), field)
        seen = _low_passed(field, _pupil(grain, per_pixel, size), core)
        _integrate(_intensity(seen), share, *rules, *place, out)
    if plain:
        seen = _low_passed(light.astype(np.complex64), _transfer(grain, per_pixel, size), core)
        _integrate(seen.real, plain, *rules, *place, out)


def gamma_field(keys: Keys, seed: int, spread: float, neighbours: tuple[float, float]) -> Singles:
    """(H, W) Gamma numbers of mean 1 and relative spread ``spread``, correlated to neighbours."""
    from scipy.ndimage import correlate1d
    from scipy.special import gammaincinv, ndtr

    white = np.empty(keys.shape, np.float32)
    _white(keys, seed64(seed, 0), white, *normal_tables())
    for axis, correlation in enumerate(neighbours):
        white = correlate1d(white, _short_filter(correlation), axis=axis, mode="wrap")
    shape = 1.0 / spread**2
    z = np.linspace(-6.0, 6.0, 2049)
    values = gammaincinv(shape, ndtr(z)) / shape
    return np.interp(white, z, values).astype(np.float32)


def _short_filter(correlation: float) -> Floats:
    """Three taps (b, a, b) of power 1 whose output correlates by 2ab with its neighbour."""
    wanted = min(max(correlation, 0.0), 0.6)
    # a² + 2b² = 1 and 2ab = wanted, so 8b⁴ - 4b² + wanted² = 0.
    square = (1.0 - math.sqrt(1.0 - 2.0 * wanted**2)) / 4.0
    b = math.sqrt(square)
    return np.array([b, math.sqrt(1.0 - 2.0 * square), b])


@lru_cache(maxsize=32)
def _lobe(grain: Grain, per_pixel: tuple[int, int]) -> Singles:
    """How coherently cells of one scatterer add up in the lens, by their distance in cells.

    As far as a scatterer of edge λN'/2 can reach when the surface cuts it along its diagonal.
    """
    step = [1.0 / (n * g) for n, g in zip(per_pixel, grain, strict=True)]
    reach = [max(1, int(0.5 * math.sqrt(3.0) / s)) for s in step]
    y = np.arange(-reach[0], reach[0] + 1)[:, None] * step[0]
    x = np.arange(-reach[1], reach[1] + 1)[None, :] * step[1]
    return jinc(np.hypot(y, x)).astype(np.float32)


@lru_cache(maxsize=32)
def _rule(cells: int, grain: float) -> Singles:
    """(cells + 2,) weights of the cells of a pixel, and of one beyond either edge.

    They integrate light that has no frequency above 1/(λN'). The plain sum would let too much
    of the finest grain pass when a cell is half a grain: each cell must stand for its own mean,
    which a three-point average (a, 1 - 2a, a) gives, exact here at half the highest frequency.
    """
    beta = 1.0 / (cells * grain)
    a = (1.0 - np.sinc(0.5 * beta)) / (2.0 * (1.0 - math.cos(math.pi * beta)))
    rule = np.ones(cells + 2)
    rule[[0, -1]] = a
    rule[[1, -2]] -= a
    return rule.astype(np.float32)


def _radius(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Floats:
    """Spatial frequency in units of 1/(λN'), in the transform's order."""
    fy = np.fft.fftfreq(size[0], 1.0 / (per_pixel[0] * grain[0]))
    fx = np.fft.fftfreq(size[1], 1.0 / (per_pixel[1] * grain[1]))
    return np.asarray(np.hypot(fy[:, None], fx[None, :]), dtype=np.float64)


@lru_cache(maxsize=32)
def _pupil(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Singles:
    """The circular pupil on the frequencies of a window, of power gain 1 for white light."""
    # The edge is softened over one frequency step, so that its area does not jump with the size.
    step = max(n * g / m for n, g, m in zip(per_pixel, grain, size, strict=True))
    P = np.clip((0.5 - _radius(grain, per_pixel, size)) / step + 0.5, 0.0, 1.0)
    return (P * math.sqrt(P.size / (P**2).sum())).astype(np.float32)


@lru_cache(maxsize=8)
def _transfer(grain: Grain, per_pixel: tuple[int, int], size: tuple[int, int]) -> Singles:
    """What the same lens does to incoherent light: the pupil's autocorrelation."""
    nu = np.minimum(_radius(grain, per_pixel, size), 1.0)
    otf = (np.arccos(nu) - nu * np.sqrt(1.0 - nu**2)) * (2.0 / np.pi)
    return otf.astype(np.float32)


def _low_passed(field: Complexes, filter_: Singles, core: slice) -> Complexes:
    """The rows ``core`` of the field behind the filter.

    Columns of the spectrum that the filter kills are not transformed.
    """
    from scipy import fft

    kept = np.flatnonzero(filter_[0])  # the filter falls with frequency: row 0 is its widest
    spectrum = fft.fft(field, axis=1)[:, kept]
    spectrum = fft.fft(spectrum, axis=0, overwrite_x=True)
    spectrum *= filter_[:, kept]
    part = fft.ifft(spectrum, axis=0, overwrite_x=True)[core]
    full = np.zeros((part.shape[0], field.shape[1]), np.complex64)
    full[:, kept] = part
    return np.asarray(fft.ifft(full, axis=1, overwrite_x=True))


@lru_cache(maxsize=1)
def _turns() -> Complexes:
    table = np.exp(2j * np.pi * (np.arange(_TURN) + 0.5) / _TURN).astype(np.complex64)
    table.flags.writeable = False
    return table


@njit(cache=True, nogil=True)
def _index(pixels: npt.NDArray[np.int32], energy: Singles, lit: npt.NDArray[np.int32]) -> bool:
    """Fill ``lit``; pixels without energy stay dark. True where a pixel is listed twice."""
    twice = False
    for i in range(len(pixels)):
        r, c = pixels[i, 0], pixels[i, 1]
        if energy[i].max() > 0.0:
            twice |= lit[r, c] >= 0
            lit[r, c] = i
    return twice


@njit(cache=True, nogil=True)
def _hash_cells(points: Floats, per_mm: float, keys: Keys) -> None:
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
def _gather(
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
def _gather_phase(
    lit: npt.NDArray[np.int32], r0: int, c0: int, r1: int, c1: int, phase: Singles, turns: Singles
) -> None:
    oy, ox = phase.shape[1], phase.shape[2]
    for r in range(max(r0, 0), min(r1, lit.shape[0])):
        for c in range(c0, c1):
            i = lit[r, c]
            if i >= 0:
                for y in range(oy):
                    for x in range(ox):
                        turns[(r - r0) * oy + y, (c - c0) * ox + x] = phase[i, y, x]


@njit(cache=True, nogil=True, fastmath=True)
def _amplitudes(light: Singles, ids: Keys, lobe: Singles, amplitude: Singles) -> None:
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
def _dress(
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
def _intensity(seen: Complexes) -> Singles:
    out = np.empty(seen.shape, np.float32)
    for r in range(seen.shape[0]):
        for c in range(seen.shape[1]):
            value = seen[r, c]
            out[r, c] = value.real * value.real + value.imag * value.imag
    return out


@njit(cache=True, nogil=True)
def _integrate(
    light: Singles,
    share: float,
    down: Singles,
    across: Singles,
    r0: int,
    c0: int,
    columns: int,
    out: Singles,
) -> None:
    """Add the light of each pixel to the picture; ``light`` has one row more at either end."""
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
def _white(keys: Keys, seed: np.uint64, out: Singles, centre: Floats, tail: Floats) -> None:
    rows, columns = keys.shape
    for r in range(rows):
        for c in range(columns):
            u, _ = uniform_pair(mix(seed, np.uint64(keys[r, c])))
            out[r, c] = normal(u, centre, tail)

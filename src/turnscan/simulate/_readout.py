"""The compiled kernels of the sensor. This module imports numba; import it inside functions."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit
from turnscan.simulate._fading import MOST, faded, powers_of_e
from turnscan.simulate._random import mix, normal, normal_tables, uniform_pair
from turnscan.simulate._sensor import Sensor

Charges = npt.NDArray[np.float32]
Converter = tuple[float, float, float, float, float]
"""Full well, gain, read noise, black level and highest step of a sensor."""
Tables = tuple[Floats, Floats, Floats]
"""Of `normal_tables`, and e to the power of less and less."""

_SPREADS = 200
_FEW = MOST
"""Electrons in the mean below which they are drawn by inversion."""
_MOST = 100
CHUNK = 512
"""Pixels whose electrons are drawn at once."""


def raw(
    light: Charges, sensor: Sensor, shot: np.uint64, silicon: np.uint64, seconds: float
) -> npt.NDArray[np.uint16]:
    """(H, W) expected electrons → (H, W) converter steps, before any processing."""
    silent = np.zeros((0, 0), np.float32)
    response = response_map(light.shape, sensor.prnu, int(silicon)) if sensor.prnu else silent
    blooms = sensor.bloom != "none"
    charge = np.empty_like(light) if blooms else silent
    steps = np.empty(light.shape, np.uint16)
    converter = (
        sensor.full_well, sensor.gain, sensor.read_noise, sensor.black,
        float(sensor.converter_levels - 1),
    )  # fmt: skip
    excess = _collect(
        light, response, sensor.dark_current * seconds, shot, converter, tables(), charge, steps
    )
    if excess and blooms:
        kept = 1.0 - sensor.anti_bloom
        (_bloom_columns if sensor.bloom == "column" else _bloom_around)(
            charge, sensor.full_well, kept
        )
        _convert(charge, shot, converter, tables(), steps)
    return steps


@lru_cache(maxsize=1)
def tables() -> Tables:
    """What the kernels look up."""
    return (*normal_tables(), powers_of_e())


@lru_cache(maxsize=2)
def response_map(shape: tuple[int, ...], prnu: float, silicon: int) -> Charges:
    """(H, W) response of each pixel relative to the mean, fixed for one specimen."""
    out = np.empty(shape, np.float32)
    _response(out, prnu, np.uint64(silicon), *normal_tables())
    out.flags.writeable = False
    return out


def mosaic(light: Charges, filters: npt.NDArray[np.int64]) -> Charges:
    """What each pixel sees behind its own colour filter; light without colour is white."""
    if light.ndim == 2:
        return light
    out = np.empty(light.shape[:2], np.float32)
    for row in range(2):
        for column in range(2):
            out[row::2, column::2] = light[row::2, column::2, filters[row, column]]
    return out


def jittered(light: Charges, rms: float, seed: np.uint64) -> Charges:
    """Each row moved sideways by its own random fraction of a pixel (cubic interpolation).

    The light is moved, not the noise: interpolation would smooth the noise of the pixels.
    """
    out = np.empty_like(light)
    _jitter(light, out, rms, seed, *normal_tables())
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def poisson(work: Floats, n: int, tables: Tables) -> None:
    """Draw n Poisson numbers, each from one uniform number in (0, 1).

    ``work`` has `CHUNK` numbers each of means, uniform numbers, what is drawn, and twice room for
    what is worked out. By inversion for means below 16, exactly; else by the Cornish-Fisher
    expansion with Sheppard's correction for the rounding: its mean and variance are right to 1e-3.
    """
    few = many = False
    for j in range(n):
        few |= work[j] < _FEW
        many |= work[j] >= _FEW
    if few:
        few = _nothing(work, n, tables[2])
    if few:
        _few(work, n)
    if many:
        normals(work[CHUNK:], n, tables, work[3 * CHUNK :])
        _many(work, n)


@njit(cache=True, nogil=True, error_model="numpy")
def _nothing(work: Floats, n: int, powers: Floats) -> bool:
    """Begin with small means: how likely nothing is drawn; whether there are any above 0."""
    some = False
    for j in range(n):
        mean = work[j]
        drawn = 0.0 < mean < _FEW
        nothing = faded(min(max(mean, 0.0), _FEW), powers)
        work[j + 2 * CHUNK] = 0.0
        work[j + 3 * CHUNK] = nothing if drawn else 0.0
        work[j + 4 * CHUNK] = nothing if drawn else 1.0
        some |= drawn
    return some


@njit(cache=True, nogil=True, error_model="numpy")
def _many(work: Floats, n: int) -> None:
    """The numbers of means from 16 on among n, from normal numbers in the 4th part of ``work``."""
    for j in range(n):
        mean, z = work[j], work[j + 3 * CHUNK]
        s = math.sqrt(max(mean, _FEW) - 1.0 / 12.0)
        x = mean + s * z + (z * z - 1.0) / 6.0 + (z - z * z * z) / (72.0 * s)
        drawn = max(math.floor(x + 0.5), 0.0)
        work[j + 2 * CHUNK] = drawn if mean >= _FEW else work[j + 2 * CHUNK]


@njit(cache=True, nogil=True, error_model="numpy")
def _few(work: Floats, n: int) -> None:
    """The numbers of n small means at once: one more electron in each round.

    The last two of ``work`` are exp(−mean) twice, or 0 and 1 where nothing is to be drawn. All lie
    in one array, so that the compiler knows that they do not overlap.
    """
    for k in range(1, _MOST + 1):
        left = 0
        part = 1.0 / k
        for j in range(n):
            more = work[j + CHUNK] > work[j + 4 * CHUNK]
            left += more
            work[j + 2 * CHUNK] += 1.0 if more else 0.0
            work[j + 3 * CHUNK] *= work[j] * part
            work[j + 4 * CHUNK] += work[j + 3 * CHUNK]
        if not left:
            return


@njit(cache=True, nogil=True)
def _response(out: Charges, prnu: float, silicon: np.uint64, centre: Floats, tail: Floats) -> None:
    target = out.ravel()
    for i in range(target.size):
        u, _ = uniform_pair(mix(silicon, np.uint64(i)))
        target[i] = max(1.0 + prnu * normal(u, centre, tail), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _collect(
    light: Charges, response: Charges, dark: float, seed: np.uint64, converter: Converter,
    tables: Tables, charge: Charges, steps: npt.NDArray[np.uint16],
) -> bool:  # fmt: skip
    """Draw the electrons of every pixel and convert them; True when any pixel holds more than its
    full well. ``charge`` takes the electrons, unless it is empty; so may be ``response``.
    """
    source, relative, kept = light.ravel(), response.ravel(), charge.ravel()
    target = steps.ravel()
    work, read, volts = np.empty(5 * CHUNK), np.empty(CHUNK), np.empty(CHUNK)
    excess = False
    # Each loop does one thing to a whole chunk, so that the compiler can do several pixels at once.
    for start in range(0, source.size, CHUNK):
        part = source[start : start + CHUNK]
        n, steps_of = len(part), target[start : start + CHUNK]
        if relative.size:
            own = relative[start : start + CHUNK]
            for j in range(n):
                work[j] = float(part[j] * own[j]) + dark
        else:
            for j in range(n):
                work[j] = float(part[j]) + dark
        for j in range(n):
            work[j + CHUNK], read[j] = uniform_pair(mix(seed, np.uint64(start) + np.uint64(j)))
        poisson(work, n, tables)
        drawn = work[2 * CHUNK :]
        for j in range(n):
            excess |= drawn[j] > converter[0]
            drawn[j] = float(np.float32(drawn[j]))
        if kept.size:
            for j in range(n):
                kept[start + j] = drawn[j]
        normals(read, n, tables, volts)
        for j in range(n):
            steps_of[j] = _step(drawn[j], volts[j], converter)
    return excess


@njit(cache=True, nogil=True, error_model="numpy")
def normals(u: Floats, n: int, tables: Tables, z: Floats) -> None:
    """The normal quantiles of n uniform numbers in (0, 1), as `normal` finds them."""
    centre, tail = tables[0], tables[1]
    for j in range(n):
        t = u[j] * 8192.0
        i = int(t)
        z[j] = centre[i] + (t - i) * (centre[i + 1] - centre[i])
    for j in range(n):
        if u[j] < 1.0 / 128.0 or u[j] > 127.0 / 128.0:
            z[j] = normal(u[j], centre, tail)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _step(electrons: float, z: float, converter: Converter) -> np.uint16:
    """Full well, read noise, gain, black level, converter; ``z`` is a normal number."""
    full_well, gain, read_noise, black, top = converter
    volts = min(float(electrons), full_well) + read_noise * z
    value = math.floor(volts / gain + black + 0.5)
    return np.uint16(min(max(value, 0.0), top))


@njit(cache=True, nogil=True, error_model="numpy")
def _convert(
    charge: Charges, seed: np.uint64, converter: Converter, tables: Tables,
    steps: npt.NDArray[np.uint16],
) -> None:  # fmt: skip
    """Convert charges again, after they have bloomed."""
    source, target = charge.ravel(), steps.ravel()
    for i in range(source.size):
        _, u = uniform_pair(mix(seed, np.uint64(i)))
        target[i] = _step(source[i], normal(u, tables[0], tables[1]), converter)


@njit(cache=True, nogil=True)
def _bloom_columns(charge: Charges, full_well: float, kept: float) -> None:
    """Half the excess runs down its column, half up, each filling the pixels it meets."""
    rows, columns = charge.shape
    spill = np.empty(rows)
    for c in range(columns):
        any_excess = False
        for r in range(rows):
            spill[r] = 0.5 * kept * max(charge[r, c] - full_well, 0.0)
            if spill[r] > 0.0:
                any_excess = True
                charge[r, c] = full_well
        if not any_excess:
            continue
        for down in range(2):
            carried = 0.0
            for k in range(rows):
                r = k if down == 0 else rows - 1 - k
                room = min(full_well - charge[r, c], carried)
                charge[r, c] += room
                carried += spill[r] - room


@njit(cache=True, nogil=True)
def _bloom_around(charge: Charges, full_well: float, kept: float) -> None:
    """The excess of a pixel flows to its four neighbours until everything fits."""
    rows, columns = charge.shape
    excess = np.zeros((rows, columns), np.float32)
    for r in range(rows):
        for c in range(columns):
            if charge[r, c] > full_well:
                excess[r, c] = kept * (charge[r, c] - full_well)
                charge[r, c] = full_well
    for _ in range(_SPREADS):
        moved = np.zeros((rows, columns), np.float32)
        active = False
        for r in range(rows):
            for c in range(columns):
                quarter = 0.25 * excess[r, c]
                if quarter == 0.0:
                    continue
                for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                    y, x = r + dr, c + dc
                    if 0 <= y < rows and 0 <= x < columns:
                        room = min(full_well - charge[y, x], quarter)
                        charge[y, x] += room
                        moved[y, x] += quarter - room
                        active |= quarter - room > 1.0
        excess = moved
        if not active:
            return


@njit(cache=True, nogil=True)
def _jitter(
    light: Charges, out: Charges, rms: float, seed: np.uint64, centre: Floats, tail: Floats
) -> None:
    rows, columns = light.shape
    for r in range(rows):
        u, _ = uniform_pair(mix(seed, np.uint64(r)))
        shift = rms * normal(u, centre, tail)
        whole = math.floor(shift)
        t = shift - whole
        # Catmull-Rom weights: they sum to 1 and keep a linear ramp linear.
        w0 = 0.5 * t * (-1.0 + t * (2.0 - t))
        w1 = 1.0 + t * t * (1.5 * t - 2.5)
        w2 = 0.5 * t * (1.0 + t * (4.0 - 3.0 * t))
        w3 = 0.5 * t * t * (t - 1.0)
        for c in range(columns):
            b = c + int(whole)
            i0 = min(max(b - 1, 0), columns - 1)
            i1 = min(max(b, 0), columns - 1)
            i2 = min(max(b + 1, 0), columns - 1)
            i3 = min(max(b + 2, 0), columns - 1)
            value = w0 * light[r, i0] + w1 * light[r, i1] + w2 * light[r, i2] + w3 * light[r, i3]
            out[r, c] = max(value, 0.0)

"""The compiled kernels of the sensor. This module imports numba; import it inside functions."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit
from turnscan.simulate._random import mix, normal, normal_tables, uniform_pair
from turnscan.simulate._sensor import Sensor

Charges = npt.NDArray[np.float32]

_SPREADS = 200


def raw(
    light: Charges, sensor: Sensor, shot: np.uint64, silicon: np.uint64, seconds: float
) -> npt.NDArray[np.uint16]:
    """(H, W) expected electrons → (H, W) converter steps, before any processing."""
    centre, tail = normal_tables()
    dark = sensor.dark_current * seconds
    charge = np.empty_like(light)
    if sensor.prnu > 0.0:
        light = light * response_map(light.shape, sensor.prnu, int(silicon))
    excess = _collect(light, charge, dark, shot, sensor.full_well, centre, tail)
    if excess and sensor.bloom == "column":
        _bloom_columns(charge, sensor.full_well, 1.0 - sensor.anti_bloom)
    elif excess and sensor.bloom == "blob":
        _bloom_around(charge, sensor.full_well, 1.0 - sensor.anti_bloom)
    steps = np.empty(light.shape, np.uint16)
    top = sensor.converter_levels - 1
    _convert(
        charge, steps, sensor.full_well, sensor.gain, sensor.read_noise, sensor.black, top,
        shot, centre, tail,
    )  # fmt: skip
    return steps


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


@njit(cache=True, nogil=True, inline="always")
def poisson(mean: float, u: float, centre: Floats, tail: Floats) -> float:
    """A Poisson number from one uniform number u in (0, 1).

    Exact (inversion) for small means. Above, the Cornish-Fisher expansion with Sheppard's
    correction for the rounding; its mean and variance are right to 1e-3 from 16 on.
    """
    if mean <= 0.0:
        return 0.0
    if mean < 16.0:
        p = math.exp(-mean)
        total = p
        k = 0
        while u > total and k < 100:
            k += 1
            p *= mean / k
            total += p
        return float(k)
    z = normal(u, centre, tail)
    s = math.sqrt(mean - 1.0 / 12.0)
    x = mean + s * z + (z * z - 1.0) / 6.0 + (z - z * z * z) / (72.0 * s)
    return max(math.floor(x + 0.5), 0.0)


@njit(cache=True, nogil=True)
def _response(out: Charges, prnu: float, silicon: np.uint64, centre: Floats, tail: Floats) -> None:
    target = out.ravel()
    for i in range(target.size):
        u, _ = uniform_pair(mix(silicon, np.uint64(i)))
        target[i] = max(1.0 + prnu * normal(u, centre, tail), 0.0)


@njit(cache=True, nogil=True)
def _collect(
    light: Charges,
    charge: Charges,
    dark: float,
    seed: np.uint64,
    full_well: float,
    centre: Floats,
    tail: Floats,
) -> bool:
    """Draw the electrons of every pixel; True when any pixel holds more than its full well."""
    source = light.ravel()
    target = charge.ravel()
    excess = False
    for i in range(source.size):
        u, _ = uniform_pair(mix(seed, np.uint64(i)))
        drawn = poisson(float(source[i]) + dark, u, centre, tail)
        excess |= drawn > full_well
        target[i] = drawn
    return excess


@njit(cache=True, nogil=True)
def _convert(
    charge: Charges,
    steps: npt.NDArray[np.uint16],
    full_well: float,
    gain: float,
    read_noise: float,
    black: float,
    top: int,
    seed: np.uint64,
    centre: Floats,
    tail: Floats,
) -> None:
    """Full well, read noise, gain, black level, converter."""
    source = charge.ravel()
    target = steps.ravel()
    for i in range(source.size):
        _, u = uniform_pair(mix(seed, np.uint64(i)))
        volts = min(float(source[i]), full_well) + read_noise * normal(u, centre, tail)
        value = math.floor(volts / gain + black + 0.5)
        target[i] = np.uint16(min(max(value, 0.0), float(top)))


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

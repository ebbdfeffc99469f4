"""Experiments on the sensor and the speckle whose outcome is known from theory.

Tests hold them to their tolerances and `bench/simulator.py` prints them, so both say the same.
Every experiment is a function of its seed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.simulate._airy import Grain, Singles
from turnscan.simulate._exposure import expose
from turnscan.simulate._sensor import Sensor
from turnscan.simulate._speckle import (
    cell_keys,
    oversampling,
    pair_covariance,
    speckled,
)

_TILT = np.array([[0.762, -0.424, 0.489], [0.605, 0.742, -0.290], [-0.240, 0.517, 0.822]])
"""How the object's axes lie to the picture: oblique, as on any real object."""


def flat_picture(
    shape: tuple[int, int],
    grain: Grain,
    seed: int,
    energy: Singles | None = None,
    *,
    contrast: float = 1.0,
    shift: float = 0.0,
    per_grain: int = 2,
) -> Singles:
    """A flat surface parallel to the sensor, moved by ``shift`` pixel widths: electrons (H, W).

    ``energy`` (H·oy, W·ox) per cell; without it, one electron per pixel everywhere.
    """
    H, W = shape
    oy, ox = oversampling(grain, per_grain)
    y, x = cell_places(shape, (oy, ox))
    # In pixel widths: a pixel is as tall as makes the grain round.
    flat = np.zeros((H * oy, W * ox, 3))
    flat[..., 0] = x - shift
    flat[..., 1] = (y * (grain[1] / grain[0]))[:, None]
    keys = cell_keys(flat @ np.linalg.qr(_TILT)[0].T + 0.123, 0.5 * grain[1])
    sheet = np.full((H * oy, W * ox), 1.0 / (oy * ox)) if energy is None else energy
    places = np.stack(np.divmod(np.arange(H * W), W), axis=-1)
    return speckled(
        places,
        _by_pixel(sheet, oy, ox),
        _by_pixel(keys, oy, ox),
        shape,
        grain,
        seed,
        contrast=contrast,
    )


def cell_places(shape: tuple[int, int], cells: tuple[int, int]) -> tuple[Floats, Floats]:
    """Row (H·oy,) and column (W·ox,) of the cells' middles, pixels."""
    y, x = ((np.arange(n * k) + 0.5) / k - 0.5 for n, k in zip(shape, cells, strict=True))
    return y, x


def _by_pixel(sheet: npt.NDArray[np.generic], oy: int, ox: int) -> npt.NDArray[np.generic]:
    H, W = sheet.shape[0] // oy, sheet.shape[1] // ox
    return np.asarray(sheet.reshape(H, oy, W, ox).swapaxes(1, 2).reshape(H * W, oy, ox))


def measured_contrast(grain: Grain, seed: int, size: int = 256, contrast: float = 1.0) -> float:
    """Standard deviation over mean of the pixels of an evenly lit surface."""
    picture = flat_picture((size, size), grain, seed, contrast=contrast)[8:-8, 8:-8]
    return float(picture.std() / picture.mean())


def line_error(grain: Grain, width: float, seed: int, rows: int, binned: int = 1) -> float:
    """rms error of the centre of gravity of a line of rms ``width`` px, ``binned`` rows as one."""
    columns = 2 * math.ceil(10 * width) + 1
    shape = (rows, columns)
    cells = oversampling(grain)
    _, x = cell_places(shape, cells)
    profile = np.exp(-((x - columns // 2) ** 2) / (2 * width**2))
    sheet = np.broadcast_to(profile, (rows * cells[0], len(x))).astype(np.float32)
    picture = flat_picture(shape, grain, seed, sheet)
    strips = picture.reshape(-1, binned, columns).sum(axis=1).astype(np.float64)
    centre = (strips @ np.arange(columns)) / strips.sum(axis=1) - columns // 2
    return float(np.sqrt(np.mean(centre**2)))


def line_error_theory(grain: float, width: float, rows: int = 1) -> float:
    """The same from K = A_c / √(p² + (1.18 λN')²), A_c = 4/π (λN')², error √(K σ / (4√π)), px."""
    K = 4 / math.pi * grain**2 / math.hypot(rows, 1.18 * grain)
    return math.sqrt(K * width / (4 * math.sqrt(math.pi)))


def spot_error(
    grain: float, width: float, seed: int, across: int = 16, contrast: float = 1.0
) -> float:
    """rms error of the centre of gravity of ``across``² round spots of rms ``width`` px."""
    pitch = 2 * math.ceil(6 * width)
    shape = (across * pitch, across * pitch)
    cells = oversampling((grain, grain))
    y, x = (np.mod(p + 0.5, pitch) - pitch / 2 for p in cell_places(shape, cells))
    sheet = np.exp(-(y[:, None] ** 2 + x[None, :] ** 2) / (2 * width**2)).astype(np.float32)
    picture = flat_picture(shape, (grain, grain), seed, sheet, contrast=contrast)
    spots = picture.reshape(across, pitch, across, pitch).swapaxes(1, 2).astype(np.float64)
    place = np.arange(pitch) - (pitch - 1) / 2
    total = spots.sum(axis=(2, 3))
    errors = [np.einsum("abyx,x->ab", spots, place), np.einsum("abyx,y->ab", spots, place)]
    return float(np.sqrt(np.mean([(e / total) ** 2 for e in errors])))


def spot_error_theory(grain: float) -> float:
    """λN'/(√2 π): whatever the size of the spot, px."""
    return grain / (math.sqrt(2) * math.pi)


def motion_correlation(grain: float, grains: float, seed: int, size: int = 256) -> float:
    """Correlation of two pictures between which the surface moved by ``grains`` times λN'/m."""
    g = (grain, grain)
    before, after = (
        flat_picture((size, size), g, seed, shift=s * grain, per_grain=4)[8:-8, 8:-8].ravel()
        for s in (0.0, grains)
    )
    return float(np.corrcoef(before, after)[0, 1])


def motion_theory(grain: float, grains: float) -> float:
    """The same from the lens: covariance of two pixels that far apart over a pixel's variance."""
    g = (grain, grain)
    return pair_covariance(g, 0.0, grains * grain) / pair_covariance(g, 0.0, 0.0)


def photon_transfer(sensor: Sensor, seed: int, size: int = 400) -> tuple[float, float]:
    """(electrons per grey level, read noise in electrons) from the variance of even pictures.

    Two pictures at each of twelve levels; the variance of their difference has no fixed pattern.
    Weighted straight line variance = mean/gain + read² / gain² + 1/12.
    """
    levels = np.concatenate([[0.0], np.geomspace(0.002, 0.7, 11) * sensor.saturation])
    mean, variance = np.empty(len(levels)), np.empty(len(levels))
    for k, level in enumerate(levels):
        light = np.full((size, size), level, np.float32)
        a, b = (expose(light, sensor, seed + 2 * k + i).astype(np.float64) for i in (0, 1))
        mean[k] = 0.5 * (a.mean() + b.mean()) - sensor.black
        variance[k] = 0.5 * (a - b).var()
    slope, offset = np.polyfit(mean, variance, 1, w=1.0 / variance)
    read = math.sqrt(max(offset - 1.0 / 12.0, 0.0)) / slope
    return float(1.0 / slope), float(read)


def fit_efficiency(sensor: Sensor, seed: int, rows: int = 20_000) -> tuple[float, float]:
    """(rms error of a noise-weighted Gaussian fit, Cramér-Rao bound), px.

    Rows of a stripe of σ = 2 px and 60 % of saturation, centres spread over a pixel. The bound
    knows shot, read and quantisation noise only, so the pixels are taken as equal.
    """
    sensor = replace(sensor, prnu=0.0)
    x = np.arange(-12.0, 13.0)
    peak, width, background = 0.6 * sensor.saturation, 2.0, 0.005 * sensor.saturation
    centre = np.linspace(-0.5, 0.5, rows)
    clean = background + peak * np.exp(-((x - centre[:, None]) ** 2) / (2 * width**2))
    picture = expose(clean, sensor, seed)
    signal = (picture.astype(np.float64) - sensor.black) * sensor.gain
    noise = sensor.read_noise**2 + sensor.gain**2 / 12
    # Fisher scoring on amplitude, centre, width and background, all rows at once.
    p = np.stack([np.full(rows, peak), centre, np.full(rows, width), np.full(rows, background)])
    for _ in range(6):
        model, J = _gaussian(x, p)
        weight = 1.0 / (model + noise)
        normal = np.einsum("ikr,kr,jkr->rij", J, weight, J)
        pull = np.einsum("ikr,kr,kr->ri", J, weight, signal.T - model)
        p = p + np.linalg.solve(normal, pull[..., None])[..., 0].T
    bound = np.sqrt(np.mean(np.linalg.inv(normal)[:, 1, 1]))
    return float(np.sqrt(np.mean((p[1] - centre) ** 2))), float(bound)


def _gaussian(x: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Model (k, rows) and its derivatives (4, k, rows)."""
    t = (x[:, None] - p[1]) / p[2]
    bell = np.exp(-0.5 * t**2)
    slope = p[0] * bell * t / p[2]
    model: Floats = p[3] + p[0] * bell
    return model, np.stack([bell, slope, slope * t, np.ones_like(bell)])

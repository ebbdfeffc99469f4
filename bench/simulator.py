"""The simulator's sensor and speckle: validation figures against theory, and frames per second."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from turnscan.simulate import _validate as validate
from turnscan.simulate import (
    ccd_1990s,
    cell_keys,
    cmos_imx264,
    contrast,
    expose,
    oversampling,
    path_phase,
    pixel_contrast,
    speckled,
    webcam,
)


def run() -> None:
    """Print both tables."""
    _validation()
    _speed()


def _line(what: str, measured: float, theory: float) -> None:
    print(f"{what:<58} {measured:9.4f} {theory:9.4f} {measured / theory:7.3f}")


def _validation() -> None:
    print(f"{'simulator: experiment':<58} {'measured':>9} {'theory':>9} {'ratio':>7}")
    for g in (0.24, 0.5, 1.0, 2.0):
        value = validate.measured_contrast((g, g), seed=1, size=384)
        _line(f"contrast of pixels, λN' = {g} px", value, pixel_contrast((g, g)))
    oblong = (0.289, 0.236)
    value = validate.measured_contrast(oblong, seed=1)
    _line("contrast of pixels 11 x 9 µm, λN' = 2.6 µm", value, pixel_contrast(oblong))
    for g in (0.6, 1.0):
        for patterns in (1, 2):
            value = validate.spot_error(g, 3.0, 4, 22, contrast(modes=patterns))
            theory = validate.spot_error_theory(g) / patterns**0.5
            _line(f"spot centroid, px, λN' = {g} px, {patterns} polarisation(s)", value, theory)
    for g, width, rows in ((0.236, 1.5, 1800), (0.448, 1.5, 3600), (1.087, 2.0, 9000)):
        for binned in (1, 3):
            value = validate.line_error((g, g), width, 5, rows, binned)
            theory = validate.line_error_theory(g, width, binned)
            _line(
                f"line centroid, px, λN' = {g} px, σ = {width} px, {binned} row(s)", value, theory
            )
    for grains in (0.25, 0.5, 1.0):
        value = validate.motion_correlation(2.0, grains, seed=1)
        _line(f"correlation after {grains} λN'/m", value, validate.motion_theory(2.0, grains))
    sensor = cmos_imx264()
    gain, read = validate.photon_transfer(sensor, seed=11)
    _line("photon transfer: e⁻ per grey level", gain, sensor.gain)
    _line("photon transfer: read noise, e⁻", read, sensor.read_noise)
    error, bound = validate.fit_efficiency(sensor, seed=5)
    _line("weighted Gaussian fit and Cramér-Rao bound, px", error, bound)


def _speed() -> None:
    print(f"\n{'simulator: one core':<58} {'ms':>9} {'per s':>9}")
    for name, sensor, shape in (
        ("expose 640 x 480, CCD", ccd_1990s(), (480, 640)),
        ("expose 1920 x 1080, webcam with Bayer and JPEG", webcam(), (1080, 1920)),
        ("expose 2448 x 2048, CMOS 12 bits", cmos_imx264(), (2048, 2448)),
    ):
        light = np.full(shape, 3.0, np.float32)
        light[:, 300:320] = 0.4 * sensor.saturation
        _time(name, partial(expose, light, sensor, 1, 0.02))
    for name, g, shape in (
        ("speckle, 480 rows x 24 px, λN' = 2.6 µm on 11 x 9 µm", (0.289, 0.236), (480, 640)),
        ("speckle, 2048 rows x 24 px, λN' = 1.087 px", (1.087, 1.087), (2048, 2448)),
    ):
        _time(name, _speckle_frame(g, shape))


def _speckle_frame(g: tuple[float, float], shape: tuple[int, int]) -> Callable[[], object]:
    """A slanted stripe 24 px wide on a surface seen obliquely, from points to picture."""
    row, column = (a.ravel() for a in np.mgrid[: shape[0], :24])
    cells = oversampling(g)
    y, x = (((np.arange(k) + 0.5) / k - 0.5) for k in cells)
    u = column[:, None, None] + x + 0 * y[:, None]
    v = row[:, None, None] + y[:, None] + 0 * x
    energy = (np.exp(-(((u - 12) / 2.8) ** 2)) * 5000 / len(y) / len(x)).astype(np.float32)
    points = np.stack([0.1 * u, 0.1 * v, 0.03 * u], axis=-1)
    where = np.stack([row, column + 200 + row // 16], axis=-1)
    laser, lens = (200.0, 0.0, 350.0), (0.0, 0.0, 400.0)

    def frame() -> object:
        keys = cell_keys(points, 0.012)
        phase = path_phase(points, 0.012, laser, lens, 633e-6)
        return speckled(where, energy, keys, shape, g, 1, phase=phase)

    return frame


def _time(name: str, work: Callable[[], object]) -> None:
    work()
    times = []
    for _ in range(7):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    best = min(times)
    print(f"{name:<58} {best * 1e3:9.1f} {1 / best:9.1f}")


if __name__ == "__main__":
    run()

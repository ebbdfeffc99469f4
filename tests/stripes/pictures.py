"""Pictures of stripes whose true centres are known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import erf

from turnscan.arrays import Floats

PEDESTAL = 100.0
"""Grey levels added before the picture is rounded, as a camera's black level does."""


def light(centre: Floats, sigma: float, peak: float, width: int) -> Floats:
    """(n, width) Gaussian stripes, integrated over each pixel; ``peak`` before integration."""
    d = np.arange(width) - centre[:, None]
    step = erf((d + 0.5) / (sigma * np.sqrt(2))) - erf((d - 0.5) / (sigma * np.sqrt(2)))
    return np.asarray(peak * sigma * np.sqrt(np.pi / 2) * step)


def picture(
    rng: np.random.Generator,
    electrons: Floats,
    read: float = 5.0,
    full: float | None = None,
) -> npt.NDArray[np.uint16]:
    """Shot noise, read noise, full well, black level, rounding; one electron per grey level."""
    seen = rng.poisson(electrons) + rng.normal(0.0, read, electrons.shape)
    if full is not None:
        seen = np.minimum(seen, full)
    return np.clip(np.round(seen + PEDESTAL), 0, 65535).astype(np.uint16)


def bound(sigma: float, peak: float, read: float, background: float = 0.0) -> float:
    """Cramér-Rao bound of the centre, px: shot and read noise, rounding, mean over the phase."""
    phases = np.linspace(-0.5, 0.5, 101)
    step = 1e-4
    middle = 50.0 + phases
    mean = light(middle, sigma, peak, 101)
    slope = (light(middle + step, sigma, peak, 101) - light(middle - step, sigma, peak, 101)) / (
        2 * step
    )
    variance = mean + background + read**2 + 1 / 12
    return float(np.mean(1 / np.sqrt((slope**2 / variance).sum(axis=1))))


def speckled(
    rng: np.random.Generator, grain: float, sigma: float, rows: int, width: int = 61, fine: int = 8
) -> tuple[Floats, float]:
    """Fully developed speckle on a stripe by wave optics: (rows, width) of mean 1, true centre.

    A random phase screen lit by the Gaussian line, seen through a round pupil whose speckle grain
    (wavelength · f-number) is ``grain`` px, intensity averaged over each pixel.
    """
    ny, nx = rows * fine, width * fine
    fy, fx = np.fft.fftfreq(ny, 1 / fine)[:, None], np.fft.fftfreq(nx, 1 / fine)
    pupil = np.hypot(fy, fx) <= 1 / (2 * grain)
    x = (np.arange(nx) + 0.5) / fine - 0.5
    centre = width // 2
    screen = rng.normal(size=(ny, nx)) + 1j * rng.normal(size=(ny, nx))
    field = np.fft.ifft2(
        np.fft.fft2(screen * np.exp(-((x - centre) ** 2) / (4 * sigma**2))) * pupil
    )
    intensity = (np.abs(field) ** 2).reshape(rows, fine, width, fine).mean(axis=(1, 3))
    return intensity / intensity.mean(), float(centre)

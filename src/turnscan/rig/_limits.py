"""What physics lets a stripe be located to: photons, read-out, speckle, depth of field.

Lengths on the sensor in mm unless a name says pixels. ``blur`` is λN′, the wavelength times the
working f-number N′ = N(1 + m): the size of a speckle on the sensor.
"""

from __future__ import annotations

import numpy as np


def photon_bound(sigma: float, electrons: float) -> float:
    """Cramér-Rao bound of a Gaussian stripe's centre from shot noise alone: σ/√N, pixels.

    ``sigma`` is its rms width in pixels, ``electrons`` its peak A; N = A σ √(2π) is the whole row.
    """
    return float(sigma / np.sqrt(electrons * sigma * np.sqrt(2 * np.pi)))


def readout_bound(sigma: float, electrons: float, read_noise: float) -> float:
    """Cramér-Rao bound from read noise r (electrons) alone: (r/A) √(2σ/√π), pixels."""
    return float(read_noise / electrons * np.sqrt(2 * sigma / np.sqrt(np.pi)))


def dorsch_limit(contrast: float, wavelength: float, sine: float, theta: float) -> float:
    """Speckle limit of a spot's depth, Dorsch, Häusler and Herrmann (1994): C λ/(2π sin u sin θ).

    ``sine`` is sin u of the observing aperture seen from the object; mm when λ is in mm. It does
    not depend on the spot's size. With the rms conventions of `line_speckle` a two-dimensional
    spot comes out √2 smaller.
    """
    return float(contrast * wavelength / (2 * np.pi * sine * np.sin(theta)))


def line_speckle(contrast: float, blur: float, sigma: float, row_height: float) -> float:
    """Speckle limit of a laser line's centre in one row: C √(K σ / (4√π)), mm on the sensor.

    K = A / √(p² + (1.18 λN′)²) with the speckle's area A = (4/π)(λN′)² (circular pupil), σ the
    line's rms width and p the height of the row; for n rows averaged put n p. It agrees with wave
    simulation within 8 % for the centre of gravity over the whole line; a window of ±2.5 σ
    costs 10 to 25 % more.
    """
    area = 4 / np.pi * blur**2
    K = area / np.hypot(row_height, 1.18 * blur)
    return float(contrast * np.sqrt(K * sigma / (4 * np.sqrt(np.pi))))


def pixel_speckle_contrast(blur: float, pixel_width: float, pixel_height: float) -> float:
    """Contrast of fully developed speckle after a pixel's aperture has averaged it, 0 to 1.

    C² = A ∫∫ H(λN′ν) sinc²(w ν_x) sinc²(h ν_y) d²ν, where H is the transfer function of a
    circular pupil (the spectrum of its speckle) and A = (4/π)(λN′)². Midpoint rule over one
    quadrant; pixels of more than 90 speckles across hold so many that C² = A/(w h).
    """
    across = max(pixel_width, pixel_height) / blur
    if across > 90:
        return float(np.sqrt(4 / np.pi * blur**2 / (pixel_width * pixel_height)))
    cells = int(64 + 16 * across)
    middles = (np.arange(cells) + 0.5) / cells
    radius, angle = middles[:, None], middles * np.pi / 2
    transfer = 2 / np.pi * (np.arccos(radius) - radius * np.sqrt(1 - radius**2))
    nu_x, nu_y = radius * np.cos(angle) / blur, radius * np.sin(angle) / blur
    aperture = np.sinc(pixel_width * nu_x) ** 2 * np.sinc(pixel_height * nu_y) ** 2
    mean = float((transfer * radius * aperture).mean())
    return float(np.sqrt(8 * mean))


def depth_of_field(f_number: float, pixel: float, magnification: float) -> float:
    """Half the depth over which defocus blurs by no more than one pixel: N ε (1+m)/m², mm."""
    return f_number * pixel * (1 + magnification) / magnification**2

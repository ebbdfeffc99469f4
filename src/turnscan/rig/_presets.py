"""Ready designs, by name."""

from __future__ import annotations

import math

from turnscan.errors import InputError
from turnscan.rig._design import Design


def _modern() -> Design:
    return Design(
        theta=math.radians(30),
        distance=400.0,
        focal=16.0,
        pixel_width=3.45e-3,
        pixel_height=3.45e-3,
        columns=2448,
        rows=2048,
        step=math.radians(0.225),
        f_number=8.0,
        wavelength=450e-6,
        stripe_sigma=2.0,
        electrons=8000.0,
        read_noise=3.0,
    )


def _paper() -> Design:
    return Design(
        theta=math.radians(22.4),
        distance=500.0,
        focal=12.5,
        pixel_width=11e-3,
        pixel_height=9e-3,
        columns=640,
        rows=480,
        step=math.radians(1.8),
        f_number=4.0,
        wavelength=632.8e-6,
        stripe_sigma=1.5,
        electrons=20_000.0,
        read_noise=100.0,
    )


def _ciclop() -> Design:
    return Design(
        theta=math.radians(30),
        distance=300.0,
        focal=4.0,
        pixel_width=2.8e-3,
        pixel_height=2.8e-3,
        columns=960,
        rows=1280,
        step=math.radians(0.45),
        f_number=2.8,
        wavelength=650e-6,
        stripe_sigma=2.5,
        electrons=5000.0,
        read_noise=10.0,
    )


_PRESETS = {"paper": _paper, "modern": _modern, "ciclop": _ciclop}
PRESET_NAMES: tuple[str, ...] = tuple(_PRESETS)
"""Names that `design_preset` knows."""


def design_preset(name: str) -> Design:
    """A ready design.

    ``paper``: the seed paper's rig at θ = 22.4° (its lens aperture, stripe and noise are assumed).
    ``modern``: a 5 megapixel industrial camera, blue laser, fine steps. ``ciclop``: a webcam on its
    side with a red line laser, as in printed desktop scanners (typical values).

    Raises InputError for another name.
    """
    if name not in _PRESETS:
        raise InputError(f"no preset {name!r}", hint=f"take one of {', '.join(_PRESETS)}")
    return _PRESETS[name]()

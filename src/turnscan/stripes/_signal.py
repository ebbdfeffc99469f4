"""Signal: the one grey picture that the stripe is sought in, and the units it has."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Image
from turnscan.stripes._colour import UINT16_SCALE, Weights, project_colour
from turnscan.stripes._detect import detect
from turnscan.stripes._settings import StripeSettings
from turnscan.stripes._stripe import Stripe


@dataclass(frozen=True)
class Signal:
    """Finds stripes in the frames of a scan, grey or colour, with settings in grey levels.

    Colour pictures are projected to 16 bits, so that weighing the channels rounds nothing away;
    settings are carried over to those finer levels, and amplitudes back.
    """

    weights: Weights | None
    """The signal is weights · (red, green, blue); None for grey pictures."""
    dtype: Literal["uint8", "uint16"] = "uint8"
    """Type of the pictures' pixels."""

    def project(self, rgb: Image) -> Image:
        """Colour pixels (H, W, 3) → the picture (H, W) that `detect` wants."""
        assert self.weights is not None
        return project_colour(rgb, self.weights, np.uint16)

    @property
    def gain(self) -> float:
        """Levels of the projected picture in one grey level of the signal."""
        if self.weights is None:
            return 1.0
        span = sum(abs(w) for w in self.weights)
        return (UINT16_SCALE if self.dtype == "uint8" else 1.0) / span

    @property
    def _black(self) -> float:
        """The projected level of a signal of 0: negative weights shift it up."""
        down = 0.0 if self.weights is None else -sum(w for w in self.weights if w < 0)
        return down * float(np.iinfo(self.dtype).max) * self.gain

    def detect(
        self,
        lit: Image,
        dark: Image | None,
        settings: StripeSettings,
        level: float = math.nan,
        noise: float = math.nan,
    ) -> Stripe:
        """Find the stripe in projected pictures (H, W).

        ``level`` and ``noise`` of the signal over the whole picture, in levels of the projected
        picture, are given where they are known (a sparse frame no longer shows them). Raises
        InputError like `detect`.
        """
        gain = self.gain
        black = self._black if dark is None else 0.0
        known = None if math.isnan(noise) else (level + black, noise)
        scaled = replace(
            settings,
            background=known,
            threshold=None if settings.threshold is None else settings.threshold * gain,
            read_noise=None if settings.read_noise is None else settings.read_noise * gain,
            saturation=None if settings.saturation is None else settings.saturation * gain,
            quantisation=settings.quantisation * gain,
            electrons_per_dn=None
            if settings.electrons_per_dn is None
            else settings.electrons_per_dn / gain,
        )
        stripe = detect(lit, dark, scaled)
        return stripe if gain == 1.0 else replace(stripe, amplitude=stripe.amplitude / gain)

"""Signal: the one grey picture that the stripe is sought in, and the units it has."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Image
from turnscan.stripes._colour import UINT16_SCALE, Weights, project_colour
from turnscan.stripes._detect import choose, find_candidates
from turnscan.stripes._settings import StripeSettings
from turnscan.stripes._stripe import Candidates, Stripe, StripeFlag


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
        inside: Bools | None = None,
    ) -> Stripe:
        """Find the stripe in projected pictures (H, W).

        ``level`` and ``noise`` of the signal over the whole picture, in levels of the projected
        picture, are given where they are known (a sparse frame no longer shows them). ``inside``
        (H, W) is True where a stripe counts; make ``settings.mask`` wider than that, so that the
        cut flank of a bright line out there is not taken for a stripe in here.
        Raises InputError like `find_candidates`.
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
        found = find_candidates(lit, dark, scaled)
        stripe = choose(found if inside is None else restrict(found, inside), scaled)
        return stripe if gain == 1.0 else replace(stripe, amplitude=stripe.amplitude / gain)


def restrict(candidates: Candidates, inside: Bools) -> Candidates:
    """The candidates at pixels where ``inside`` (H, W) is True; lines that lose all are OUTSIDE."""
    c = candidates
    picture = inside if c.orientation == "vertical" else inside.T
    line = np.arange(len(c.position))[:, None]
    there = ~np.isnan(c.position)
    pixel = np.clip(np.rint(np.where(there, c.position, 0.0)), 0, picture.shape[1] - 1)
    keep = there & picture[line, pixel.astype(np.intp)]
    order = np.argsort(~keep, axis=1, kind="stable")

    def kept(values: Floats) -> Floats:
        return np.take_along_axis(np.where(keep, values, np.nan), order, axis=1)

    flags = np.take_along_axis(np.where(keep, c.flags, 0), order, axis=1)
    lost = ~keep.any(axis=1)
    flags[lost, 0] = np.where(there[lost].any(axis=1), StripeFlag.OUTSIDE, c.flags[lost, 0])
    return Candidates(
        kept(c.position),
        kept(c.sigma),
        kept(c.amplitude),
        kept(c.width),
        flags.astype(np.uint16),
        c.orientation,
    )

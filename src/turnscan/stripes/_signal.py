"""Signal: the one grey picture that the stripe is searched in, and the units it has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, ColourWeights, Image
from turnscan.errors import InputError
from turnscan.stripes._colour import UINT16_SCALE, project_colour
from turnscan.stripes._detect import choose, find_candidates, light, readable
from turnscan.stripes._fuse import fuse_exposures
from turnscan.stripes._light import Light
from turnscan.stripes._settings import StripeSettings
from turnscan.stripes._stripe import Candidates, Stripe

_COUNTS = 0.3
"""A colour channel of at least this part of the largest weight clips the signal when it clips."""
_FULL_WELL = 10_000.0
"""Electrons at the top of the scale where unknown; it only weighs exposures."""
_FINE = 60_000.0
"""Levels of a fused picture that the range of its shortest exposure is spread over."""


@dataclass(frozen=True)
class Exposed:
    """One exposure of a bracket."""

    lit: Image
    """(H, W) or (H, W, 3), as the camera gave it."""
    dark: Image | None
    """The same without the laser, or None."""
    light: float
    """How much light it gathered: s × gain."""
    level: float
    """Grey levels: median of the signal over the whole picture."""
    noise: float
    """Grey levels: its robust standard deviation."""


Seen = TypeVar("Seen", Stripe, Candidates)


@dataclass(frozen=True)
class Signal:
    """Finds stripes in the frames of a scan, grey or colour, with settings in grey levels.

    Colour pictures are projected to 16 bits, so that weighing the channels rounds nothing away;
    settings are carried over to those finer levels, and amplitudes back.
    """

    weights: ColourWeights | None
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
    def black(self) -> float:
        """The projected level of a signal of 0: negative weights shift it up."""
        down = 0.0 if self.weights is None else -sum(w for w in self.weights if w < 0)
        return down * float(np.iinfo(self.dtype).max) * self.gain

    def in_levels(self, settings: StripeSettings) -> StripeSettings:
        """Settings in grey levels → in levels of the projected picture."""
        return _in_levels(settings, self.gain)

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
        return self._ready(lit, dark, settings, level, noise).stripe(inside)

    def detect_bracket(
        self,
        exposures: Sequence[Exposed],
        settings: StripeSettings,
        inside: Bools | None = None,
    ) -> Stripe:
        """Find the stripe in several exposures of one scene, fused (`fuse_exposures`).

        Where a long exposure clips the shorter ones count, elsewhere all do by what they know; only
        what clips in the shortest is saturated. Amplitudes are in grey levels of the shortest
        exposure, the threshold in those of the longest, which shows the dark parts.
        Raises InputError where the pictures do not fit or took the same light.
        """
        return self._fused(exposures, settings).stripe(inside)

    def candidates(
        self,
        exposures: Sequence[Exposed],
        settings: StripeSettings,
        inside: Bools | None = None,
    ) -> Candidates:
        """What `detect_bracket` chooses from, in one exposure or several. Raises like it."""
        return self._fused(exposures, settings).candidates(inside)

    def light(
        self,
        lit: Image,
        dark: Image | None,
        settings: StripeSettings,
        level: float = math.nan,
        noise: float = math.nan,
    ) -> Light:
        """The light that `detect` finds the stripe in. Raises like it."""
        return self._ready(lit, dark, settings, level, noise).light()

    def light_of_bracket(self, exposures: Sequence[Exposed], settings: StripeSettings) -> Light:
        """The light that `detect_bracket` finds the stripe in. Raises like it."""
        return self._fused(exposures, settings).light()

    def _fused(self, exposures: Sequence[Exposed], settings: StripeSettings) -> _Ready:
        if len(exposures) == 1:  # the others are missing
            return self._alone(exposures[0], settings)
        bracket = sorted(exposures, key=lambda e: e.light)
        full = float(np.iinfo(self.dtype).max)
        noise = max(e.noise for e in bracket)
        if math.isnan(noise):
            raise InputError("exposures of unknown noise cannot be fused")
        pedestal = 5.0 * noise  # noise below black counts too
        top = settings.saturation or full
        fine = _FINE / (full + pedestal)
        electrons = settings.electrons_per_dn or _FULL_WELL / full
        fused = fuse_exposures(
            [self._above_level(e, top, pedestal, fine) for e in bracket],
            [e.light for e in bracket],
            read_noise=noise * fine,
            electrons_per_dn=electrons / fine,
            black=pedestal * fine,
        )
        # Far from the stripe the exposures add up as if there were read noise alone.
        lights = np.array([e.light for e in bracket]) / bracket[0].light
        calm = noise * fine / math.sqrt(float((lights**2).sum()))
        step = fine / float(lights[-1])
        scaled = _in_levels(settings, fine)
        scaled = replace(
            scaled,
            background=(pedestal * fine, calm),
            threshold=None if settings.threshold is None else settings.threshold * step,
            read_noise=None,
            electrons_per_dn=None,
            saturation=float(np.iinfo(np.uint16).max),
            quantisation=settings.quantisation * step,
        )
        return _Ready(fused.image, None, scaled, fine)

    def _ready(
        self, lit: Image, dark: Image | None, settings: StripeSettings, level: float, noise: float
    ) -> _Ready:
        black = self.black if dark is None else 0.0
        known = None if math.isnan(noise) else (level + black, noise)
        scaled = self.in_levels(replace(settings, background=known))
        return _Ready(lit, dark, scaled, self.gain)

    def _alone(self, e: Exposed, settings: StripeSettings) -> _Ready:
        lit, dark = e.lit, e.dark
        if self.weights is not None:
            lit, dark = self.project(lit), None if dark is None else self.project(dark)
        return self._ready(lit, dark, settings, e.level * self.gain, e.noise * self.gain)

    def _above_level(
        self, e: Exposed, top: float, pedestal: float, fine: float
    ) -> npt.NDArray[np.uint16]:
        """An exposure as signal above its own background, clipped pixels at the very top."""
        if self.weights is None:
            clipped: Bools = np.asarray(e.lit >= top)
            signal = e.lit.astype(np.float32)
            if e.dark is not None:
                signal -= e.dark
        else:
            strong = np.abs(self.weights) > _COUNTS * max(abs(w) for w in self.weights)
            clipped = np.asarray((e.lit[..., strong] >= top).any(axis=-1))
            weights = np.array(self.weights, np.float32)
            dark = 0.0 if e.dark is None else e.dark.astype(np.float32)
            signal = np.asarray((e.lit - dark) @ weights, np.float32)
        signal += pedestal - e.level
        signal *= fine
        largest = np.iinfo(np.uint16).max
        out = np.clip(np.rint(signal), 0, largest - 1).astype(np.uint16)
        out[clipped] = largest
        return out


def _in_levels(settings: StripeSettings, gain: float) -> StripeSettings:
    """Settings in grey levels → in levels of a picture that has ``gain`` of them in each."""

    def scaled(value: float | None) -> float | None:
        return None if value is None else value * gain

    electrons = settings.electrons_per_dn
    return replace(
        settings,
        threshold=scaled(settings.threshold),
        read_noise=scaled(settings.read_noise),
        saturation=scaled(settings.saturation),
        quantisation=settings.quantisation * gain,
        electrons_per_dn=None if electrons is None else electrons / gain,
    )


@dataclass(frozen=True)
class _Ready:
    """One grey picture, and the settings in its levels."""

    lit: Image
    dark: Image | None
    settings: StripeSettings
    gain: float
    """Levels of the picture in one grey level of the signal."""

    def stripe(self, inside: Bools | None) -> Stripe:
        stripe = choose(self._found(inside), self.settings)
        return self._in_grey_levels(stripe)

    def candidates(self, inside: Bools | None) -> Candidates:
        return self._in_grey_levels(self._found(inside))

    def light(self) -> Light:
        return light(self.lit, self.dark, self.settings)

    def _found(self, inside: Bools | None) -> Candidates:
        found = find_candidates(self.lit, self.dark, self.settings)
        return found if inside is None else restrict(found, inside)

    def _in_grey_levels(self, found: Seen) -> Seen:
        if self.gain == 1.0:
            return found
        return replace(found, amplitude=found.amplitude / self.gain)


def restrict(candidates: Candidates, inside: Bools) -> Candidates:
    """The candidates at pixels where ``inside`` (H, W) is True, without the glow of the others.

    Lines that lose all are OUTSIDE. The places of the others are kept as ``beyond``, so that no
    stripe seems to end at the border.
    """
    from turnscan.stripes._choice import restrict_lines

    c = candidates
    table, bits = c.table(), c.flags.copy()
    beyond = np.empty(bits.shape)
    picture = readable(inside if c.orientation == "vertical" else inside.T)
    restrict_lines(table, bits, picture, beyond)
    return Candidates.made_of(table, bits, c.orientation, beyond)

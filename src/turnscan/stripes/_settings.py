"""StripeSettings: everything a user may choose about finding the stripe."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

import numpy as np

from turnscan.arrays import Bools, Image, frozen
from turnscan.errors import InputError
from turnscan.plugins import Plugin
from turnscan.stripes._installed import detector_names, installed_detector
from turnscan.stripes._stripe import Candidates, Orientation, Stripe

Strategy = Literal[
    "window",
    "maximum",
    "centroid",
    "median",
    "parabola",
    "gauss3",
    "squared",
    "blais-rioux",
]
"""How one centre is computed from the pixels of one candidate; see `StripeSettings.strategy`."""

Choice = Literal["brightest", "first", "last", "nearest"]
"""Which candidate of a line is the stripe; see `StripeSettings.choose`."""

Refinement = Literal["none", "auto", "spacetime"]
"""Whether centres are refined with the pictures around theirs; see `StripeSettings.refine`."""

MAX_CANDIDATES = 5


class Detector(Protocol):
    """A function that finds the laser's stripe in a picture, in place of turnscan's own.

    It may be called by several threads at once, and with pictures of any size.
    """

    def __call__(self, lit: Image, dark: Image, settings: StripeSettings) -> Stripe | Candidates:
        """Find one centre in each row, or several to choose from.

        Parameters
        ----------
        lit, dark
            (n, m) uint8 or uint16, read-only: the laser on and off. Rows run across the stripe,
            whichever way the camera lies. Where no stripe can be, both are equal; where there is no
            picture without the laser, ``dark`` is 0.
        settings
            What is known: ``background`` (level, noise) of lit − dark away from the stripe, and
            ``threshold``, what light lies above that level, are always numbers, in grey levels.

        Returns
        -------
        Stripe or Candidates
            Of n rows: centres in px along the row, NaN where there is none; sigma px, amplitude in
            grey levels above the background, rms width px, and bits of `StripeFlag`.
        """
        ...


@dataclass(frozen=True)
class StripeSettings:
    """How a stripe is found, measured and chosen.

    The defaults need no tuning: the threshold, the width and the noise are taken from the picture.
    """

    strategy: str | Detector | Plugin = "window"
    """window: centre of gravity in a symmetric window of ±2.5 rms widths that follows the centre,
    local background removed. The paper's three: maximum (middle of the plateau on ties), centroid
    (intensity-weighted over the run above threshold), median (the point that halves the energy of
    that run). parabola and gauss3 use three pixels (Naidu & Fisher 1991), squared weights by the
    squared intensity, blais-rioux is the zero crossing of their 8-pixel operator (1986).
    Another name is that of an installed `Detector`, which is loaded at once; or give a function."""
    choose: Choice = "brightest"
    """Among several candidates in a line: the brightest, the first or last along the line, or the
    one nearest to its neighbours in the adjacent lines (the cheapest path through the picture)."""
    refine: Refinement = "none"
    """spacetime: once all pictures of a scan are there, follow each surface element through them
    (`turnscan.points.refine`), and say so where the table's step does not allow it; auto: the same,
    but say nothing. It concerns scans, not single pictures."""
    threshold: float | None = None
    """Grey levels above the background; None takes it from the noise of the picture."""
    noise_factor: float = 7.0
    """Automatic threshold = this factor × the robust noise of the background."""
    background: tuple[float, float] | None = None
    """(level, noise) in grey levels of lit − dark (or of lit) away from the stripe, where they are
    known already, as they are for a frame of a scan file that no longer holds its background."""
    max_candidates: int = 3
    """Candidates kept in a line, 1 to 5; the brightest are kept."""
    orientation: Orientation = "vertical"
    """vertical: one centre per row; horizontal: one centre per column."""
    roi: tuple[int, int, int, int] | None = None
    """(u0, v0, u1, v1) px: only columns u0 ≤ u < u1 and rows v0 ≤ v < v1 are looked at."""
    mask: Bools | None = field(default=None, compare=False)
    """(H, W) True where to look; any shape of region."""
    width: float | None = None
    """px rms width of the stripe (not of its speckle), when known; None measures it."""
    read_noise: float | None = None
    """Grey levels, of one picture; None takes it from the background."""
    electrons_per_dn: float | None = None
    """Electrons per grey level, which gives the shot noise; None takes the noise on the stripe
    from the scatter of the centres along it."""
    quantisation: float = 1.0
    """Grey levels between two values that the camera can tell apart."""
    speckle_contrast: float = 0.0
    """Contrast of the speckle before pixels average it: 1 fully developed, 0.7 depolarised."""
    speckle_grain: float = 0.0
    """px, wavelength × f-number × (1 + magnification) on the sensor."""
    saturation: float | None = None
    """Grey level from which a pixel counts as clipped; None learns it from the picture."""

    def __post_init__(self) -> None:
        if isinstance(self.strategy, str) and self.strategy not in get_args(Strategy):
            known = (*get_args(Strategy), *detector_names())
            _one_of("strategy", self.strategy, known)
            object.__setattr__(self, "strategy", installed_detector(self.strategy))
        _one_of("choose", self.choose, get_args(Choice))
        _one_of("refine", self.refine, get_args(Refinement))
        _one_of("orientation", self.orientation, get_args(Orientation))
        if not 1 <= self.max_candidates <= MAX_CANDIDATES:
            raise InputError(
                f"max_candidates is {self.max_candidates}", hint=f"give 1 to {MAX_CANDIDATES}"
            )
        for name in ("threshold", "width", "electrons_per_dn", "saturation", "noise_factor"):
            _positive(name, getattr(self, name), zero=False)
        for name in ("read_noise", "quantisation", "speckle_contrast", "speckle_grain"):
            _positive(name, getattr(self, name), zero=True)
        if self.background is not None:
            level, noise = self.background
            if not math.isfinite(level):
                raise InputError(f"background level is {level}", hint="give a finite number")
            _positive("background noise", noise, zero=True)
        if self.roi is not None:
            u0, v0, u1, v1 = self.roi
            if not (0 <= u0 < u1 and 0 <= v0 < v1):
                raise InputError(
                    f"roi {self.roi} is empty", hint="give u0 < u1 and v0 < v1, all from 0"
                )
        if self.mask is not None:
            mask = frozen(self.mask, (None, None), "StripeSettings.mask", np.bool_)
            object.__setattr__(self, "mask", mask)


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise InputError(f"{name} is {value!r}", hint=f"give one of {', '.join(allowed)}")


def _positive(name: str, value: float | None, *, zero: bool) -> None:
    if value is None:
        return
    if not math.isfinite(value) or value < 0 or (value == 0 and not zero):
        raise InputError(f"{name} is {value}", hint=f"give a number {'≥' if zero else '>'} 0")

"""Examination: what pictures tell about camera, lasers and table."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from turnscan.acquire import Exposure, Hardware, Plan, Shooter
from turnscan.arrays import Floats, Image
from turnscan.errors import DeviceTimeout
from turnscan.scan import statistics
from turnscan.stripes import Signal, Stripe, StripeFlag, detect, learn_colour

Singles = npt.NDArray[np.float32]

DARKS = 8
_NUDGES = tuple(math.radians(a) for a in (3.0, 6.0, 9.0))
_BRIGHTER = 8.0
"""Times the exposure, to see the part without the laser."""
_LEAST_SHIFT = 0.03
"""px."""
_LOOKS_DEG = (-14.4, -7.2, -3.6, -1.8, -0.9, 0.0, 0.9, 1.8, 3.6, 7.2, 14.4)
_FAR = 20.0
_TELLING = 0.4
"""A view that differs by less than this share of the largest difference is the same view."""
_TURN_WITHIN_DEG = 2.0
"""A turn is seen no better than this."""


@dataclass(frozen=True)
class CameraFacts:
    """What dark pictures tell."""

    width: int
    height: int
    seconds: float
    gain: float
    """Both as read back; NaN where the camera does not tell."""
    level: float
    """Mean of a dark picture, as a share of the scale."""
    noise: float
    """Grey levels of one picture, robust."""
    flicker: float
    """rms change of the mean level from picture to picture, as a share of the scale."""


@dataclass(frozen=True)
class LaserFacts:
    """What a lit picture tells."""

    name: str
    found: float
    """Share of the image lines with a stripe."""
    column: float
    """px, median place of the stripe."""
    width: float
    """px rms, median."""
    peak: float
    """Median height of the stripe, as a share of the scale."""
    saturated: float
    """Share of the lines with a stripe that are clipped."""


class Examination:
    """Takes pictures for a doctor; lasers are lit for an exposure alone."""

    def __init__(self, hardware: Hardware, seconds: float, gain: float) -> None:
        self.hardware = hardware
        exposure = Exposure(seconds, gain)
        names = hardware.lasers.names
        self.plan = Plan(Fraction(0), 1, names, (exposure,))
        self.shooter = Shooter(self.plan, hardware)
        self.accepted = self.shooter.configure(exposure)
        self.weights: tuple[float, float, float] | None = None

    def picture(self, *lit: str) -> Image:
        """Raises DeviceTimeout where none comes."""
        picture, cause = self.shooter.picture(frozenset(lit))
        if picture is None:
            raise DeviceTimeout(f"camera: no picture ({cause})")
        return picture

    def camera(self) -> CameraFacts:
        """Look at dark pictures."""
        darks = [self.picture() for _ in range(DARKS)]
        top = float(np.iinfo(darks[0].dtype).max)
        means = np.array([d.mean() for d in darks]) / top
        pairs = pairwise(darks)
        noise = [statistics(_grey(b) - _grey(a)).noise for a, b in pairs]
        seconds, gain = self.accepted
        return CameraFacts(
            darks[0].shape[1], darks[0].shape[0], seconds, gain, float(means.mean()),
            float(np.median(noise)) / math.sqrt(2.0), float(means.std()),
        )  # fmt: skip

    def laser(self, name: str) -> LaserFacts:
        """Look at one laser."""
        dark, lit = self.picture(), self.picture(name)
        top = float(np.iinfo(lit.dtype).max)
        stripe = self._stripe(lit, dark)
        found = stripe.found
        if not found.any():
            return LaserFacts(name, 0.0, math.nan, math.nan, math.nan, 0.0)
        clipped = (stripe.flags[found] & int(StripeFlag.SATURATED)) != 0
        return LaserFacts(
            name,
            float(found.mean()),
            float(np.median(stripe.position[found])),
            float(np.median(stripe.width[found])),
            float(np.median(stripe.amplitude[found])) / top,
            float(clipped.mean()),
        )

    def turns_as_told(self) -> bool | None:
        """Whether the front of the part moves right when the angle grows; None where unseen."""
        import cv2

        usual = self.plan.exposures[0]
        bright = Exposure(min(_BRIGHTER * usual.seconds, 1.0), usual.gain)
        self.shooter.configure(bright)
        views = []
        for angle in (0.0, 0.0, *_NUDGES):
            self.hardware.turntable.move_to(angle, self.shooter.move_timeout)
            view = _grey(self.picture())
            middle = slice(view.shape[1] * 2 // 5, view.shape[1] * 3 // 5)
            views.append(np.ascontiguousarray(view[:, middle]))
        self.shooter.configure(usual)
        window = cv2.createHanningWindow(views[0].shape[::-1], cv2.CV_32F)
        shifts = [cv2.phaseCorrelate(a, b, window)[0][0] for a, b in pairwise(views)]
        still, moved = abs(shifts[0]), shifts[1:]
        # What does not turn (light, shadows, the silhouette) holds the shift back: only its sign
        # counts, if it is the same each time.
        if min(map(abs, moved)) < max(_LEAST_SHIFT, 4.0 * still):
            return None
        if all(m > 0 for m in moved):
            return True
        return False if all(m < 0 for m in moved) else None

    def full_turn(self, tick: Callable[[], None] = lambda: None) -> tuple[float, bool]:
        """Degrees told to the table for which the view comes round, NaN where none does.

        And whether views differ at all: a part that looks the same from everywhere tells nothing.
        """
        table, timeout = self.hardware.turntable, self.shooter.move_timeout
        laser = self.hardware.lasers.names[0]
        table.move_to(0.0, timeout)
        start, again = self._line(laser), self._line(laser)
        table.move_to(math.radians(345.0), timeout)
        told, apart = [], []
        for look in _LOOKS_DEG:
            table.move_to(math.radians(360.0 + look), timeout)
            told.append(360.0 + look)
            apart.append(_distance(self._line(laser), start))
            tick()
        most, least = max(apart), _distance(again, start)
        best = int(np.argmin(apart))
        if most < max(0.5, 5.0 * least):
            return math.nan, False
        if apart[best] - least > _TELLING * (most - least):
            return math.nan, True
        return (360.0 if abs(told[best] - 360.0) <= _TURN_WITHIN_DEG else told[best]), True

    def _line(self, laser: str) -> Floats:
        """Where the stripe is in each line, px."""
        return self._stripe(self.picture(laser), self.picture()).position

    def _stripe(self, lit: Image, dark: Image) -> Stripe:
        if lit.ndim == 2:
            return detect(lit, dark)
        if self.weights is None:
            red, green, blue = learn_colour(lit, dark)
            self.weights = (float(red), float(green), float(blue))
        signal = Signal(self.weights, "uint8" if lit.dtype == np.uint8 else "uint16")
        return detect(signal.project(lit), signal.project(dark))


def _distance(a: Floats, b: Floats) -> float:
    """px between two lines, on the mean; one that only one of them has counts as far."""
    both = ~np.isnan(a) & ~np.isnan(b)
    one = np.isnan(a) != np.isnan(b)
    if not (both | one).any():
        return 0.0
    apart = np.minimum(np.abs(a[both] - b[both]), _FAR)
    return float((apart.sum() + _FAR * one.sum()) / (both | one).sum())


def _grey(picture: Image) -> Singles:
    grey: Floats | Image = picture if picture.ndim == 2 else picture.mean(axis=2)
    return np.ascontiguousarray(grey, np.float32)

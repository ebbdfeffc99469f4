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
from turnscan.scanner._rotation_sense import VIEWS, OutlineTrack, drift, edges, sense
from turnscan.stripes import Signal, Stripe, StripeFlag, detect, learn_colour

Singles = npt.NDArray[np.float32]

DARKS = 8
_NUDGES_DEG = (3.0, 6.0, 9.0)
_BRIGHTER = 8.0
"""Times the exposure, to see the part without the laser."""
_LOOKS_DEG = (-14.4, -7.2, -3.6, -1.8, -0.9, 0.0, 0.9, 1.8, 3.6, 7.2, 14.4)
_FAR = 5.0
_SAME = 0.05
"""Share of the largest difference that is none."""
_TELLING = 0.4
"""A view that differs by less than this share of the largest difference is the same view."""
_PARTS = (2, 3, 5, 7)
"""A table that makes several turns of one shows the same view after one of these parts of it."""
_AGAIN = 1.5
"""Times the difference of two pictures of one view, up to which another view is the same."""
_SMOOTH = 0.2
"""Share of the largest difference by which views at nearly the same angle may differ."""
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


@dataclass(frozen=True)
class Turn:
    """What turning the table tells."""

    counter_clockwise: bool | None
    """Seen from above, when the commanded angle grows; None where it is not seen."""
    degrees: float
    """Commanded until the view comes round; NaN where none near 360° does."""
    telling: bool
    """Whether views differ: a part that looks the same from everywhere tells nothing."""


class Examination:
    """Takes pictures for a doctor; lasers are lit for an exposure alone."""

    def __init__(self, hardware: Hardware, seconds: float, gain: float) -> None:
        self.hardware = hardware
        exposure = Exposure(seconds, gain)
        names = hardware.lasers.names or ("none",)  # a camera alone: no picture is lit
        self.plan = Plan(Fraction(0), 1, names, (exposure,))
        self.shooter = Shooter(self.plan, hardware)
        self.accepted = self.shooter.configure(exposure)
        self.weights: tuple[float, float, float] | None = None
        self._is_round = False

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

    def turn(self, tick: Callable[[], None] = lambda: None) -> Turn:
        """Turn the table once, to parts of a turn, and a little beyond a whole one, and look on."""
        laser = self.hardware.lasers.names[0]
        self._turn_to(0.0)
        start, again = self._line(laser), self._line(laser)
        way = self._outlines(tick)
        stops = [360.0 / part for part in reversed(_PARTS)] + [360.0 + look for look in _LOOKS_DEG]
        apart = []
        for degrees in stops:
            self._turn_to(degrees)
            apart.append(_distance(self._line(laser), start))
            tick()
        degrees, telling = _comes_round(stops, apart, _distance(again, start))
        if self._is_round and (way is None or not telling):
            # Outlines of a part that is round and in the middle are alike but for their pixels.
            way = self._drifts(stops[-1])
        return Turn(way, degrees, telling)

    def _turn_to(self, degrees: float) -> None:
        self.hardware.turntable.move_to(math.radians(degrees), self.shooter.move_timeout)

    def _outlines(self, tick: Callable[[], None]) -> bool | None:
        """The direction of turning, from the part's outline as lasers and edges tell it."""
        lit: dict[str, list[Floats]] = {name: [] for name in self.hardware.lasers.names}
        bright = []
        for view in range(VIEWS):
            self._turn_to(360.0 * view / VIEWS)
            bright.append(self._bright())
            dark = self.picture()
            for name, lines in lit.items():
                lines.append(self._stripe(self.picture(name), dark).position)
            tick()
        left, right, axis = edges(bright)
        self._is_round = all(w.is_round for w in (left, right))
        by_laser = []
        for lines in lit.values():
            columns = np.stack(lines)
            if np.isfinite(columns).any():
                side = 1 if np.nanmedian(columns) > axis else -1
                by_laser.append(OutlineTrack(side * columns, side, False))
        both = {w.side for w in by_laser} == {-1, 1}
        return sense(by_laser if both else [*by_laser, left, right])

    def _bright(self) -> Image:
        """A picture without laser in which the part is seen."""
        usual = self.plan.exposures[0]
        self.shooter.configure(Exposure(min(_BRIGHTER * usual.seconds, 1.0), usual.gain))
        picture = self.picture()
        self.shooter.configure(usual)
        return picture

    def _drifts(self, start: float) -> bool | None:
        """Whether what is in front moves right, on a part that is as wide from all sides."""
        views = []
        for nudge in (0.0, 0.0, *_NUDGES_DEG):
            self._turn_to(start + nudge)
            view = _grey(self._bright())
            middle = slice(view.shape[1] * 2 // 5, view.shape[1] * 3 // 5)
            views.append(np.ascontiguousarray(view[:, middle]))
        return drift(views)

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


def _comes_round(stops: list[float], apart: list[float], least: float) -> tuple[float, bool]:
    """The stop, degrees, at which the view is that of the start again, and whether views show it.

    They do where the part is seen to differ from side to side, and comes round once: one that is
    the same after half of it, or a third, is symmetric, or turned by several turns.
    """
    views = dict(zip(stops, apart, strict=True))
    most = max(apart)
    if most < max(0.5, 5.0 * least):
        return math.nan, False
    near = {t: a for t, a in views.items() if abs(t - 360.0) <= _LOOKS_DEG[-1]}
    best = min(near, key=near.__getitem__)
    if near[best] - least > _TELLING * (max(near.values()) - least):
        return math.nan, True
    if any(a <= _AGAIN * max(least, near[best]) for t, a in views.items() if t not in near):
        return math.nan, False
    close = [a for t, a in near.items() if abs(t - best) <= _TURN_WITHIN_DEG]
    if max(close) - least > _SMOOTH * (most - least):
        return math.nan, True  # by chance: a table that turns much farther than it should
    # Where the part changes little near there, several views are as good as the best.
    alike = [t for t, a in near.items() if a <= near[best] + _SAME * max(near.values())]
    whole = min(alike) - _TURN_WITHIN_DEG <= 360.0 <= max(alike) + _TURN_WITHIN_DEG
    return (360.0 if whole else best), True


def _distance(a: Floats, b: Floats) -> float:
    """px between two lines, on the mean; where one of them has more, that counts as far.

    Single lines that are found now and then, at the edge of the noise, cancel out.
    """
    both = ~np.isnan(a) & ~np.isnan(b)
    more = abs(int(np.isfinite(a).sum()) - int(np.isfinite(b).sum()))
    if not both.any():
        return _FAR if more else 0.0
    apart = np.minimum(np.abs(a[both] - b[both]), _FAR)
    return float((apart.sum() + _FAR * more) / (both.sum() + more))


def _grey(picture: Image) -> Singles:
    grey: Floats | Image = picture if picture.ndim == 2 else picture.mean(axis=2)
    return np.ascontiguousarray(grey, np.float32)

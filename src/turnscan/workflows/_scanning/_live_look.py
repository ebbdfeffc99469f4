"""What is seen in a live picture: the stripe, and the points of a scan that is being taken."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from turnscan import points
from turnscan.arrays import Image
from turnscan.rig import Rig
from turnscan.stripes import Orientation, Signal, Stripe, StripeFlag, StripeSettings, detect


@dataclass(frozen=True, eq=False)
class SeenStripe:
    """The stripe of a live picture."""

    position: npt.NDArray[np.float32]
    """px across the stripe, one for each line; NaN where there is none; empty for no stripe."""
    saturated: float
    """Share of its lines that are clipped."""
    width: npt.NDArray[np.float32]
    """px rms of the light in each line, as ``position``: smallest where it is in focus."""
    signal: npt.NDArray[np.float32]
    """Grey levels of each line above the background."""


HISTOGRAM_BINS = 64


@dataclass(frozen=True, eq=False)
class PictureQuality:
    """What a live picture says of focus and exposure."""

    sharpness: float
    """Variance of the Laplacian over the squared mean grey level (Pech-Pacheco et al. 2000,
    doi:10.1109/ICPR.2000.903548, here free of the exposure): largest in focus, for one scene."""
    histogram: npt.NDArray[np.uint32]
    """Pixels in each of `HISTOGRAM_BINS` equal bins from black to the largest possible value."""
    clipped: float
    """Share of the pixels at the largest possible value."""


def picture_quality(picture: Image) -> PictureQuality:
    """Judge a picture of any kind; of a colour picture, each pixel's brightest channel."""
    flat = picture if picture.ndim == 2 else picture.max(axis=2)
    top = 255 if flat.dtype == np.uint8 else 65535
    counts, _ = np.histogram(flat, HISTOGRAM_BINS, (0, top + 1))
    grey = flat.astype(np.float32)
    bend = cv2.Laplacian(grey, cv2.CV_32F)
    mean = max(float(grey.mean()), 1.0)
    clipped = float(np.count_nonzero(flat == top) / flat.size)
    return PictureQuality(float(bend.var()) / mean**2, counts.astype(np.uint32), clipped)


def seen_stripe(
    lit: Image, dark: Image | None, orientation: Orientation = "vertical"
) -> SeenStripe:
    """The stripe of a picture of any kind; of a colour picture, its brightest channel."""
    return _seen(_stripe(lit, dark, orientation))


class GrowingScan:
    """Looks at the pictures of a scan that is being taken, one after the other."""

    def __init__(
        self,
        rig: Rig | None,
        orientation: Orientation,
        weights: tuple[float, float, float] | None,
    ) -> None:
        """``weights``: how much of red, green and blue is laser; None for grey pictures."""
        self._rig, self._orientation, self._weights = rig, orientation, weights

    def look(
        self, lit: Image, dark: Image | None, step: int, laser: str, angle: float
    ) -> tuple[SeenStripe, npt.NDArray[np.float32]]:
        """The stripe of a picture taken at a table angle (rad), and its points (m, 3) mm.

        There are none without a rig, and with several lasers lit. Raises TurnscanError where the
        picture is none of such a scan.
        """
        stripe = self._found(lit, dark)
        there: npt.NDArray[np.float32] = np.zeros((0, 3), np.float32)
        if self._rig is not None and any(s.name == laser for s in self._rig.sheets):
            grid = points.build_grid(self._rig, laser, [stripe], [step], [angle])
            kept = points.clip(grid, points.working_volume(self._rig, laser))
            there = kept.points[kept.found].astype(np.float32)
        return _seen(stripe), there

    def _found(self, lit: Image, dark: Image | None) -> Stripe:
        if self._weights is None or lit.ndim == 2:
            return _stripe(lit, dark, self._orientation)
        signal = Signal(self._weights, "uint8" if lit.dtype == np.uint8 else "uint16")
        flat = None if dark is None else signal.project(dark)
        return signal.detect(
            signal.project(lit), flat, StripeSettings(orientation=self._orientation)
        )


def _stripe(lit: Image, dark: Image | None, orientation: Orientation) -> Stripe:
    settings = StripeSettings(orientation=orientation)
    if lit.ndim == 2:
        return detect(lit, dark, settings)
    flat = None if dark is None else dark.max(axis=2)
    return detect(lit.max(axis=2), flat, settings)


def _seen(stripe: Stripe) -> SeenStripe:
    if not stripe.found.any():
        none = np.zeros(0, np.float32)
        return SeenStripe(none, 0.0, none, none)
    clipped = np.mean((stripe.flags[stripe.found] & int(StripeFlag.SATURATED)) != 0)
    return SeenStripe(
        stripe.position.astype(np.float32),
        float(clipped),
        stripe.width.astype(np.float32),
        stripe.amplitude.astype(np.float32),
    )

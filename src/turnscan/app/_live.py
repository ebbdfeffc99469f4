"""Live pictures and growing points: made beside the scan, so that it never waits for a browser."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from turnscan import points
from turnscan.app._encode_grid import eight_bits
from turnscan.app._hub import Hub
from turnscan.app._protocol import Points, Seen
from turnscan.arrays import Image
from turnscan.errors import TurnscanError
from turnscan.rig import Rig
from turnscan.stripes import Orientation, Signal, Stripe, StripeFlag, StripeSettings, detect

JPEG_QUALITY = 80
_WIDEST = 1280
"""px of a live picture; wider ones are sent smaller."""
_WAITING = 32
"""Pictures of a scan that wait for their turn; older ones are not shown."""


@dataclass(frozen=True)
class Taken:
    """A picture of a scan."""

    step: int
    laser: str
    angle: float
    """rad."""
    lit: Image
    dark: Image | None


def see(
    hub: Hub,
    number: int,
    picture: Image,
    lit: frozenset[str],
    stripe: Stripe | None,
    step: int | None = None,
    orientation: Orientation = "vertical",
) -> None:
    """Tell everybody a picture, and the stripe found in it, in pixels of the whole picture."""
    height, width = picture.shape[:2]
    shown = eight_bits(picture)
    if width > _WIDEST:
        size = (_WIDEST, round(height * _WIDEST / width))
        shown = cv2.resize(shown, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    page = shown if shown.ndim == 2 else shown[..., ::-1]
    done, data = cv2.imencode(".jpg", page, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        return
    place, clipped = np.zeros(0, np.float32), 0.0
    if stripe is not None and stripe.found.any():
        place = stripe.position.astype(np.float32)
        clipped = float(np.mean((stripe.flags[stripe.found] & int(StripeFlag.SATURATED)) != 0))
    message = Seen(
        number=number,
        width=width,
        height=height,
        orientation=orientation,
        lit=sorted(lit),
        step=step,
        saturated=clipped,
    )
    hub.tell(message, {"jpeg": np.asarray(data, np.uint8).ravel(), "stripe": place})


def stripe_of(lit: Image, dark: Image | None, orientation: Orientation = "vertical") -> Stripe:
    """The stripe of a picture of any kind; of a colour picture, its brightest channel."""
    settings = StripeSettings(orientation=orientation)
    if lit.ndim == 2:
        return detect(lit, dark, settings)
    flat = None if dark is None else dark.max(axis=2)
    return detect(lit.max(axis=2), flat, settings)


class Growing:
    """Turns the pictures of a scan into live pictures and points, in a thread of its own."""

    def __init__(self, hub: Hub, scan: str, rig: Rig | None, orientation: Orientation) -> None:
        self._hub, self._scan, self._rig, self._orientation = hub, scan, rig, orientation
        self._waiting: deque[Taken] = deque(maxlen=_WAITING)
        self._something = threading.Event()
        self._over = False
        self._number = 0
        self._weights: tuple[float, float, float] | None = None
        self._thread = threading.Thread(target=self._work, name="live", daemon=True)
        self._thread.start()

    def colour(self, weights: tuple[float, float, float] | None) -> None:
        """How much of red, green and blue is laser; None for grey pictures."""
        self._weights = weights

    def put(self, taken: Taken) -> None:
        """A picture has come; returns at once."""
        self._waiting.append(taken)
        self._something.set()

    def close(self) -> None:
        """Finish what is waiting."""
        self._over = True
        self._something.set()
        self._thread.join(5.0)

    def _work(self) -> None:
        while self._something.wait():
            self._something.clear()
            while self._waiting:
                self._show(self._waiting.popleft())
            if self._over:
                return

    def _show(self, t: Taken) -> None:
        try:
            stripe = self._stripe(t)
            self._number += 1
            lit = frozenset(t.laser.split("+"))
            see(self._hub, self._number, t.lit, lit, stripe, t.step, self._orientation)
            if self._rig is not None and any(s.name == t.laser for s in self._rig.sheets):
                grid = points.build_grid(self._rig, t.laser, [stripe], [t.step], [t.angle])
                kept = points.clip(grid, points.working_volume(self._rig, t.laser))
                found: npt.NDArray[np.float32] = kept.points[kept.found].astype(np.float32)
                if len(found):
                    message = Points(scan=self._scan, laser=t.laser, step=t.step)
                    self._hub.tell(message, {"points": found})
        except TurnscanError:
            return  # the scan itself says what is wrong with a picture

    def _stripe(self, t: Taken) -> Stripe:
        if self._weights is None or t.lit.ndim == 2:
            return stripe_of(t.lit, t.dark, self._orientation)
        signal = Signal(self._weights, "uint8" if t.lit.dtype == np.uint8 else "uint16")
        dark = None if t.dark is None else signal.project(t.dark)
        return signal.detect(
            signal.project(t.lit), dark, StripeSettings(orientation=self._orientation)
        )

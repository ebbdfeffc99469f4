"""Live pictures and growing points: made beside the scan, so that it never waits for a browser."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from turnscan.app._encode_picture import jpeg
from turnscan.app._envelope import Array
from turnscan.app._hub import Hub
from turnscan.app._protocol import Points, Seen
from turnscan.arrays import Floats, Image
from turnscan.errors import TurnscanError
from turnscan.workflows import GrowingScan, Orientation, SeenStripe, picture_quality

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


@dataclass(frozen=True)
class Board:
    """What a live picture shows of the board of a calibration."""

    corners: Floats
    """(n, 2) px."""
    failure: str
    """Why there are none."""
    view: int | None = None
    """The picture's number in the calibration, where it is part of it."""


def see(
    hub: Hub,
    number: int,
    picture: Image,
    lit: frozenset[str],
    stripe: SeenStripe | None,
    step: int | None = None,
    orientation: Orientation = "vertical",
    board: Board | None = None,
) -> None:
    """Tell everybody a picture, and what was found in it, in pixels of the whole picture."""
    data = jpeg(picture)
    if data is None:
        return
    quality = picture_quality(picture)
    message = Seen(
        number=number,
        width=picture.shape[1],
        height=picture.shape[0],
        orientation=orientation,
        lit=sorted(lit),
        step=step,
        view=None if board is None else board.view,
        failure="" if board is None else board.failure[:300],
        saturated=0.0 if stripe is None else stripe.saturated,
        sharpness=quality.sharpness,
        clipped=quality.clipped,
    )
    none = np.zeros(0, np.float32)
    arrays: dict[str, Array] = {
        "jpeg": data,
        "stripe": none if stripe is None else stripe.position,
        "stripe_width": none if stripe is None else stripe.width,
        "stripe_signal": none if stripe is None else stripe.signal,
        "corners": np.zeros((0, 2), np.float32)
        if board is None
        else board.corners.astype(np.float32),
        "histogram": quality.histogram,
    }
    hub.tell(message, arrays)


class Growing:
    """Turns the pictures of a scan into live pictures and points, in a thread of its own."""

    def __init__(self, hub: Hub, scan: str, looker: GrowingScan, orientation: Orientation) -> None:
        self._hub, self._scan, self._looker, self._orientation = hub, scan, looker, orientation
        self._waiting: deque[Taken] = deque(maxlen=_WAITING)
        self._something = threading.Event()
        self._over = False
        self._number = 0
        self._thread = threading.Thread(target=self._work, name="live", daemon=True)
        self._thread.start()

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
            stripe, found = self._looker.look(t.lit, t.dark, t.step, t.laser, t.angle)
        except TurnscanError:
            return  # the scan itself says what is wrong with a picture
        self._number += 1
        lit = frozenset(t.laser.split("+"))
        see(self._hub, self._number, t.lit, lit, stripe, t.step, self._orientation)
        if len(found):
            message = Points(scan=self._scan, laser=t.laser, step=t.step)
            self._hub.tell(message, {"points": found})

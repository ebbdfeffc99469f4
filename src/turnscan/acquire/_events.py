"""What happens during a scan, as values for whoever looks on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from turnscan.arrays import Image


@dataclass(frozen=True)
class Started:
    """The first move is about to begin."""

    steps: int
    """Of the whole scan."""
    remaining: int
    """Steps that something is to be taken at."""


@dataclass(frozen=True)
class Moving:
    """The table turns; the lasers are dark."""

    step: int
    angle: float
    """rad."""


@dataclass(frozen=True)
class Taken:
    """A picture has come; it is not stored yet."""

    step: int
    laser: str
    exposure: int
    lit: Image
    dark: Image | None


@dataclass(frozen=True)
class Stored:
    """A frame is on the disk."""

    step: int
    laser: str
    exposure: int


@dataclass(frozen=True)
class Missing:
    """There is no frame, which is recorded with its cause."""

    step: int
    laser: str
    exposure: int
    cause: str


@dataclass(frozen=True)
class StepDone:
    """All pictures of a step are taken."""

    step: int
    done: int
    """Steps of this run so far."""
    total: int
    """Steps of this run."""
    seconds_left: float


@dataclass(frozen=True)
class Paused:
    """Lasers dark, table at rest, until somebody goes on."""


@dataclass(frozen=True)
class WentOn:
    """The pause is over."""


@dataclass(frozen=True)
class Ended:
    """The lasers are dark and everything taken is stored."""

    complete: bool
    why: str
    """complete, aborted, or the error."""


Event = Started | Moving | Taken | Stored | Missing | StepDone | Paused | WentOn | Ended
Listener = Callable[[Event], None]
"""Called with one event at a time, from the thread of the run or the one that stores."""

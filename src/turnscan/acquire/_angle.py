"""Is the table still where the scan file says? A controller that restarted counts from zero."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

from turnscan.acquire._plan import Plan
from turnscan.devices import Turntable
from turnscan.errors import AngleLost, InputError
from turnscan.remedy import Option, Remedy
from turnscan.scan import Scan

_AGREES = math.radians(0.01)
_AHEAD = 3.25
"""Steps that the table may be ahead of the last frame stored: one is being stored, one waits, and
it is on the way to the next."""


@runtime_checkable
class Counting(Protocol):
    """A table whose controller counts steps from where it was switched on.

    A `turnscan.devices.Turntable` without these has an absolute angle: an encoder, a person with a
    scale, a simulation.
    """

    @property
    def angle(self) -> float:
        """rad, where the controller believes to be."""
        ...

    @property
    def remembers(self) -> bool:
        """Whether it has counted without a restart since it was last used."""
        ...


@runtime_checkable
class Noted(Protocol):
    """A table that knows whether its zero is still the one of an earlier time."""

    @property
    def counting(self) -> str:
        """Names the stretch in which its angles have had one and the same zero."""
        ...

    def still(self, counting: str) -> bool | None:
        """Whether they have the zero of that one; None where unknown."""
        ...


class Shifted:
    """A table whose zero is not that of the scan."""

    def __init__(self, turntable: Turntable, at: float) -> None:
        """``at``: rad, the angle of the scan at which the table stands at its own zero."""
        self._turntable = turntable
        self.at = at

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`."""
        wanted = angle - self.at
        reached = self._turntable.move_to(wanted, timeout)
        return angle if reached == wanted else reached + self.at

    def stop(self) -> None:
        """See `Turntable`."""
        self._turntable.stop()


def counting_of(turntable: Turntable) -> str:
    """What `check_angle` needs to know later; empty where the table does not tell."""
    return turntable.counting if isinstance(turntable, Noted) else ""


def check_angle(
    plan: Plan, scan: Scan, turntable: Turntable, counting: str = "", at: float = 0.0
) -> None:
    """Raise AngleLost where a counting table may not be where it says.

    ``counting`` is the table's own from the time of the scan; where it lasts the table is believed
    wherever it stands. Where nobody knows of it the table must stand between the last frame and
    the steps that may have followed, and one that counts zero is not believed: it may have
    restarted. ``at``: rad, the angle of the scan at the table's zero.
    """
    last = scan.last_angle
    if not isinstance(turntable, Counting) or math.isnan(last):
        return
    noted = isinstance(turntable, Noted)
    same = turntable.still(counting) if isinstance(turntable, Noted) else None
    if same:
        return
    there, step = turntable.angle + at, math.radians(abs(plan.step_deg))
    onwards = (there - last) * math.copysign(1.0, plan.step_deg)
    if alarm := getattr(turntable, "alarm", ""):
        said = str(alarm).partition(" → ")[0]
    elif not turntable.remembers or (not noted and abs(turntable.angle) < _AGREES):
        said = "it has restarted, counts from zero as after a restart, or was switched off since"
    elif same is False:
        said = "its zero was set again since"
    elif -_AGREES <= onwards <= _AHEAD * step + _AGREES:
        return
    else:
        said = f"{math.degrees(there):.3f}°"
    raise AngleLost(
        f"{scan.path}: the last frame was taken at {math.degrees(last):.3f}°; the controller of "
        f"the table says: {said}",
        hint=Remedy(
            "turn the table to a mark whose angle in this scan you know, and resume with ",
            Option("at_deg", "ANGLE"),
        ),
    )


def reindexed(turntable: Turntable, at: float) -> Shifted:
    """The table, of which a person says that it stands at ``at`` rad of the scan now.

    Raises InputError where that makes no sense because it does not count.
    """
    if not isinstance(turntable, Counting):
        raise InputError(
            "this table has an absolute angle, it needs no new one",
            hint=Remedy("leave out ", Option("at_deg")),
        )
    acknowledge = getattr(turntable, "acknowledge", None)
    if acknowledge is not None:
        acknowledge()
    return Shifted(turntable, at - turntable.angle)

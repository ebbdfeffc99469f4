"""Is the table still where the scan file says? A controller that restarted counts from zero."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

from turnscan.acquire._plan import Plan
from turnscan.devices import Turntable
from turnscan.errors import AngleLost, InputError
from turnscan.scan import Scan

_AGREES = math.radians(0.01)


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


class Shifted:
    """A table whose zero is not that of the scan."""

    def __init__(self, turntable: Turntable, at: float) -> None:
        """``at``: rad, the angle of the scan at which the table stands at its own zero."""
        self._turntable = turntable
        self._at = at

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`."""
        wanted = angle - self._at
        reached = self._turntable.move_to(wanted, timeout)
        return angle if reached == wanted else reached + self._at

    def stop(self) -> None:
        """See `Turntable`."""
        self._turntable.stop()


def check_angle(plan: Plan, scan: Scan, turntable: Turntable) -> None:
    """Raise AngleLost where a counting table is not between the last frame and the next step.

    One that counts zero may have restarted just as well, wherever it stands; it is not believed.
    """
    last = scan.last_angle
    if not isinstance(turntable, Counting) or math.isnan(last):
        return
    there, step = turntable.angle, math.radians(abs(plan.step_deg))
    onwards = (there - last) * math.copysign(1.0, plan.step_deg)
    if not turntable.remembers or abs(there) < _AGREES:
        said = "it has restarted, or counts zero as after a restart"
    elif -_AGREES <= onwards <= 1.25 * step + _AGREES:
        return
    else:
        said = f"{math.degrees(there):.3f}°"
    raise AngleLost(
        f"{scan.path}: the last frame was taken at {math.degrees(last):.3f}°; the controller of "
        f"the table says: {said}",
        hint="turn the table to a mark whose angle in this scan you know, and resume with "
        "--at-deg ANGLE",
    )


def reindexed(turntable: Turntable, at: float) -> Turntable:
    """The table, of which a person says that it stands at ``at`` rad of the scan now.

    Raises InputError where that makes no sense because it does not count.
    """
    if not isinstance(turntable, Counting):
        raise InputError(
            "this table has an absolute angle, it needs no new one", hint="leave out --at-deg"
        )
    acknowledge = getattr(turntable, "acknowledge", None)
    if acknowledge is not None:
        acknowledge()
    return Shifted(turntable, at - turntable.angle)

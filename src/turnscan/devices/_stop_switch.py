"""A stop switch: once pressed, nothing behind it lights or turns until it is released."""

from __future__ import annotations

import threading
from typing import Any

from turnscan.devices._protocols import Lasers, Turntable
from turnscan.errors import DeviceRefused, TurnscanError

_AGAIN = 0.3
"""s after which the table is stopped once more, where a move is still under way."""
_AGAIN_TIMES = 20
_PATIENCE = 5.0
"""s to wait for the end of an order to light that is under way."""


class StopSwitch:
    """Stands before lasers and turntable; `press` and `release` are for any thread.

    A check before each order would not do: an order that was checked may reach the board after the
    stop. So an order that was under way when the switch was pressed is followed by another stop.
    """

    def __init__(self, lasers: Lasers, turntable: Turntable) -> None:
        self._pressed = threading.Event()
        self._lighting, self._turning = threading.Lock(), threading.Lock()
        self._lasers, self._turntable = lasers, turntable
        self.lasers: Lasers = _facade(_StoppedLasers, lasers, self)
        """The lasers behind the switch."""
        self.turntable: Turntable = _facade(_StoppedTurntable, turntable, self)
        """The turntable behind the switch."""

    @property
    def pressed(self) -> bool:
        """Whether nothing may light or turn."""
        return self._pressed.is_set()

    def release(self) -> None:
        """Let lasers light and the table turn again."""
        self._pressed.clear()

    def press(self) -> None:
        """Lasers dark and the table at rest at once; what lights or turns later is refused.

        Raises DeviceError and SafetyError as both do, after both were asked.
        """
        self._pressed.set()
        errors: list[TurnscanError] = []
        late = self._lighting.locked()
        for act in (self._lasers.off, self._turntable.stop):
            try:
                act()
            except TurnscanError as e:
                errors.append(e)
        if late:  # whichever of the two the board heard first
            over = self._lighting.acquire(timeout=_PATIENCE)
            try:
                self._lasers.off()
            except TurnscanError as e:
                errors.append(e)
            finally:
                if over:
                    self._lighting.release()
        if self._turning.locked():
            threading.Thread(target=self._until_at_rest, daemon=True, name="stopping").start()
        if errors:
            raise errors[0]

    def _until_at_rest(self) -> None:
        for _ in range(_AGAIN_TIMES):
            if self._turning.acquire(timeout=_AGAIN):
                self._turning.release()
                return
            try:
                self._turntable.stop()
            except TurnscanError:
                return  # whoever turns it meets it, too

    def check(self) -> None:
        """Raise DeviceRefused where it is pressed."""
        if self.pressed:
            raise DeviceRefused(
                "stopped: no laser is lit and nothing turns until this task has ended",
                hint="start it again",
            )

    def light(self, lit: frozenset[str], lease: float) -> None:
        """See `Lasers`; dark is never refused."""
        if not lit:
            self._lasers.light(lit, lease)
            return
        with self._lighting:
            self.check()
            self._lasers.light(lit, lease)

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`."""
        with self._turning:
            self.check()
            return self._turntable.move_to(angle, timeout)


class _Facade:
    """What it does not do itself the device behind it does."""

    def __init__(self, device: Any, switch: StopSwitch) -> None:
        self._device, self._switch = device, switch

    def __getattr__(self, name: str) -> Any:
        if name == "_device":  # not made yet
            raise AttributeError(name)
        return getattr(self._device, name)


class _StoppedLasers(_Facade):
    def light(self, lit: frozenset[str], lease: float) -> None:
        self._switch.light(lit, lease)


class _StoppedTurntable(_Facade):
    def move_to(self, angle: float, timeout: float) -> float:
        return self._switch.move_to(angle, timeout)


def _facade(kind: type[_Facade], device: Any, switch: StopSwitch) -> Any:
    """A facade that has every public name of the device in its class.

    `isinstance` with a protocol looks for them there, and not where ``__getattr__`` would answer.
    """
    names = [n for n in dir(device) if not n.startswith("_") and not hasattr(kind, n)]
    whole = type(kind.__name__, (kind,), {n: _handed_on(n) for n in names})
    return whole(device, switch)


def _handed_on(name: str) -> property:
    return property(lambda self: getattr(self._device, name))

"""What every turntable driver must do, as a check that its author can run."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress

from turnscan.devices import Turntable
from turnscan.errors import DeviceError, InputError, TurnscanError

_LATE = 7.0
"""s beyond its time-out within which a move must be back."""


def check_turntable(
    opener: Callable[[], AbstractContextManager[Turntable]],
    *,
    microstep: float,
    timeout: float = 60.0,
    true_angle: Callable[[], float] | None = None,
) -> None:
    """Run a turntable driver through all that turnscan relies on. It turns a little over once.

    ``opener`` gives a context manager of the table, which stands anywhere; ``microstep`` is its
    resolution in rad; ``true_angle`` tells in rad where it really stands, where anybody knows.

    Checked are: opening moves nothing; the angle reached is told, within half a microstep of the
    one asked for; it comes back over a whole turn and by many small moves without an error that
    grows; angles that are none are refused; a time-out is kept; `stop` comes back from another
    thread; a closed table says so.

    Raises AssertionError, saying what is not as it must be.
    """
    before = true_angle() if true_angle is not None else 0.0
    with opener() as table:
        assert isinstance(table, Turntable), "it lacks move_to or stop"
        if true_angle is not None:
            assert true_angle() == before, "opening turned the table"
        start = _moved(table, 0.0, microstep, timeout)
        zero = true_angle() if true_angle is not None else 0.0
        for k in range(1, 25):
            wanted = 2 * math.pi * k / 24 + k * math.sqrt(2) * 1e-4
            reached = _moved(table, wanted, microstep, timeout)
            if true_angle is not None:
                off = true_angle() - zero - (reached - start)
                assert abs(off) < 0.51 * microstep, f"it says {reached:g} rad, {off:g} rad off"
        for k in range(40):
            _moved(table, 2 * math.pi + 0.7 * microstep * k, microstep, timeout)
        _moved(table, 0.0, microstep, timeout)
        if true_angle is not None:
            drift = abs(true_angle() - zero)
            assert drift < 0.51 * microstep, f"after a turn and back it is {drift:g} rad off"
        _check_refusals(table)
        _check_impatience(table)
    _check_stop(opener)
    _check_closed(table)


def _moved(table: Turntable, angle: float, microstep: float, timeout: float) -> float:
    reached = table.move_to(angle, timeout)
    assert isinstance(reached, float), f"move_to returned {reached!r}, not an angle"
    assert abs(reached - angle) <= 0.51 * microstep, f"asked for {angle:g}, reached {reached:g} rad"
    return reached


def _check_refusals(table: Turntable) -> None:
    for angle in (math.nan, math.inf, -math.inf):
        try:
            table.move_to(angle, 1.0)
        except (DeviceError, InputError):
            continue
        raise AssertionError(f"move_to({angle}) was not refused")


def _check_impatience(table: Turntable) -> None:
    """A time-out that cannot be met: there all the same, or a DeviceError soon."""
    begun = time.monotonic()
    with suppress(DeviceError):
        table.move_to(math.pi, 1e-3)
    waited = time.monotonic() - begun
    assert waited < _LATE, f"a time-out of 1 ms took {waited:g} s"


def _check_stop(opener: Callable[[], AbstractContextManager[Turntable]]) -> None:
    with opener() as table:
        ended = threading.Event()

        def turn() -> None:
            try:
                table.move_to(2 * math.pi, 60.0)
            except TurnscanError:
                pass
            finally:
                ended.set()

        thread = threading.Thread(target=turn, daemon=True)
        thread.start()
        time.sleep(0.05)
        try:
            table.stop()
        except DeviceError as e:
            raise AssertionError(f"stop raised {e}") from e
        assert ended.wait(60.0), "a move went on for 60 s after stop"
        thread.join(timeout=1.0)


def _check_closed(table: Turntable) -> None:
    if not hasattr(table, "close"):
        return
    try:
        table.move_to(0.0, 1.0)
    except TurnscanError:
        return
    raise AssertionError("a closed table turned instead of raising a DeviceError")

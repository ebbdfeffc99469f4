"""The stop switch: also orders that were under way when it was pressed come to nothing."""

from __future__ import annotations

import threading

import pytest

from turnscan.devices import Lasers, StopSwitch, Sweeping, Turntable
from turnscan.errors import DeviceRefused, DeviceTimeout, LaserStateUnknown

LEFT = frozenset({"left"})


class Bench:
    """Lasers and a table; orders may take until the test lets them go on."""

    names = ("left",)
    counting = "abc"

    def __init__(self) -> None:
        self.lit: frozenset[str] = frozenset()
        self.turned = self.stops = 0
        self.ordered, self.go_on, self.stopped = (threading.Event() for _ in range(3))
        self.fails: Exception | None = None

    def light(self, lit: frozenset[str], lease: float) -> None:
        self.ordered.set()
        assert self.go_on.wait(60.0)
        self.lit = lit

    def renew(self, lease: float) -> None: ...

    def off(self) -> None:
        self.lit = frozenset()
        if self.fails:
            raise self.fails

    def check_exposure(self, seconds: float) -> None:
        raise DeviceRefused(f"{seconds:g} s is no whole sweep")

    def move_to(self, angle: float, timeout: float) -> float:
        self.ordered.set()
        assert self.go_on.wait(60.0)
        self.stopped.clear()  # what was stopped before it started is not stopped
        if self.stopped.wait(60.0):
            raise DeviceTimeout("stopped")
        self.turned += 1
        return angle

    def stop(self) -> None:
        self.stops += 1
        self.stopped.set()


def test_it_refuses_until_it_is_released() -> None:
    bench = Bench()
    bench.go_on.set()
    switch = StopSwitch(bench, bench)
    switch.lasers.light(LEFT, 2.0)
    assert bench.lit == LEFT
    switch.press()
    assert not bench.lit
    assert bench.stops == 1
    for order in (
        lambda: switch.lasers.light(LEFT, 2.0),
        lambda: switch.turntable.move_to(1.0, 5.0),
    ):
        with pytest.raises(DeviceRefused, match="stopped"):
            order()
    switch.lasers.light(frozenset(), 2.0)
    switch.lasers.off()
    switch.release()
    switch.lasers.light(LEFT, 2.0)
    assert bench.lit == LEFT


def test_what_a_device_can_its_facade_can() -> None:
    switch = StopSwitch(Bench(), Bench())
    assert isinstance(switch.lasers, Lasers)
    assert isinstance(switch.lasers, Sweeping)
    assert isinstance(switch.turntable, Turntable)
    assert switch.turntable.counting == "abc"  # type: ignore[attr-defined]
    assert not hasattr(switch.turntable, "acknowledge")
    with pytest.raises(DeviceRefused, match="whole sweep"):
        switch.lasers.check_exposure(0.1)


def test_an_order_to_light_that_was_under_way_is_followed_by_another_dark() -> None:
    bench = Bench()
    switch = StopSwitch(bench, bench)
    order = threading.Thread(target=switch.lasers.light, args=(LEFT, 2.0))
    order.start()
    assert bench.ordered.wait(60.0)
    stop = threading.Thread(target=switch.press)
    stop.start()
    while not bench.stops:  # the first dark and the first stop have gone out
        bench.stopped.wait(0.01)
    bench.go_on.set()
    stop.join(60.0)
    order.join(60.0)
    assert not stop.is_alive()
    assert not bench.lit


def test_a_move_that_was_under_way_is_stopped_again() -> None:
    bench = Bench()
    switch = StopSwitch(bench, bench)
    errors: list[Exception] = []

    def turn() -> None:
        try:
            switch.turntable.move_to(1.0, 5.0)
        except DeviceTimeout as e:
            errors.append(e)

    move = threading.Thread(target=turn)
    move.start()
    assert bench.ordered.wait(60.0)
    switch.press()
    bench.go_on.set()  # only now the order goes out
    move.join(60.0)
    assert [str(e) for e in errors] == ["stopped"]
    assert bench.turned == 0
    assert bench.stops >= 2


def test_what_cannot_be_confirmed_is_raised_after_both_were_asked() -> None:
    bench = Bench()
    bench.fails = LaserStateUnknown("no answer")
    with pytest.raises(LaserStateUnknown):
        StopSwitch(bench, bench).press()
    assert bench.stops == 1

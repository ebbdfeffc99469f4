"""Stop, at any moment: the next command succeeds, and no person is needed for it."""

from __future__ import annotations

import math
import threading
import time
from random import Random
from typing import Any

import pytest

from tests.devices.boards import PATIENT, SCALE, near, plugged
from turnscan.devices import _guard
from turnscan.devices._guard_client import Interrupted
from turnscan.devices._registry import board
from turnscan.errors import DeviceAlarm, DeviceTimeout, LeaseEnded, TurnscanError
from turnscan.simulate.controllers import SardauscanHorusFirmware, Socket


@pytest.mark.parametrize("dialect", ["grbl", "horus"])
def test_a_stop_while_the_board_is_busy_with_no_move(dialect: str) -> None:
    """The byte that holds would lie behind the reset, and the board would stay in it."""
    with plugged(dialect, deadlines=PATIENT) as (device, socket):
        device.move_to(math.radians(10.0), 10.0)
        with device._locked(1.0):  # another thread has a command in flight
            device.off()
            device.stop()
        device.light(frozenset({"a"}), 1.0)
        assert socket.firmware.lit
        device.light(frozenset(), 1.0)
        device.move_to(math.radians(20.0), 10.0)


@pytest.mark.parametrize("dialect", ["grbl", "horus"])
def test_a_hold_that_comes_behind_the_reset(dialect: str) -> None:
    with plugged(dialect, deadlines=PATIENT) as (device, _):
        device.off()
        device._link.write(b"!")
        device._held = True
        device.move_to(math.radians(20.0), 10.0)
        assert device.alarm == ""


def move_that_a_dark_interrupts(device: Any, degrees: float) -> None:
    """The dark comes when the board's modes are set and the move is not yet sent."""
    claim = device._claim

    def late() -> None:
        claim()
        device.off()

    device._claim = late
    with pytest.raises(Interrupted):
        device.move_to(math.radians(degrees), 10.0)
    device._claim = claim


@pytest.mark.parametrize("dialect", ["grbl", "horus"])
def test_a_dark_between_the_modes_and_the_move(dialect: str) -> None:
    """The reset forgets the zero that the move is counted from: it is not sent any more."""
    with plugged(dialect, deadlines=PATIENT) as (device, socket):
        device.move_to(math.radians(200.0), 10.0)
        stood = socket.firmware.turned
        move_that_a_dark_interrupts(device, 210.0)
        assert socket.firmware.turned == stood
        assert device.alarm == ""
        assert device.move_to(math.radians(220.0), 10.0) == pytest.approx(math.radians(220.0), 0.01)
        assert socket.firmware.turns == pytest.approx(220.0 / 360.0, abs=1e-3)


@pytest.mark.parametrize("dialect", ["grbl", "horus"])
def test_a_dark_whose_order_is_held_up(dialect: str) -> None:
    """On a busy computer a whole move is sent between the request for dark and its order."""
    with plugged(dialect, deadlines=PATIENT) as (device, _):
        link = device._link
        ask, write = link._ask, link.write
        sent = threading.Event()
        ended: list[BaseException] = []

        def turn() -> None:
            try:
                device.move_to(math.radians(200.0), 10.0)
            except TurnscanError as e:
                ended.append(e)

        mover = threading.Thread(target=turn)

        def noted(data: bytes, darks: int | None = None) -> None:
            write(data, darks)
            if data.startswith((b"G1 X", b"G1X")):
                sent.set()

        def late(kind: bytes, payload: bytes) -> Any:
            link._ask = ask
            mover.start()
            assert sent.wait(10.0)
            return ask(kind, payload)

        link.write, link._ask = noted, late
        device.off()
        mover.join(30.0)
        assert [type(e) for e in ended] == [Interrupted]
        if "while the table turned" in device.alarm:
            device.acknowledge()
        assert device.alarm == ""
        device.move_to(math.radians(10.0), 10.0)


def test_a_dark_between_a_move_and_the_question_for_its_end() -> None:
    """A board that was reset has ended nothing: its answer would say that the table is there."""
    with plugged("grbl", deadlines=PATIENT) as (device, socket):
        finish = device._finish

        def late(end: float) -> None:
            device.off()
            finish(end)

        device._finish = late
        with pytest.raises(Interrupted):
            device.move_to(math.radians(200.0), 10.0)
        device._finish = finish
        assert device.alarm == ""
        device.move_to(math.radians(20.0), 10.0)
        assert socket.firmware.turns == pytest.approx(20.0 / 360.0, abs=1e-3)


def test_a_lease_that_ends_just_before_the_laser_is_put_out_for_a_move() -> None:
    with plugged("grbl", deadlines=PATIENT) as (device, socket):
        device.move_to(math.radians(200.0), 10.0)
        device.light(frozenset({"a"}), 0.2)
        link, stood = device._link, socket.firmware.turned
        ask = link._ask

        def late(kind: bytes, payload: bytes) -> Any:
            end = time.monotonic() + 60.0
            while kind == b"L" and not link._lapsed and time.monotonic() < end:
                time.sleep(0.01)
            return ask(kind, payload)

        link._ask = late
        with pytest.raises(LeaseEnded):
            device.move_to(math.radians(210.0), 10.0)
        link._ask = ask
        assert socket.firmware.turned == stood
        device.move_to(math.radians(220.0), 10.0)
        assert socket.firmware.turns == pytest.approx(220.0 / 360.0, abs=1e-3)


def test_a_dark_that_the_guard_repeats_by_itself_counts() -> None:
    """One that was not confirmed comes again a second later, between any two lines."""
    with plugged("grbl", deadlines=PATIENT) as (device, socket):
        claim = device._claim
        device._claim = lambda: device._link._by_itself(_guard.DONE, b"", b"")
        with pytest.raises(Interrupted):
            device.move_to(math.radians(10.0), 10.0)
        device._claim = claim
        assert socket.firmware.turned == 0
        device.move_to(math.radians(20.0), 10.0)
        device._link._by_itself(_guard.DONE, b"", b"")
        device.move_to(math.radians(30.0), 10.0)
        assert socket.firmware.turns == pytest.approx(30.0 / 360.0, abs=1e-3)


def test_modes_that_could_not_be_set_after_an_alarm_are_set_before_the_next_move() -> None:
    with plugged("grbl", deadlines=PATIENT) as (device, socket):
        device.move_to(math.radians(200.0), 10.0)
        device.off()
        device.move_to(math.radians(210.0), 10.0)
        device.off()
        settle = device._settle

        def deaf() -> None:
            raise DeviceTimeout("no answer")

        device._settle = deaf
        with pytest.raises(DeviceTimeout):
            device.look_over()
        device._settle = settle
        device.move_to(math.radians(220.0), 10.0)
        assert socket.firmware.turns == pytest.approx(220.0 / 360.0, abs=1e-3)


def test_a_move_that_was_not_sent_loses_no_place_that_the_board_cannot_tell() -> None:
    with Socket(SardauscanHorusFirmware(), scale=SCALE) as socket:
        device = board(f"horus:{socket.path}?lasers=a", deadlines=PATIENT)
        device.move_to(math.radians(45.0), 10.0)
        move_that_a_dark_interrupts(device, 90.0)
        device.move_to(math.radians(90.0), 10.0)
        assert device.alarm == ""
        assert socket.firmware.turns == pytest.approx(0.25)
        device.close()


@pytest.mark.parametrize("piece", [1, 2, 4])
def test_a_signal_just_after_a_piece_of_a_move_finds_the_table_where_it_is(piece: int) -> None:
    """FabScanPi does not say where it is, so what is noted has to be right at any moment."""
    device, link = near("fabscan")
    mark, left = device._mark, piece

    def signalled() -> None:
        nonlocal left
        left -= 1
        if left == 0:
            raise KeyboardInterrupt
        mark()

    device._mark = signalled
    with pytest.raises(KeyboardInterrupt):
        device.move_to(math.radians(45.0), 10.0)
    assert left == 0
    device._mark = mark
    assert device.angle == pytest.approx(2.0 * math.pi * link.board.turns)
    device.move_to(math.radians(45.0), 10.0)
    assert link.board.turns == pytest.approx(0.125)


def work(device: Any, over: threading.Event) -> None:
    """Until it is stopped."""
    try:
        while not over.is_set():
            device.move_to(device.angle + 0.2, 20.0)
            device.light(frozenset({"a"}), 2.0)
            device.light(frozenset({"a", "b"}), 2.0)
            device.light(frozenset(), 2.0)
    except TurnscanError:
        pass


WAYS = (("off", "stop"), ("stop", "off"), ("stop",), ("off",))


@pytest.mark.parametrize("dialect", ["grbl", "horus"])
def test_fifty_stops_at_random_moments(dialect: str) -> None:
    random, alarms = Random(5), 0
    with plugged(dialect, 20.0, deadlines=PATIENT) as (device, socket):
        for k in range(50):
            over = threading.Event()
            worker = threading.Thread(target=work, args=(device, over))
            worker.start()
            time.sleep(random.uniform(0.0, 0.1))
            for way in WAYS[k % len(WAYS)]:
                getattr(device, way)()
            over.set()
            worker.join(30.0)
            assert not worker.is_alive()
            if "ALARM" in device.alarm or "while the table turned" in device.alarm:
                alarms += 1
                device.acknowledge()
            device.light(frozenset({"a"}), 2.0)
            assert socket.firmware.lit
            device.move_to(device.angle + 0.05, 20.0)
            assert not socket.firmware.lit
    assert alarms <= 5


def go_on(device: Any) -> None:
    """Until something ends it."""
    while True:
        device.light(frozenset({"b"}), 2.0)


def test_an_alarm_during_a_stop_still_needs_a_person() -> None:
    with plugged("grbl", deadlines=PATIENT) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        socket.firmware._alarm(1)
        with pytest.raises(DeviceAlarm):
            go_on(device)
        with pytest.raises(DeviceAlarm, match="acknowledge"):
            device.move_to(0.1, 5.0)

"""What befalls a board and its cable: late, split, doubled and lost answers, power kept or not."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
import serial

from turnscan.simulate.controllers import (
    Cable,
    FabScanFirmware,
    GrblFirmware,
    HorusFirmware,
    Socket,
)


def carried(cable: Cable, *answers: bytes) -> list[tuple[float, bytes]]:
    """When what arrives, of answers that set out at 0, 1, 2 … s."""
    arrived = []
    for k, answer in enumerate(answers):
        cable.up(answer, float(k))
    while (when := cable.wake()) is not None:
        arrived.append((when, cable.arrived(when)))
    return arrived


def test_a_cable_that_does_nothing() -> None:
    assert carried(Cable(), b"ok\r\n", b"", b"<Idle>") == [(0.0, b"ok\r\n"), (2.0, b"<Idle>")]
    assert Cable().down(b"M5\n") == b"M5\n"


def test_late_split_doubled_and_lost_answers() -> None:
    cable = Cable()
    cable.late, cable.piece, cable.gap = 0.5, 2, 0.1
    got = carried(cable, b"abcde")
    assert [data for _, data in got] == [b"ab", b"cd", b"e"]
    assert [when for when, _ in got] == pytest.approx([0.5, 0.6, 0.7])
    cable.repair()
    cable.lose, cable.double = 1, 1
    assert carried(cable, b"a", b"b", b"c") == [(1.0, b"bb"), (2.0, b"c")]
    cable.late = 5.0
    cable.up(b"x", 0.0)
    cable.late = 0.0
    cable.up(b"y", 1.0)  # a wire keeps the order
    assert cable.arrived(4.9) == b""
    assert cable.arrived(5.0) == b"xy"


def test_bytes_lost_and_spoilt_on_their_way_to_the_board() -> None:
    cable, sent = Cable(seed=1), bytes(range(256)) * 40
    cable.drop = 0.25
    assert 0.70 < len(cable.down(sent)) / len(sent) < 0.80
    cable.repair()
    cable.spoil = 0.5
    heard = cable.down(sent)
    assert len(heard) == len(sent)
    assert 0.45 < sum(a != b for a, b in zip(sent, heard, strict=True)) / len(sent) < 0.55


def until(happened: Callable[[], bool]) -> None:
    end = time.monotonic() + 120.0
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.mark.parametrize("powered", [True, False])
def test_a_board_that_keeps_its_power_stays_lit_and_counts(powered: bool) -> None:
    board = GrblFirmware({"100": 80, "110": 60000, "120": 80000})
    with Socket(board) as socket:
        with serial.Serial(socket.path, timeout=2.0) as port:
            port.write(b"M3 S1000\nG1 X90 F1500\n")  # for 3.6 s: a machine may stall for two
            until(lambda: board.rate > 0)
            begun = board.log[-1].time
            board.unplug(0.3, powered=powered)
        until(lambda: board.unplugged == 0.0)
        with serial.Serial(socket.path, timeout=2.0) as port:
            port.write(b"?")
            said = port.read_until(b">")
        assert (b"Run" in said) == powered
        assert bool(board.lit) == powered
        if powered:
            assert board.log[-1].time == begun  # it has not blinked, and the table goes on
            until(lambda: board.steps == 7200)
        else:
            assert 0 < board.steps < 7200


def test_a_reset_leaves_the_table_where_it_is() -> None:
    for board, line in (
        (GrblFirmware({"100": 80}), b"G1 X9 F9000\n"),
        (HorusFirmware(), b"G1F90X9\n"),
    ):
        board.feed(line)
        board.run(60.0)
        steps = board.steps
        assert steps == (720 if isinstance(board, GrblFirmware) else 80)
        board.power_on()
        assert board.place == 0
        assert board.steps == steps
        assert board.turns == pytest.approx(9 / 360)


def test_a_brown_out_a_silent_reset_and_a_watchdog() -> None:
    board = GrblFirmware()
    board.feed(b"M8\n")
    board.run(1.0)
    assert board.take().endswith(b"ok\r\n")
    board.hang(2.0)
    board.feed(b"M9\n\x18")
    board.run(2.9)
    assert board.lit  # hung: it hears nothing, not even a reset
    board.run(3.1)
    assert not board.lit
    assert board.take() == GrblFirmware.banner
    board.power_on(silent=True)
    board.run(4.0)
    assert board.take() == b""
    board.power_on()
    board.run(5.0)
    assert board.take() == GrblFirmware.banner


def test_a_deaf_board_goes_on_burning() -> None:
    board = FabScanFirmware()
    board.feed(b"M21\n")
    board.run(1.0)
    board.deafen(2.0)
    board.feed(b"M22\n")
    board.run(2.9)
    assert board.lit
    board.run(3.1)
    board.feed(b"M22\n")
    board.run(3.2)
    assert not board.lit

"""The angle that is stored is the one to which the motor's STEP pulses have turned the table."""

from __future__ import annotations

import math
import time
from fractions import Fraction

import pytest

from tests.devices.boards import DIALECTS, UNITS, firmware, near
from tests.devices.signals import interrupted
from turnscan.devices import _board, _fabscan, _horus, _line_protocol, _sardauscan
from turnscan.devices._board import Board
from turnscan.errors import DeviceRestarted
from turnscan.scanner import stops_of
from turnscan.simulate.controllers import FabScanFirmware, Firmware, SardauscanHorusFirmware

STEPS = {**UNITS, "sardauscan as horus": 512}
"""STEP pulses (or what a board makes at once) of one turn."""
TURN, PART, TURNS, BACK = (Fraction(0), Fraction(360)), (0, 45), (0, 1080), (90, -300)


class Clock:
    """The drivers' `time`: a wait in vain passes at once."""

    def __init__(self) -> None:
        self._ahead = 0.0

    def monotonic(self) -> float:
        return time.monotonic() + self._ahead

    def sleep(self, seconds: float) -> None:
        self._ahead += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    it = Clock()
    for module in (_board, _line_protocol, _horus, _fabscan, _sardauscan):
        monkeypatch.setattr(module, "time", it)
    return it


def cut_answers(device: Board) -> None:
    """Each answer comes in two parts, the second only to who waits; a signal may fall between."""
    read, rest = device._link.read, bytearray()

    def part(timeout: float) -> bytes:
        if rest and timeout == 0.0:
            return b""
        data = bytes(rest) or read(timeout)
        rest[:] = b"" if rest else data[1:]
        return data if not rest else data[:1]

    device._link.read = part  # type: ignore[method-assign]


def table(dialect: str, clock: Clock | None = None) -> tuple[Board, Firmware]:
    silent = clock and clock.sleep
    if dialect in DIALECTS:
        board = firmware(dialect)
        return near(dialect, board, silent)[0], board
    board = SardauscanHorusFirmware()
    return near("horus", board, silent)[0], board


@pytest.mark.parametrize("dialect", STEPS)
@pytest.mark.parametrize("ends", [TURN, PART, TURNS, BACK], ids=str)
@pytest.mark.parametrize("stops", [24, 25, 46, 400])
def test_stored_angles_are_those_of_the_pulses(
    dialect: str, ends: tuple[int, int], stops: int, clock: Clock
) -> None:
    first, last = Fraction(ends[0]), Fraction(ends[1])
    step, count = stops_of((first, last), stops, None, 400)
    device, board = table(dialect, clock)
    resolution = 2 * math.pi / STEPS[dialect] * (1.5 if "as" in dialect else 0.5)
    for k in range(count):
        wanted = 2 * math.pi * float((first + k * step) / 360)
        stored = device.move_to(wanted, 600.0)
        assert stored == pytest.approx(2 * math.pi * board.steps / STEPS[dialect], abs=1e-9)
        assert stored == pytest.approx(wanted, abs=1.001 * resolution)
    if dialect == "grbl":  # in its own steps, of which 3200.04 would be a turn
        assert board.turns == pytest.approx(board.steps / (8.889 * 360), abs=1e-12)
    else:
        assert board.turns == pytest.approx(board.steps / STEPS[dialect], abs=1e-12)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_signal_at_any_line_of_a_first_move_leaves_the_angle_known(
    dialect: str, clock: Clock
) -> None:
    """Also where the board counts zero, as it does after a restart."""
    names = ("_board", "_left", f"_{dialect}", "_line_protocol")
    files = tuple(f"devices/{name}.py" for name in names)
    for number in range(1, 2000):
        device, board = table(dialect, clock)
        cut_answers(device)
        where = interrupted(lambda d=device: d.move_to(math.radians(10.0), 60.0), number, files)
        count = None if dialect == "fabscan" else board.steps
        found = device._left.place(count, device._tolerance())
        if dialect == "fabscan" and where in ("_go", "_said", "expect_nothing", "next"):
            assert found in (None, board.steps), (number, where)  # it does not say where it is
        else:
            assert found == board.steps, (number, where)
        if not where:
            break
    assert number > 50
    assert not where


@pytest.mark.parametrize("lost", [1, 2, 3, 5, 7, 133])
def test_the_emulated_fabscan_loses_what_is_no_whole_pulse(lost: int) -> None:
    """As its firmware does, whose moves each begin at phase 0 of the Gray code."""
    board = FabScanFirmware()
    board.feed(b"M17\nG02 T-4 F1200\n")
    board.run(10.0)
    assert board.steps == -1
    for _ in range(8):
        board.feed(f"G02 T{lost} F1200\n".encode())
        board.run(board.now + 10.0)
    assert 4 * (board.steps + 1) != 8 * lost
    board.feed(f"G02 T-{4 * lost} F1200\n".encode())
    before = board.steps
    board.run(board.now + 10.0)
    assert board.steps == before - lost


def test_a_move_by_phases_is_seen_to_lose_pulses(monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver as it was: T counted one by one. --steps 24 ended 3.04° behind."""
    from turnscan.devices import _fabscan

    monkeypatch.setattr(_fabscan, "PER_PULSE", 1)
    device, board = table("fabscan")
    device._in_phase = True  # it began with a pulse of its own, too
    for k in range(24):
        stored = device.move_to(2 * math.pi * k / 24, 600.0)
    behind = math.degrees(stored) - 360 * board.turns
    assert behind == pytest.approx(3.04, abs=0.01)


def test_a_board_that_gives_back_its_motor_does_not_turn() -> None:
    board = FabScanFirmware()
    board.feed(b"G02 T-400 F1200\n")
    board.run(10.0)
    assert board.steps == 0


@pytest.mark.parametrize("after_light", [False, True])
def test_a_fabscan_that_restarted_at_rest_is_noticed(after_light: bool) -> None:
    device, link = near("fabscan")
    device.move_to(0.5, 60.0)
    if after_light:
        device.light(frozenset({"a"}), 1.0)
        device.light(frozenset(), 1.0)
    link.board.power_on()
    with pytest.raises(DeviceRestarted, match="restarted since"):
        device.move_to(0.6, 60.0)
    assert device.alarm
    assert not device.remembers
    device.acknowledge()
    before = link.board.turns
    assert device.move_to(0.1, 60.0) == pytest.approx(0.1, abs=0.004)
    assert (link.board.turns - before) * 2 * math.pi == pytest.approx(device.angle, abs=1e-9)


def test_a_fabscan_that_restarted_in_an_exposure_still_turns_as_far_as_it_says() -> None:
    """No half line lies in its buffer then; its motor is asked to hold before every move."""
    device, link = near("fabscan")
    device.move_to(0.5, 60.0)
    device.light(frozenset({"a"}), 1.0)
    link.board.power_on()
    device.light(frozenset(), 1.0)
    device.move_to(0.8, 60.0)
    assert link.board.turns * 2 * math.pi == pytest.approx(device.angle, abs=1e-9)

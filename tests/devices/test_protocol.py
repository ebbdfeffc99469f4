"""D2, D3, D8, D9, D11, D12 and bad input: what the drivers say, wait for and count."""

from __future__ import annotations

import ast
import contextlib
import math
import os
import random
import re
import time
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import turnscan.devices
from tests.devices.boards import DIALECTS, PATIENT, QUICK, SCALE, UNITS, firmware, near, plugged
from turnscan.devices import (
    _dialects,
    _registry,
    _sardauscan,
    open_devices,
    open_lasers,
    open_turntable,
)
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._line_protocol import Lines
from turnscan.devices._manual import ManualTurntable
from turnscan.devices._registry import board
from turnscan.devices._replies import Kind, sentence
from turnscan.devices._steps import Steps, decimal, travel_time
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
    InputError,
    TurnscanError,
)
from turnscan.simulate.controllers import (
    Cable,
    Fault,
    GrblFirmware,
    HorusFirmware,
    SardauscanHorusFirmware,
    Socket,
)

# D2

OURS = (
    "_board", "_dialects", "_discover", "_fabscan", "_galvanometer", "_grbl", "_guard",
    "_guard_client", "_horus", "_line_protocol", "_lit", "_manual", "_registry", "_replies",
    "_rescue", "_sardauscan",
    "_steps", "_visa",
)  # fmt: skip
ENDLESS = {
    ("_guard", "_speak"): "a thread of its own that only speaks",
    ("_rescue", "_mind"): "a thread of its own; the process it minds ends by itself",
}
"""Waits that may be without end, and why."""


def endless_waits(source: str) -> list[str]:
    """The functions in which something waits that has no time-out."""
    found = []
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                waits = node.func.attr in ("get", "wait", "join", "acquire", "communicate", "recv")
                if waits and not node.args and not node.keywords:
                    found.append(function.name)
            if isinstance(node, ast.With):
                for item in node.items:
                    name = getattr(item.context_expr, "attr", "")
                    if "lock" in name or "pipe" in name:
                        found.append(function.name)
    return found


class LateWithStatus(Cable):
    """Answers to ``?`` take longer than they may; all else is as usual."""

    def up(self, data: bytes, now: float) -> None:
        self.late = 1.5 * QUICK.acknowledge if data.startswith(b"<") else 0.0
        super().up(data, now)


def test_a_board_that_is_late_with_its_status_is_not_taken_for_one_that_has_none() -> None:
    """The answer to ``?`` comes while that to G50 is waited for, as on a busy machine."""
    with Socket(HorusFirmware(), scale=SCALE, cable=LateWithStatus()) as socket:
        address = f"horus:{socket.path}?lasers=a,b"
        with pytest.raises(DeviceTimeout, match=r"no answer to '\?'.*connect again"):
            board(address, deadlines=QUICK)
        with contextlib.closing(board(address, deadlines=PATIENT)) as found:
            found.move_to(math.radians(0.5), 5.0)
            assert math.degrees(found.angle) == pytest.approx(0.5, abs=360 / UNITS["horus"])


@pytest.mark.parametrize("module", OURS)
def test_no_wait_without_a_deadline(module: str) -> None:
    path = Path(turnscan.devices.__file__).parent / f"{module}.py"
    assert [f for f in endless_waits(path.read_text()) if (module, f) not in ENDLESS] == []


def test_the_lint_sees_a_wait_without_end() -> None:
    assert endless_waits("def f():\n    q.get()\n") == ["f"]
    assert endless_waits("def f():\n    with self._lock:\n        pass\n") == ["f"]
    assert endless_waits("def f():\n    q.get(timeout=1)\n") == []


def test_the_deadlines_are_those_promised() -> None:
    assert Deadlines() == Deadlines(
        acknowledge=2.0, move_extra=5.0, connect=10.0, keep_trying=600.0
    )


@pytest.mark.parametrize("dialect", DIALECTS)
def test_silence_ends_with_its_deadline(dialect: str) -> None:
    with plugged(dialect, deadlines=replace(PATIENT, acknowledge=0.6, move_extra=0.3)) as (
        device,
        socket,
    ):
        device.move_to(0.05, 5.0)
        socket.firmware.faults.append(Fault(socket.firmware._moves + 1, "silence"))
        begin = time.monotonic()
        with pytest.raises(DeviceTimeout, match="no answer"):
            device.move_to(0.1, 5.0)
        assert 0.29 < time.monotonic() - begin < 30.0


def test_the_callers_time_out_counts_too() -> None:
    with plugged("horus", scale=1.0) as (device, _):
        begin = time.monotonic()
        with pytest.raises(DeviceTimeout):
            device.move_to(3.0, 0.2)
        assert time.monotonic() - begin < 5.0  # the move takes longer


# D3

LINES = [
    b"ok", b"error:9", b"error: Bad number format", b"ALARM:3", b"ALARM: Abort during cycle",
    b"Grbl 1.1h ['$' for help]", b"Horus 0.2 ['$' for help]", b"[MSG:'$H'|'$X' to unlock]",
    b"<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>",
    b"<Run,MPos:-9.112,0.000,0.000,WPos:-9.112,0.000,0.000>", b"$100=250.000",
    b"$3=6 (dir port invert mask:00000110)", b"512", b"['$H'|'$X' to unlock]",
]  # fmt: skip


def test_a_hundred_thousand_lines() -> None:
    """Random and mutated lines: a sentence or DeviceGarbled, no other exception, no hang."""
    seed = int(os.environ.get("TURNSCAN_SEED", "20261120"))
    dice, said, garbled = random.Random(seed), 0, 0
    for k in range(100_000):
        if k % 3 == 0:
            line = dice.randbytes(dice.randrange(0, 90))
        else:
            text = bytearray(dice.choice(LINES))
            for _ in range(dice.randrange(0, 4)):
                text[dice.randrange(len(text))] = dice.randrange(256)
            if dice.random() < 0.2:
                text *= dice.randrange(1, 9)
            line = bytes(text)
        try:
            said += isinstance(sentence(line).kind, Kind)
        except DeviceGarbled:
            garbled += 1
    print(f"seed {seed}: {said} sentences, {garbled} garbled")
    assert said + garbled == 100_000
    assert min(said, garbled) > 10_000


@given(st.binary(max_size=600))
def test_any_bytes_are_a_sentence_or_garbled(line: bytes) -> None:
    with contextlib.suppress(DeviceGarbled):
        sentence(line)


@pytest.mark.parametrize("line", LINES)
def test_real_lines_are_understood(line: bytes) -> None:
    assert sentence(line).text == line.decode()


class Babbler:
    """A link that talks without a line end, for ever."""

    def __init__(self) -> None:
        self.given = 0

    def read(self, timeout: float) -> bytes:
        self.given += 4096
        return b"x" * 4096


def test_a_line_without_end_takes_no_memory() -> None:
    link = Babbler()
    lines = Lines(link, "port")  # type: ignore[arg-type]
    with pytest.raises(DeviceGarbled, match="endless line"):
        lines.next(time.monotonic() + 5.0, "anything")
    assert link.given <= 8192
    assert len(lines._bytes) == 0


@pytest.mark.parametrize("dialect", DIALECTS)
def test_drivers_take_any_answer(dialect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A board that answers whatever comes to its mind: errors by name, nothing else."""
    # This board's time is its own, and a driver that waits for the end of a piece waits in ours.
    monkeypatch.setattr(_sardauscan, "travel_time", lambda *_: 0.01)
    dice = random.Random(7)
    for _ in range(60):
        device, link = near(dialect)
        inner = link.read

        def read(timeout: float, inner: Callable[[float], bytes] = inner) -> bytes:
            data = inner(timeout)
            if data and dice.random() < 0.4:
                data = dice.choice([*LINES, dice.randbytes(30), b""]) + b"\r\n"
            return data

        link.read = read  # type: ignore[method-assign]
        device._d = Deadlines(0.01, 0.01, 0.1)
        for angle in (0.05, 0.1):
            try:
                device.move_to(angle, 0.05)
            except TurnscanError:
                break


# D8


@pytest.mark.parametrize("dialect", DIALECTS)
def test_one_command_in_flight(dialect: str) -> None:
    device, link = near(dialect)
    link.flying = link.most_flying = 0
    for k in range(30):
        device.move_to(0.03 * k, 60.0)
        device.light(frozenset({"a"}), 1.0)
        device.light(frozenset(), 1.0)
    device.move_to(0.0, 60.0)
    assert link.most_flying == 1


@pytest.mark.parametrize("dialect", DIALECTS)
def test_after_an_alarm_nothing_is_sent_until_a_person_acknowledges(dialect: str) -> None:
    device, link = near(dialect)
    device._lose(DeviceAlarm("on purpose"))
    sent = len(link.written)
    for act in (
        lambda: device.move_to(0.1, 5.0),
        lambda: device.light(frozenset({"a"}), 1.0),
        lambda: device.light(frozenset(), 1.0),
    ):
        with pytest.raises(DeviceAlarm, match="acknowledge"):
            act()
    assert len(link.written) == sent
    assert "on purpose" in device.alarm
    assert not device.remembers
    device.acknowledge()
    assert device.alarm == ""
    assert device.angle == 0.0
    device.move_to(0.1, 60.0)
    assert len(link.written) > sent


def test_a_board_found_in_an_alarm_is_not_unlocked() -> None:
    board_ = GrblFirmware({"100": 8.889})
    board_.locked = True
    device, link = near("grbl", board_)
    with pytest.raises(DeviceAlarm, match="found in an alarm"):
        device.move_to(0.1, 5.0)
    assert not any(b"$X" in data for data in link.written)


# D9


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=50),
    st.fractions(min_value=1, max_value=100_000, max_denominator=97),
)
def test_an_angle_is_rounded_once(angles: list[float], per_turn: Fraction) -> None:
    steps = Steps(per_turn)
    for angle in angles:
        unit = steps.unit_of(angle)
        assert abs(steps.angle_of(unit) - angle) <= math.pi / float(per_turn) * 1.0001
        assert steps.unit_of(steps.angle_of(unit)) == unit


def test_a_hundred_thousand_moves_of_no_round_number_do_not_drift() -> None:
    """In counts, as a board with single precision reads the text that is sent to it."""
    steps, dice = Steps(Fraction(3200)), random.Random(3)
    base = unit = place = 0
    for _ in range(100_000):
        target = steps.unit_of(steps.angle_of(unit) + dice.uniform(-0.3, 0.31))
        if abs(target - base) > 3200:
            base, place = unit, 0
        text = decimal(steps.degrees_of(target - base), 4)
        place = round(float(np.float32(text)) * float(np.float32(16 / 1.8)))
        unit = target
        assert base + place == unit
    assert abs(unit) > 3200


@pytest.mark.parametrize("dialect", DIALECTS)
def test_many_moves_come_back_to_the_step(dialect: str) -> None:
    device, link = near(dialect)
    dice, angle, per_turn = random.Random(5), 0.0, UNITS[dialect]
    if dialect == "grbl":  # $100 = 8.889 makes 3200.04 steps a turn
        assert device._steps.per_turn == 3200
    for _ in range(400):
        angle += dice.uniform(-0.5, 0.6)
        device.move_to(angle, 600.0)
        assert abs(
            link.board.turns * 2 * math.pi - angle
        ) < 2 * math.pi * 0.52 / per_turn + 2e-4 * (abs(angle) / 6 if dialect == "grbl" else 0)
    device.move_to(0.0, 600.0)
    assert link.board.turns == pytest.approx(0.0, abs=1e-9)
    assert device.angle == 0.0


@pytest.mark.parametrize("dialect", DIALECTS)
def test_backwards_goes_beyond_and_comes_back(dialect: str) -> None:
    device, link = near(dialect)
    device.move_to(0.5, 60.0)
    stops: list[float] = []
    link.board.on_change = lambda b: stops.append(b.turns * 2 * math.pi)
    device.move_to(0.2, 60.0)
    assert min(stops) < 0.2 - math.radians(0.8)
    assert stops[-1] == pytest.approx(0.2, abs=0.004)


def test_decimals_are_exact_and_plain() -> None:
    assert decimal(Fraction(1, 3), 5) == "0.33333"
    assert decimal(Fraction(-9, 8), 4) == "-1.1250"
    assert decimal(Fraction(10**9), 4) == "1000000000.0000"
    assert decimal(Fraction(7, 2), 0) == "4"
    assert travel_time(90.0, 180.0, 180.0) == pytest.approx(2 * math.sqrt(0.5))
    assert travel_time(-360.0, 180.0, 180.0) == pytest.approx(3.0)


# D11


class Entry:
    def __init__(self, name: str, load: Callable[[], Any]) -> None:
        self.name, self.value, self.load = name, f"fake:{name}", load


def test_a_driver_that_fails_breaks_only_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def at_import() -> Any:
        raise ImportError("no such library")

    def at_open(address: str) -> Any:
        raise ZeroDivisionError("in its constructor")

    class AtUse:
        def move_to(self, angle: float, timeout: float) -> float:
            raise RuntimeError("at use")

        def stop(self) -> None: ...

    real = _registry._entries
    fakes = [
        Entry("bad1", at_import), Entry("bad2", lambda: at_open),
        Entry("bad3", lambda: lambda address: object()), Entry("bad4", lambda: lambda a: AtUse()),
    ]  # fmt: skip
    monkeypatch.setattr(_registry, "_entries", lambda group: [*fakes, *real(group)])
    for name, what in (("bad1", "no such library"), ("bad2", "in its constructor")):
        with pytest.raises(DeviceError, match=what):
            open_turntable(f"{name}:x")
    with pytest.raises(DeviceNotFound, match="gives no Turntable"):
        open_turntable("bad3:x")
    assert open_turntable("bad4:x")
    with Socket(firmware("horus"), scale=SCALE) as socket:
        device: Any = open_turntable(f"horus:{socket.path}")
        assert device.move_to(0.1, 5.0) == pytest.approx(0.1, abs=0.002)
        device.close()


# D12


@pytest.mark.parametrize("resets", [False, True])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_opening_neither_moves_nor_lights_nor_resets(dialect: str, resets: bool) -> None:
    with Socket(firmware(dialect), scale=SCALE, reset_on_open=resets) as socket:
        changes: list[float] = []
        socket.firmware.on_change = lambda b: changes.append(b.turns)
        device = board(f"{dialect}:{socket.path}?lasers=a,b", deadlines=PATIENT)
        time.sleep(0.05)
        said = b"".join(data for _, data in socket.firmware.received)
        assert socket.firmware._moves == socket.firmware._lights == 0
        assert changes == []
        assert not any(entry.outputs for entry in socket.firmware.log)
        assert b"G50" not in said
        assert b"=" not in said  # no setting is written
        assert device.angle == 0.0
        device.close()


def test_the_policy_for_dtr_is_explicit(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    seen: list[tuple[Any, ...]] = []

    class Port:
        def __init__(self, **given: Any) -> None:
            self.given = given

        def open(self) -> None:
            seen.append((self.dtr, self.rts, self.given["exclusive"]))  # type: ignore[attr-defined]

    monkeypatch.setattr(serial, "Serial", Port)
    _dialects.open_port("x", 115200, False)
    _dialects.open_port("x", 115200, True)
    assert seen == [(False, False, True), (True, True, True)]


def test_a_board_that_kept_its_place_is_believed() -> None:
    with Socket(firmware("grbl"), scale=SCALE) as socket:
        for dialect_angle in (0.5, 0.8):
            device = board(f"grbl:{socket.path}", deadlines=PATIENT)
            assert device.remembers == (dialect_angle == 0.8)  # at first it counts zero
            reached = device.move_to(dialect_angle, 5.0)
            device.close()
        device = board(f"grbl:{socket.path}", deadlines=PATIENT)
        assert device.angle == pytest.approx(reached, abs=0.002)
        device.close()
        socket.firmware.power_on()
        device = board(f"grbl:{socket.path}", deadlines=PATIENT)
        assert device.angle == 0.0  # restarted, and honest about it
        assert not device.remembers
        device.close()


# Bad input


def test_ports_that_are_not_what_was_said(tmp_path: Path) -> None:
    with pytest.raises(DeviceNotFound, match="cannot be opened"):
        board(f"grbl:{tmp_path}/none", deadlines=QUICK)
    with Socket(HorusFirmware(), scale=SCALE) as socket:
        with pytest.raises(DeviceGarbled, match="does not speak grbl"):
            board(f"grbl:{socket.path}", deadlines=Deadlines(0.1, 0.1, 0.3))
        device = board(f"horus:{socket.path}", deadlines=PATIENT)
        with pytest.raises(DeviceRefused, match="in use"):
            board(f"horus:{socket.path}", deadlines=PATIENT)
        device.close()
    silent = GrblFirmware()
    with Socket(silent, scale=SCALE) as socket:
        silent._deaf_until = math.inf
        with pytest.raises(DeviceTimeout, match="silent"):
            board(f"grbl:{socket.path}", deadlines=Deadlines(0.1, 0.1, 0.3))


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("grbl", "not an address"), ("nothing:/dev/x", "no driver"), ("grbl:", "no port"),
        ("grbl:/dev/x?colour=red", "no key"), ("horus:/dev/x?steps_per_rev=many", "no number"),
        ("horus:/dev/x?steps_per_rev=nan", "no number"), ("horus:/dev/x?steps_per_rev=0", "steps"),
        ("horus:/dev/x?lasers=a,a", "twice"), ("horus:/dev/x?lasers=a,b,c,d,e", "outputs"),
        ("horus:/dev/x?outputs=9", "no output"), ("grbl:/dev/x?outputs=m5", "no output"),
        ("fabscan:/dev/x?baud=fast", "no number"), ("fabscan:/dev/x?dtr=maybe", "dtr"),
        ("grbl:/dev/x?overshoot_deg=-1", "overshoot"), ("manual:now", "nothing more"),
        ("grbl:/dev/x?baud=1&baud=2", "twice"),
    ],
)  # fmt: skip
def test_addresses_that_are_none(address: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        open_turntable(address)


def test_grbl_settings_that_do_not_suit() -> None:
    for setting, options, said in (
        ({"20": 1.0}, "", "soft limits"),
        ({"100": 250.0}, "?steps_per_rev=3200", r"\$100"),
    ):
        with (
            Socket(GrblFirmware(setting), scale=SCALE) as socket,
            pytest.raises(DeviceRefused, match=said),
        ):
            board(f"grbl:{socket.path}{options}", deadlines=PATIENT)


def test_the_sardauscan_that_speaks_like_horus() -> None:
    with Socket(SardauscanHorusFirmware(), scale=SCALE) as socket:
        device = board(f"horus:{socket.path}", deadlines=PATIENT)
        # 21° are sent, of which it makes 29 of its 512 steps.
        assert math.degrees(device.move_to(math.radians(20.4), 5.0)) == pytest.approx(20.390625)
        assert socket.firmware.turns == pytest.approx(29 / 512)
        assert not device.remembers
        device.close()


@pytest.mark.parametrize("dialect", DIALECTS)
def test_stop(dialect: str) -> None:
    import threading

    with plugged(dialect, scale=0.5, deadlines=PATIENT) as (device, socket):
        errors: list[TurnscanError] = []

        def turn() -> None:
            try:
                device.move_to(6.0, 60.0)
            except TurnscanError as e:
                errors.append(e)

        thread = threading.Thread(target=turn)
        thread.start()
        end = time.monotonic() + 60.0
        # Until it turns forwards: a board may take a step back first, to find its phase.
        while socket.firmware.turns <= 0.01 and time.monotonic() < end:
            time.sleep(0.01)
        device.stop()
        thread.join(timeout=60.0)
        assert not thread.is_alive()
        assert "stopped" in str(errors[0])
        assert device.alarm == ""  # the place is known: it goes on without a person
        place = socket.firmware.turns * 2 * math.pi
        assert 0.0 < place < 5.9
        assert device.angle == pytest.approx(place, abs=0.01)
        assert device.move_to(device.angle + 0.1, 30.0)


# manual:


def test_a_person_turns_the_table() -> None:
    answers = iter(["", "44.5", "nonsense", "-10,5°", "q"])
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return next(answers)

    table = ManualTurntable(ask)
    assert table.move_to(0.5, 5.0) == 0.5
    assert table.move_to(0.7, 5.0) == pytest.approx(math.radians(44.5))
    assert table.move_to(0.7, 5.0) == pytest.approx(math.radians(-10.5))
    with pytest.raises(DeviceRefused, match="given up"):
        table.move_to(0.7, 5.0)
    assert "28.648°" in asked[0]
    assert "nonsense" in asked[3]


def test_a_person_who_is_not_there() -> None:
    def gone(question: str) -> str:
        raise EOFError

    with pytest.raises(DeviceDisconnected):
        ManualTurntable(gone).move_to(0.1, 1.0)

    def asleep(question: str) -> str:
        time.sleep(0.5)
        return ""

    with pytest.raises(DeviceTimeout, match="no answer within"):
        ManualTurntable(asleep).move_to(0.1, 0.1)
    with pytest.raises(InputError, match="has no lasers"), open_devices("manual:"):
        pass
    with pytest.raises(InputError, match="no driver"):
        open_lasers("manual:")


@pytest.mark.parametrize("key", ["100", "110", "120"])
def test_settings_with_which_nothing_turns_are_refused(key: str) -> None:
    """By the emulated board when they are sent, and by the driver where a board has them."""
    fw = GrblFirmware({"100": 8.889})
    for value in ("-1", "0", "0.0004"):
        fw.feed(f"${key}={value}\n".encode())
        fw.run(fw.now + 0.1)
        assert b"error:4\r\n" in fw.take()
    if key == "100":  # the emulated board would not get as far as telling it
        return
    fw.settings[key] = "0.000"
    with pytest.raises(DeviceRefused, match=rf"GRBL has \${key}=0.000, with which nothing turns"):
        near("grbl", fw)


@pytest.mark.parametrize("angle", [0.5, -2.0, 7.0])
def test_a_grbl_that_reports_inches_is_understood(angle: float) -> None:
    fw = GrblFirmware({"100": 80, "110": 6000, "120": 800, "13": 1})
    device, link = near("grbl", fw)
    reached = device.move_to(angle, 60.0)
    device.light(frozenset({"a"}), 1.0)
    device.light(frozenset(), 1.0)
    assert reached == pytest.approx(link.board.turns * 2 * math.pi, abs=1e-9)
    link.dark()
    again = near("grbl", fw)[0]
    assert again.angle == pytest.approx(reached, abs=1e-9)
    link.board.feed(b"?")
    link.board.run(fw.now + 0.1)
    shown = re.search(rb"MPos:(-?[\d.]+)", link.board.take())
    assert shown is not None
    assert float(shown[1]) == pytest.approx(math.degrees(reached) / 25.4, abs=1e-3)

"""A mirror driven by a function generator: PyVISA-sim's, and an emulated one with a log."""

from __future__ import annotations

import importlib.util
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.acquire.rig import Rig, plan_of
from tests.devices.generators import definitions, resource
from tests.devices.guards import mutated
from turnscan.acquire import Exposure, Hardware, look
from turnscan.devices import Sweeping, open_devices, open_lasers
from turnscan.devices._galvanometer import Galvanometer, Swing
from turnscan.devices._guard_client import Deadlines, GuardedLink
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
    InputError,
    LaserStateUnknown,
    SafetyError,
    TurnscanError,
)
from turnscan.simulate.controllers import GeneratorFirmware, Socket
from turnscan.testing import check_lasers

QUICK = Deadlines(acknowledge=0.6, move_extra=0.3, connect=0.7)
PATIENT = Deadlines(acknowledge=3.0, move_extra=0.3, connect=10.0)
"""For a generator that answers, in a process that may stall."""
LASER = frozenset({"laser1"})
SWING = "frequency=105&amplitude=2"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return definitions(tmp_path_factory.mktemp("visa") / "generators.yaml")


def simulated(kind: str, library: str, more: str = "") -> Galvanometer:
    address = f"scpi:{resource(kind)}?{SWING}&library={library}{more}"
    return Galvanometer(address, QUICK)


@contextmanager
def emulated(more: str = "") -> Iterator[tuple[Any, GeneratorFirmware]]:
    """Behind a real serial port, through PyVISA-py; nothing of the log ever shows a spot."""
    firmware = GeneratorFirmware()
    with Socket(firmware) as socket:
        device = Galvanometer(f"scpi:ASRL{socket.path}::INSTR?{SWING}{more}", PATIENT)
        try:
            yield device, firmware
        finally:
            with suppress(TurnscanError):
                device.close()
    assert not any("spot" in entry.outputs for entry in firmware.log)


def wait_dark(firmware: GeneratorFirmware, patience: float) -> float:
    """s until dark, inf where it stays lit."""
    begin = time.monotonic()
    while firmware.lit and time.monotonic() < begin + patience:
        time.sleep(0.002)
    return math.inf if firmware.lit else max(0.0, firmware.log[-1].time - begin)


def test_a_good_generator_is_set_up_and_read_back(library: str) -> None:
    with closing(simulated("good", library, "&offset=-0.25&waveform=triangle&idn=acme")) as device:
        for question, answer in (
            ("SOUR1:FUNC?", "TRI"), ("OUTP1?", "ON"), ("SOUR2:FUNC?", "DC"), ("OUTP2?", "OFF"),
        ):  # fmt: skip
            assert device._ask(question) == answer
        for question, value in (
            ("SOUR1:FREQ?", 105.0), ("SOUR1:VOLT?", 2.0), ("SOUR1:VOLT:OFFS?", -0.25),
            ("SOUR2:VOLT:OFFS?", 5.0),
        ):  # fmt: skip
            assert float(device._ask(question)) == value
        device.light(LASER, 1.0)
        assert device._ask("OUTP2?") == "ON"
        device.light(frozenset(), 1.0)
        assert device._ask("OUTP2?") == "OFF"


@pytest.mark.parametrize(
    ("kind", "error", "says"),
    [
        ("complains", DeviceRefused, r"reports -222,.Data out of range"),
        ("slow", DeviceRefused, r"105 Hz was asked for, 50 Hz is set \(SOUR1:FREQ\)"),
        ("clips", DeviceRefused, r"2 V was asked for, 1.5 V is set"),
        ("babbles", DeviceGarbled, r"SOUR1:VOLT\? gave 'lots'"),
        ("square", DeviceRefused, r"set to SIN, it says 'SQU'"),
        ("silent", DeviceTimeout, r"silent"),
        ("dumb", DeviceTimeout, r"no answer to '\*IDN\?'"),
        ("multimeter", DeviceRefused, r"Multimeter,0815,3.1', not one with 'generator'"),
        ("nameless", DeviceRefused, r"is 'hello', not"),
        ("open gate", LaserStateUnknown, r"did not confirm lasers off"),
        ("lame mirror", DeviceRefused, r"channel 1 does not switch on"),
    ],
)
def test_a_bad_generator_is_named(
    kind: str, error: type[TurnscanError], says: str, library: str
) -> None:
    begin = time.monotonic()
    with pytest.raises(error, match=says):
        simulated(kind, library, "&idn=generator")
    assert time.monotonic() - begin < 60.0


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("scpi:", "no resource"),
        ("scpi:X::INSTR?amplitude=2", "no frequency"),
        ("scpi:X::INSTR?frequency=105", "no amplitude"),
        (f"scpi:X::INSTR?{SWING}&frequency=3", "twice"),
        ("scpi:X::INSTR?frequency=0&amplitude=2", "frequency=0"),
        (f"scpi:X::INSTR?{SWING}&waveform=square", "there is sine, triangle"),
        (f"scpi:X::INSTR?{SWING}&gate=1", "no option 'gate'"),
        (f"scpi:X::INSTR?{SWING}&lasers=a,b", "gates one laser"),
    ],
)
def test_an_address_that_is_none(address: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        open_lasers(address)


def test_without_pyvisa_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DeviceNotFound, match=r"turnscan\[scpi\]"):
        open_lasers(f"scpi:TCPIP0::192.0.2.1::INSTR?{SWING}")


def test_a_port_that_is_not_there() -> None:
    with pytest.raises(DeviceNotFound, match="cannot be opened"):
        Galvanometer(f"scpi:ASRL/dev/no-such-port::INSTR?{SWING}", QUICK)


# The exposure covers whole sweeps.


class Swinging(Galvanometer):
    """The mirror without the generator."""

    def __init__(self, frequency: float) -> None:
        self._name, self.swing = "scpi:x", Swing(frequency, 1.0, 0.0, "sine")


@given(st.floats(1.0, 1e4), st.floats(1e-4, 10.0))
def test_an_exposure_of_whole_sweeps_or_a_refusal_with_one(frequency: float, asked: float) -> None:
    mirror = Swinging(frequency)
    assert isinstance(mirror, Sweeping)
    sweeps = frequency * asked
    try:
        mirror.check_exposure(asked)
    except DeviceRefused as e:
        assert sweeps < 50
        assert abs(sweeps - max(1, round(sweeps))) > 0.019
        offers = [float(part.split()[0]) for part in e.hint.split(": ")[1].split(" or ")]
        for offer in offers:
            mirror.check_exposure(offer)
        assert min(abs(offer - asked) for offer in offers) <= max(1.0, 1 - sweeps) / frequency
    else:
        assert sweeps >= 50 or abs(sweeps - round(sweeps)) < 0.021
        assert sweeps > 0.97


def test_the_line_is_even_after_whole_sweeps_and_not_after_others() -> None:
    """What the rule is for: how much light each part of the line gets, whenever it begins."""

    def unevenness(sweeps: float) -> float:
        worst = 0.0
        for start in (0.0, 0.2, 0.7):
            phase = [2 * math.pi * (start + sweeps * (k + 0.5) / 20000) for k in range(20000)]
            places = [math.sin(p) for p in phase]
            halves = [sum(low <= x < low + 0.4 for x in places) for low in (-0.6, 0.2)]
            worst = max(worst, abs(halves[0] - halves[1]) / max(halves))
        return worst

    assert unevenness(2.0) < 0.01
    assert unevenness(2.5) > 0.15
    assert unevenness(50.5) < 0.025


def test_a_scan_with_another_exposure_is_refused_and_lights_nothing() -> None:
    rig = Rig()
    with emulated("&lasers=left") as (device, firmware):
        hardware = Hardware(rig, rig, device)
        plan = plan_of(2, lasers=("left",), exposures=(Exposure(0.02),))
        with pytest.raises(DeviceRefused, match=r"2.10 sweeps .* 0.0190476 s \(2\)"):
            look(plan, hardware)
        assert not any(entry.outputs for entry in firmware.log)
        with pytest.raises(TurnscanError):  # its picture shows no stripe, but it is taken
            look(plan_of(2, lasers=("right",), exposures=(Exposure(0.0190476),)), hardware)
        look(plan_of(2, lasers=("left",), exposures=(Exposure(0.0190476),)), hardware)
        assert [e.outputs for e in firmware.log if e.outputs] == [frozenset({"2"})]


# Safety, as the generator's own log tells it.


def test_it_passes_the_conformance_kit() -> None:
    firmware = GeneratorFirmware()
    with Socket(firmware) as socket:
        address = f"scpi:ASRL{socket.path}::INSTR?{SWING}&lasers=a"
        check_lasers(
            lambda: closing(Galvanometer(address, QUICK)),  # type: ignore[arg-type]
            burning=lambda: frozenset({"a"} if firmware.lit else ()),
        )
    assert not firmware.swinging
    assert not any("spot" in entry.outputs for entry in firmware.log)


def test_the_first_bytes_are_off_and_the_mirror_swings_before_the_gate_opens() -> None:
    with emulated() as (device, firmware):
        said = b"".join(data for _, data in firmware.received)
        assert said.startswith(b"OUTP2 OFF\n")
        assert firmware.swinging
        device.light(LASER, 1.0)
        assert firmware.lit == {"2"}
        device.close()
        assert not firmware.swinging
        said = b"".join(data for _, data in firmware.received)
        assert said.rindex(b"OUTP1 OFF") > said.index(b"OUTP2 ON")


def test_no_laser_on_a_mirror_at_rest() -> None:
    with emulated() as (device, firmware):
        firmware._on["1"] = False
        with pytest.raises(DeviceRefused, match="bright spot"):
            device.light(LASER, 1.0)
    light_at_rest()


def light_at_rest() -> None:
    """The guard sees to it by itself, whatever the driver believes."""
    with emulated() as (device, firmware):
        firmware._on["1"] = False
        with suppress(TurnscanError):
            device._link.light(1, 1.0)
        assert not any(entry.outputs for entry in firmware.log)


def test_a_guard_that_does_not_ask_for_the_mirror_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = mutated(tmp_path, r'asked = [("OUTP1?\n", _ON), *(', "asked = [*(")
    inner = GuardedLink.__init__
    monkeypatch.setattr(
        GuardedLink, "__init__", lambda self, *a, **k: inner(self, *a, **k, script=script)
    )
    with pytest.raises(AssertionError):
        light_at_rest()


@pytest.mark.parametrize(
    "line",
    [b"OUTP2 ON\n", b"outp2 1\n", b"OUTPUT2:STATE ON\n", b":OUTP2 ON\n", b"OUTP1 ON;:OUTP2 ON\n",
     b"OUTP ON\n", b"SOUR2:APPL:DC DEF,DEF,5\n", b"*RCL 1\n", b"MEM:STAT:RCL 1\n"],
)  # fmt: skip
def test_the_guard_passes_no_lighting_line_on(line: bytes) -> None:
    with emulated() as (device, firmware):
        with suppress(SafetyError, DeviceDisconnected):
            device._link.write(line)
        device._link._guard.wait(timeout=60.0)
        time.sleep(0.02)
        assert not any(entry.outputs for entry in firmware.log)


def test_a_killed_guard_and_a_deaf_generator() -> None:
    with emulated() as (device, firmware):
        device.light(LASER, 2.0)
        os.kill(device._link.guard_pid, signal.SIGKILL)
        assert wait_dark(firmware, 3.0) < 1.5  # the lease is 2 s
        with pytest.raises(SafetyError, match="guard died"):
            device.light(LASER, 2.0)
    with emulated() as (device, firmware):
        device.light(LASER, 2.0)
        firmware._deaf_until = math.inf
        with pytest.raises(LaserStateUnknown, match="cut the power"):
            device.off()
        firmware._deaf_until = 0.0


SCAN = """
import sys, time
from turnscan.devices import burning, open_lasers
lasers = open_lasers(sys.argv[1])
with burning(lasers, frozenset(lasers.names)):
    print("lit", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_dark_after_the_scanner(how: str) -> None:
    firmware = GeneratorFirmware()
    with Socket(firmware) as socket:
        address = f"scpi:ASRL{socket.path}::INSTR?{SWING}"
        child = subprocess.Popen([sys.executable, "-c", SCAN, address], stdout=subprocess.PIPE)
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == b"lit\n"
            assert firmware.lit == {"2"}
            child.send_signal(getattr(signal, how))
            assert wait_dark(firmware, 30.0) < (1.5 if how == "SIGKILL" else math.inf)
        finally:
            child.kill()
            child.communicate()


def test_beside_the_table_of_another_board() -> None:
    from tests.devices.boards import SCALE
    from tests.devices.boards import firmware as board_of

    generator, board = GeneratorFirmware(), board_of("grbl")
    with Socket(board, scale=SCALE) as table, Socket(generator) as socket:
        light = f"scpi:ASRL{socket.path}::INSTR?{SWING}&lasers=line"
        with open_devices(f"grbl:{table.path}?lasers=a", light) as devices:
            assert devices.lasers.names == ("line",)
            devices.turntable.move_to(0.1, 5.0)
            devices.lasers.light(frozenset({"line"}), 1.0)
            assert generator.lit
        assert not generator.lit
        assert not generator.swinging
    assert not any(entry.outputs for entry in board.log)


def test_what_may_be_off_is_off_whatever_else_fails() -> None:
    with emulated() as (device, firmware):
        device.light(LASER, 2.0)
        with pytest.raises(DeviceError):
            device.light(frozenset({"laser1", "x"}), 1.0)
        device.off()
        device.off()
        assert not firmware.lit

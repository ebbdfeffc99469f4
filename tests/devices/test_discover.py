"""Which board is behind a port? An answer within 3 s, whatever is there, and nothing lit."""

from __future__ import annotations

import os
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import serial
from click.testing import CliRunner

from tests.devices.boards import DIALECTS, PATIENT, SCALE, firmware
from tests.metronome import Metronome
from turnscan.cli import turnscan
from turnscan.devices import _discover, open_turntable, probe_port
from turnscan.devices._port_error import port_error, who_may_open
from turnscan.devices._registry import board
from turnscan.errors import DeviceAlarm, DeviceNotFound, DeviceRefused, DeviceRestarted
from turnscan.simulate.controllers import Firmware, GrblFirmware, SardauscanFirmware, Socket

LONGEST = 3.0


@contextmanager
def talker(answer: Callable[[bytes], bytes | None]) -> Iterator[str]:
    """A port behind which something answers what it hears; None pulls the cable."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    over = threading.Event()

    def run() -> None:
        while not over.is_set():
            try:
                said = answer(os.read(master, 4096))
            except OSError:
                return
            if said is None:
                os.close(master)
                return
            os.write(master, said)

    os.close(slave)
    keeper = os.open(path, os.O_RDWR | os.O_NOCTTY)
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield path
    finally:
        over.set()
        with suppress(OSError):
            os.write(keeper, b"\n")  # wakes the one that listens
        thread.join(timeout=30.0)
        os.close(keeper)


def interleaved(heard: bytes) -> bytes:
    return b"Gok\r\nrbl 1.ok\r\n1h ['$' for ok\r\n help]\r\n"


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda heard: b"", "no response at 115200"),
        (lambda heard: heard, "not a controller that turnscan knows"),
        (lambda heard: b'echo:Unknown command: "M22"\r\nok\r\n', "echo:Unknown command"),
        (lambda heard: b"login: ", "login:"),
        (lambda heard: bytes([0x9C, 0xE0, 0x80, 0xFF] * 4), "unreadable data at every rate"),
        (interleaved, "not a controller that turnscan knows"),
        (lambda heard: None, "disconnected"),
    ],
    ids=["silent", "loopback", "marlin", "login", "noise", "interleaved", "pulled"],
)  # fmt: skip
def test_a_port_that_is_no_board(
    answer: Callable[[bytes], bytes | None], said: str, metronome: Metronome
) -> None:
    with talker(answer) as path:
        told: list[str] = []
        begin = time.monotonic()
        found = probe_port(path, tell=told.append)
        took = metronome.served(begin, time.monotonic())
    assert found.address == ""
    assert said in found.why_not
    assert "\n" not in found.why_not
    assert took < LONGEST
    assert told[0] == f"{path}: asking at 115200 baud"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_board_is_found_and_left_as_it_was(dialect: str, metronome: Metronome) -> None:
    fw = firmware(dialect)
    with Socket(fw, scale=SCALE) as socket:
        begin = time.monotonic()
        found = probe_port(socket.path)
        assert metronome.served(begin, time.monotonic()) < LONGEST
        assert found.address == f"{dialect}:{socket.path}", found.why_not
    assert fw.turns == 0
    assert fw._moves == fw._lights == 0
    assert not any(entry.outputs for entry in fw.log)


def test_a_board_that_takes_its_time_to_boot_is_found() -> None:
    class Slow(GrblFirmware):
        boot = 1.4

    with Socket(Slow(), reset_on_open=True) as socket:
        assert probe_port(socket.path).address == f"grbl:{socket.path}"


def test_a_computer_that_stalls_while_it_asks_still_finds_the_board(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The deadline of the port passes between writing a question and the look at the clock."""
    write, late = serial.Serial.write, []

    def stalled(port: serial.Serial, data: bytes) -> int | None:
        written = write(port, data)
        if len(late) < 3:
            late.append(data)
            raise serial.SerialTimeoutException("Write timeout")
        return written

    monkeypatch.setattr(serial.Serial, "write", stalled)
    with Socket(firmware("grbl"), scale=SCALE) as socket:
        assert probe_port(socket.path).address == f"grbl:{socket.path}"
    assert late


def test_a_silent_port_on_the_command_line(metronome: Metronome) -> None:
    with talker(lambda heard: b"") as path:
        begin = time.monotonic()
        done = CliRunner().invoke(turnscan, ["devices", path])
        took = metronome.served(begin, time.monotonic())
    assert done.exit_code == 1
    assert f"{path}: no controller (no response at 115200" in done.output
    assert f"{path}: asking at 9600 baud" in done.output
    assert took < LONGEST + 3.0  # cameras are looked for, too


def test_no_permission_names_the_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import grp

    port = tmp_path / "port"
    port.touch()
    port.chmod(0o660)
    group = grp.getgrgid(port.stat().st_gid).gr_name

    def refused(*_: object) -> object:
        raise PermissionError(13, f"could not open port {port}: [Errno 13] Permission denied")

    monkeypatch.setattr(_discover, "open_port", refused)
    why = probe_port(str(port)).why_not
    assert why.startswith(f"{port}: no permission to open it → join the group {group} ")
    error = port_error(str(port), "absent", "[Errno 13] could not open port x: [Errno 13]: 'x'")
    assert isinstance(error, DeviceRefused)
    assert f"usermod -aG {group}" in str(error)
    port.chmod(0o600)
    assert "ask the administrator of this computer" in who_may_open(str(port))


def test_a_port_that_is_not_there(tmp_path: Path, metronome: Metronome) -> None:
    begin = time.monotonic()
    assert "no such port" in probe_port(str(tmp_path / "none")).why_not
    (tmp_path / "file").write_text("no port")
    assert probe_port(str(tmp_path / "file")).address == ""
    assert metronome.served(begin, time.monotonic()) < LONGEST


def locked_board(fw: Firmware, path: str, *, moving: bool) -> float:
    """Scan a little, and then an alarm comes, in a move or at rest; the angle at the end."""
    device = board(f"grbl:{path}?lasers=a", deadlines=PATIENT)
    at = device.move_to(0.5, 5.0)
    if moving:
        rest = fw.steps

        def alarm() -> None:
            while fw.steps == rest:  # before the first step nothing is lost
                time.sleep(0.001)
            fw._alarm(1)

        threading.Thread(target=alarm, daemon=True).start()
        with pytest.raises(DeviceAlarm, match=f"turnscan devices {path} acknowledge"):
            device.move_to(30.0, 30.0)
    else:
        fw._alarm(1)
        time.sleep(0.1)
        with pytest.raises(DeviceAlarm, match=f"turnscan devices {path} acknowledge"):
            device.move_to(0.7, 5.0)
    device.close()
    return float(at)


@pytest.mark.parametrize("moving", [False, True])
def test_an_alarm_is_acknowledged_from_the_command_line(moving: bool) -> None:
    fw = firmware("grbl")
    with Socket(fw, scale=SCALE) as socket:
        at = locked_board(fw, socket.path, moving=moving)
        found = board(f"grbl:{socket.path}", deadlines=PATIENT)
        assert "found in an alarm" in found.alarm
        assert f"turnscan devices {socket.path} acknowledge" in found.alarm
        found.close()
        done = CliRunner().invoke(turnscan, ["devices", socket.path, "--acknowledge"])
        assert done.exit_code == 0, (done.output, done.exception)
        kept = "lost" if moving else "known"
        assert f"the alarm was cleared; the angle of its table is {kept}" in done.output
        again = board(f"grbl:{socket.path}", deadlines=PATIENT)
        assert again.alarm == ""
        assert again.remembers == (not moving)
        if not moving:
            assert again.angle == pytest.approx(at)
        again.close()


def test_a_board_that_boots_locked_is_acknowledged() -> None:
    fw = GrblFirmware({"100": 8.889, "22": 1})
    fw.power_on()
    with Socket(fw, scale=SCALE) as socket:
        table = open_turntable(f"grbl:{socket.path}")
        locked = bool(table.alarm)  # type: ignore[attr-defined]
        table.close()  # type: ignore[attr-defined]
        done = CliRunner().invoke(turnscan, ["devices", f"grbl:{socket.path}", "--acknowledge"])
        assert done.exit_code == 0, (done.output, done.exception)
        assert ("the alarm was cleared" if locked else "no alarm") in done.output
        table = open_turntable(f"grbl:{socket.path}")
        table.move_to(0.1, 5.0)
        table.close()  # type: ignore[attr-defined]


def test_what_cannot_be_acknowledged() -> None:
    done = CliRunner().invoke(turnscan, ["devices", "--acknowledge"])
    assert "name the controller's port" in str(done.exception)
    done = CliRunner().invoke(turnscan, ["devices", "manual:", "--acknowledge"])
    assert "has no alarms" in str(done.exception)
    done = CliRunner().invoke(turnscan, ["devices", "/dev/no-such-port", "--acknowledge"])
    assert isinstance(done.exception, DeviceNotFound)


def test_a_sardauscan_that_restarts_while_lit_says_so() -> None:
    fw = SardauscanFirmware()
    with Socket(fw, scale=SCALE) as socket:
        device = board(f"sardauscan:{socket.path}?lasers=a,b", deadlines=PATIENT)
        device.light(frozenset({"a"}), 2.0)
        fw.power_on()
        time.sleep(0.05)
        with pytest.raises(DeviceRestarted, match="the controller restarted"):
            device.light(frozenset(), 2.0)
        device.close()


def test_a_port_with_lock_in_its_name_is_not_in_use() -> None:
    path = "/dev/serial/by-id/usb-Clockwork_Board-if00"
    with pytest.raises(DeviceNotFound, match="no such port"):
        board(f"grbl:{path}", deadlines=PATIENT)
    assert "in use" not in probe_port(path).why_not

"""S3, S4, S5, S9: the guard's own death, off from any state, dark first, no laser by mistake."""

from __future__ import annotations

import ast
import ctypes
import math
import os
import re
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import turnscan.devices
from tests.devices.signals import interrupted
from tests.metronome import Metronome
from tests.safety.faults import DIALECTS, SCALE, firmware, until
from turnscan.devices import _lit, alive, burning, open_devices, open_lasers, open_turntable
from turnscan.devices._dialects import DIALECTS as TABLE
from turnscan.devices._guard import (
    LONGEST_FRAME,
    LONGEST_LEASE,
    NICENESS,
    UNKNOWN,
    Frames,
    pack,
)
from turnscan.devices._guard_client import Deadlines, GuardedLink
from turnscan.devices._line_protocol import objection
from turnscan.devices._registry import board
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
    DeviceGarbled,
    DeviceRefused,
    DeviceRestarted,
    DeviceTimeout,
    InputError,
    InterlockOpen,
    LaserStateUnknown,
    LeaseEnded,
    SafetyError,
    TurnscanError,
)
from turnscan.simulate.controllers import FabScanFirmware, Fault, GrblFirmware, Socket

QUICK = Deadlines(acknowledge=0.6, move_extra=0.6, connect=5.0, keep_trying=2.0)
WITHOUT_LEASE = 1.5
"""s within which it is dark by another protection than the lease of 2 s, on a busy machine too."""
OFF = {
    "grbl": [b"\x18", b"M5\n", b"M9\n"],
    "horus": [b"\x18\r\n", b"M70T1\r\n", b"M70T2\r\n"],
    "fabscan": [b"\nM22\n", b"M20\n", b"M22\n", b"M20\n"],
    "sardauscan": [
        b"\rL 1 0\r",
        *[b"L %d 0\r" % i for i in (0, 2, 3)],
        b"\r" * 24 + b"L 1 0\r",
        *[b"L %d 0\r" % i for i in (0, 2, 3)],
    ],
}


@contextmanager
def plugged(dialect: str, **link: Any) -> Iterator[tuple[Any, Socket]]:
    with Socket(firmware(dialect), scale=SCALE) as socket:
        device = board(f"{dialect}:{socket.path}?lasers=a,b", deadlines=QUICK, **link)
        try:
            yield device, socket
        finally:
            with suppress(TurnscanError):
                device.close()


def wait_dark(socket: Socket, begin: float, patience: float = 1.0) -> float:
    """s from ``begin`` to dark, inf where it stays lit."""
    while time.monotonic() < begin + patience and socket.firmware.lit:
        time.sleep(0.002)
    log = socket.firmware.log
    return math.inf if log[-1].outputs else max(0.0, log[-1].time - begin)


_MACHINE: list[Metronome] = []


@pytest.fixture(autouse=True, scope="module")
def _machine(metronome: Metronome) -> Iterator[None]:
    _MACHINE.append(metronome)
    yield
    _MACHINE.clear()


def darkens(socket: Socket, begin: float) -> float:
    """The same, without the time in which this process stood still."""
    seconds = wait_dark(socket, begin, 30.0)
    return min(seconds, *(m.awake(begin, begin + seconds) for m in _MACHINE), math.inf)


# S3


def killed(dialect: str, metronome: Metronome) -> float:
    """s until a killed guard was noticed and all was dark; nothing goes on after it."""
    with plugged(dialect) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        assert socket.firmware.lit
        begin = time.monotonic()
        os.kill(device._link.guard_pid, signal.SIGKILL)
        until(lambda: device._link._failure is not None)
        noticed = metronome.served(begin, time.monotonic())
        assert darkens(socket, begin) < WITHOUT_LEASE
        dark = metronome.served(begin, socket.firmware.log[-1].time)
        with pytest.raises(SafetyError, match="guard died"):
            device.move_to(0.1, 1.0)
        with pytest.raises(SafetyError, match="guard died"):
            device.light(frozenset({"a"}), 1.0)
        assert not socket.firmware.lit
    return max(noticed, dark)


def test_fifty_killed_guards(metronome: Metronome) -> None:
    took = []
    for k in range(50):
        took.append(killed(DIALECTS[k % 4], metronome))
        assert took[-1] < 0.2, took
    print(f"50 killed guards: noticed and dark after {max(took) * 1e3:.0f} ms at worst")


def test_a_scanner_that_does_not_step_in_leaves_it_lit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GuardedLink, "_rescue", lambda self: None)
    with plugged("grbl") as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        begin = time.monotonic()
        os.kill(device._link.guard_pid, signal.SIGKILL)
        assert wait_dark(socket, begin, 0.5) == math.inf


def _granted() -> int:
    """The niceness that this user's processes get when they ask for the guard's."""
    code = "import contextlib, os\nwith contextlib.suppress(OSError):\n    os.setpriority(0, 0, "
    code += f"{NICENESS})\nprint(os.getpriority(0, 0))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    return int(done.stdout)


def test_a_guard_goes_before_other_work_where_it_may_and_its_scanner_does_not() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with plugged("horus") as (device, _):
        guard = device._link.guard_pid
        tasks = [int(task.name) for task in Path(f"/proc/{guard}/task").iterdir()]
        # A thread that is there before the guard has asked would stay behind.
        assert {os.getpriority(os.PRIO_PROCESS, task) for task in tasks} == {_granted()}
        assert os.getpriority(os.PRIO_PROCESS, 0) == before


def terminate(guard: int, thread: int) -> None:
    """SIGTERM to one thread of the guard, as the kernel may choose any."""
    if ctypes.CDLL(None, use_errno=True).tgkill(guard, thread, signal.SIGTERM):
        raise OSError(ctypes.get_errno(), "tgkill")


@pytest.mark.parametrize("which", ["main", "any", "last"])
def test_a_terminated_guard_leaves_dark(which: str) -> None:
    """Long before the lease would end, also where the signal does not wake the main thread."""
    with plugged("horus") as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        guard = device._link.guard_pid
        threads = sorted(int(task.name) for task in Path(f"/proc/{guard}/task").iterdir())
        begin = time.monotonic()
        if which == "any":
            os.kill(guard, signal.SIGTERM)
        else:
            terminate(guard, threads[0] if which == "main" else threads[-1])
        assert darkens(socket, begin) < WITHOUT_LEASE


def test_a_guard_that_waits_for_its_main_thread_is_found(mutant: Callable[..., Path]) -> None:
    """The lease is what ends it then: nothing else wakes the main thread before."""
    script = mutant("            guard.terminated()\n", "            pass\n")
    with plugged("horus", script=script) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        guard = device._link.guard_pid
        begin = time.monotonic()
        terminate(guard, max(int(task.name) for task in Path(f"/proc/{guard}/task").iterdir()))
        assert wait_dark(socket, begin, 3.0) > WITHOUT_LEASE


def test_a_lease_lasts_while_it_is_renewed_and_no_longer() -> None:
    with plugged("horus") as (device, socket):
        begin = time.monotonic()
        device.light(frozenset({"a"}), 1.0)
        for _ in range(6):
            time.sleep(0.25)
            device.renew(1.0)
        assert socket.firmware.lit
        assert 2.4 < wait_dark(socket, begin, 30.0) < math.inf
        device.renew(1.0)  # too late: it lights nothing
        time.sleep(0.05)
        assert not socket.firmware.lit


def test_no_lease_is_long_and_no_renewal_is_for_ever(mutant: Callable[..., Path]) -> None:
    assert LONGEST_LEASE == 2.0
    script = mutant("LONGEST_LIT = 120.0", "LONGEST_LIT = 0.4")
    with plugged("grbl", script=script) as (device, socket):
        for lease in (2.1, math.inf, math.nan, 0.0):
            with pytest.raises(DeviceRefused, match="lease"):
                device.light(frozenset({"a"}), lease)
            with pytest.raises(DeviceRefused, match="lease"):
                device.renew(lease)
        device._link.light(1, 2.0)
        begin = time.monotonic()
        while time.monotonic() < begin + 30.0 and socket.firmware.lit:
            device._link.renew(2.0)
            time.sleep(0.02)
        assert wait_dark(socket, begin, 30.0) > 0.35
        assert darkens(socket, begin) < WITHOUT_LEASE


def test_a_guard_refuses_a_long_lease_by_itself() -> None:
    """Whoever asks: the bound is the guard's own, not the driver's."""
    with plugged("grbl") as (device, socket):
        with pytest.raises(TurnscanError):
            device._link.light(1, 2.1)
        assert not any(entry.outputs for entry in socket.firmware.log)
        device._link.light(1, 0.5)
        begin = time.monotonic()
        device._link.renew(60.0)  # counts for nothing
        assert darkens(socket, begin) < WITHOUT_LEASE


def test_what_shows_signs_of_life_is_lit_throughout_and_nothing_else() -> None:
    with plugged("grbl") as (device, socket):
        with burning(device, frozenset({"a"})):
            for _ in range(12):
                time.sleep(0.2)
                alive()
            assert socket.firmware.lit
        assert not socket.firmware.lit
        log = [(entry.time, bool(entry.outputs)) for entry in socket.firmware.log]
        assert [lit for _, lit in log] == [False, True, False]  # and without blinking
        begin = time.monotonic()

        def too_long() -> None:
            with burning(device, frozenset({"a"})):
                assert darkens(socket, begin) < LONGEST_LEASE + 0.5
                until(lambda: device._link._lapsed)
                alive()  # too late

        with pytest.raises(LeaseEnded):
            too_long()
        device.light(frozenset({"a"}), 1.0)  # nobody has to acknowledge that


def test_garbage_on_the_guards_input_is_dark() -> None:
    with plugged("grbl") as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        begin = time.monotonic()
        device._link._guard.stdin.write(b"not a frame at all")
        assert darkens(socket, begin) < WITHOUT_LEASE


def test_a_guard_that_swallows_garbage_stays_lit(mutant: Callable[..., Path]) -> None:
    script = mutant('raise ValueError("not a frame")', "self._bytes.clear(); return")
    with plugged("grbl", script=script) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        begin = time.monotonic()
        device._link._guard.stdin.write(b"not a frame at all")
        assert wait_dark(socket, begin, 0.4) == math.inf


@given(st.binary(max_size=200))
def test_frames_are_whole_or_an_error(data: bytes) -> None:
    frames = Frames(b"WLDEQ")
    try:
        for kind, payload in frames.feed(data):
            assert pack(kind, payload) in data
    except ValueError:
        pass


def test_frames_too_long_are_refused_at_their_head() -> None:
    """Else the guard would wait for the rest, deaf to what follows."""
    whole = pack(b"W", bytes(LONGEST_FRAME))
    assert list(Frames(b"WLDEQ").feed(whole)) == [(b"W", bytes(LONGEST_FRAME))]
    for length in (LONGEST_FRAME + 1, 65535):
        with pytest.raises(ValueError, match="not a frame"):
            list(Frames(b"WLDEQ").feed(struct.pack("<cHI", b"W", length, 0)))


# S4


def count_offs(socket: Socket, dialect: str) -> int:
    """How often the whole of the dark bytes came in."""
    said = b"".join(data for _, data in socket.firmware.received)
    whole, count, at = OFF[dialect], 0, 0
    while True:
        for part in whole:
            at = said.find(part, at)
            if at < 0:
                return count
            at += len(part)
        count += 1


STATES = ("fresh", "lit", "moved", "refused", "timed out", "alarm", "guard dead", "closed")


def bring(device: Any, socket: Socket, state: str) -> None:
    if state == "lit":
        device.light(frozenset({"a", "b"}), 2.0)
    elif state == "moved":
        device.move_to(0.3, 5.0)
    elif state == "refused":
        with pytest.raises(DeviceRefused):
            device.light(frozenset({"c"}), 2.0)
    elif state == "timed out":
        socket.firmware.faults.append(Fault(socket.firmware._moves + 1, "silence"))
        with pytest.raises(TurnscanError):
            device.move_to(device.angle + 0.3, 0.3)
    elif state == "alarm":
        device._lose(DeviceRefused("on purpose"))
    elif state == "guard dead":
        os.kill(device._link.guard_pid, signal.SIGKILL)
        device._link._guard.wait(timeout=60.0)
    elif state == "closed":
        device.close()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("state", STATES)
def test_off_always_transmits(dialect: str, state: str) -> None:
    with plugged(dialect) as (device, socket):
        bring(device, socket, state)
        before = count_offs(socket, dialect)
        device.off()
        assert count_offs(socket, dialect) > before
        device.off()
        assert count_offs(socket, dialect) > before + 1
        assert not socket.firmware.lit


@settings(max_examples=12, suppress_health_check=list(HealthCheck))
@given(
    st.lists(st.sampled_from(["light", "dark", "move", "off", "thread"]), min_size=3, max_size=8)
)
def test_off_after_any_history(history: list[str]) -> None:
    with plugged("grbl") as (device, socket):
        for what in history:
            before = count_offs(socket, "grbl")
            if what == "light":
                device.light(frozenset({"a"}), 2.0)
            elif what == "dark":
                device.light(frozenset(), 2.0)
            elif what == "move":
                device.move_to(device.angle + 0.05, 5.0)
            elif what == "off":
                device.off()
            else:
                thread = threading.Thread(target=device.off)
                thread.start()
                thread.join(timeout=60.0)
            if what in ("off", "thread"):
                assert count_offs(socket, "grbl") > before
                assert not socket.firmware.lit


def test_off_that_remembers_its_last_state_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The usual mistake, dark is believed because it was dark before, fails the test above."""
    inner = GuardedLink.dark
    monkeypatch.setattr(
        GuardedLink, "dark", lambda self: inner(self) if self._maybe_lit.is_set() else b""
    )
    with plugged("grbl") as (device, socket):
        before = count_offs(socket, "grbl")
        device.off()
        assert count_offs(socket, "grbl") == before


@contextmanager
def slow_table() -> Iterator[tuple[Any, Any]]:
    """A driver and its board, which takes half a minute to 3 rad."""
    with (
        Socket(GrblFirmware({"100": 8.889, "110": 300, "120": 800})) as socket,
        closing(board(f"grbl:{socket.path}?lasers=a", deadlines=QUICK)) as device,
    ):
        yield device, socket.firmware


def broken_off(device: Any, firmware: Any, act: Callable[[], None]) -> TurnscanError:
    """The error of a move to 3 rad where ``act`` is done once the table turns."""
    errors: list[TurnscanError] = []

    def turn() -> None:
        try:
            device.move_to(3.0, 30.0)
        except TurnscanError as e:
            errors.append(e)

    thread = threading.Thread(target=turn)
    thread.start()
    until(lambda: firmware.rate > 0.0)
    act()
    thread.join(timeout=60.0)
    assert not thread.is_alive()
    return errors[0]


def test_off_in_the_middle_of_a_move() -> None:
    with slow_table() as (device, firmware):
        assert "lasers were switched off" in str(broken_off(device, firmware, device.off))
        # Nothing was lit, so the guard let the table come to rest first: its place is known.
        assert not device.alarm
        assert device.move_to(0.05, 5.0) == pytest.approx(0.05, abs=1e-3)
        assert firmware.turns * 2 * math.pi == pytest.approx(0.05, abs=2e-3)


ON_THE_WIRE = 8192
"""Bytes that a pseudo-terminal holds on the far side, where nobody can take them back."""


def test_off_after_a_signal_at_any_line_of_sending() -> None:
    with plugged("grbl") as (device, _):
        link = device._link
        for number in range(1, 100):
            where = interrupted(lambda: link.write(b"?"), number, ("devices/_guard_client.py",))
            device.off()
            assert link._guard.poll() is None, (number, where, "it was taken for one that hangs")
            with ThreadPoolExecutor(1) as other:
                assert not other.submit(link._sending).result(), (number, where)
            if not where:
                break
        assert number > 10
        assert not where


def _with_full_buffers(**link: Any) -> tuple[int, int]:
    """How many bytes came in before the off byte, and how many had been sent before it."""
    with plugged("grbl", **link) as (device, socket):
        seen, sent = len(socket.firmware.received), 0
        with socket.frozen():
            time.sleep(0.02)
            for _ in range(40):
                device._link.write(b"G4 P0\n" * 167)
                sent += 1002
            time.sleep(0.1)

            def off() -> None:
                with suppress(LaserStateUnknown):
                    device.off()

            thread = threading.Thread(target=off)
            thread.start()
            thread.join(timeout=30.0)  # it is not confirmed, and repeated

        def received() -> bytes:
            return b"".join(d for _, d in socket.firmware.received[seen:])

        until(lambda: b"\x18" in received())
        return received().index(b"\x18"), sent


def test_off_overtakes_a_full_send_buffer() -> None:
    before, sent = _with_full_buffers()
    assert sent == 40_080
    assert before <= ON_THE_WIRE


def test_without_overtaking_it_stands_in_line(mutant: Callable[..., Path]) -> None:
    before, _ = _with_full_buffers(script=mutant("self._port.reset_output_buffer()", "pass"))
    assert before > 1.5 * ON_THE_WIRE


# S5


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_first_bytes_are_off(dialect: str) -> None:
    with plugged(dialect) as (_, socket):
        said = b"".join(data for _, data in socket.firmware.received)
        assert said.startswith(OFF[dialect][0])
        assert not any(entry.outputs for entry in socket.firmware.log)


@pytest.mark.parametrize(
    ("heard", "meant", "said"),
    [
        (b"", DeviceTimeout, "no answer"),
        (b" \r\n", DeviceTimeout, "no answer"),
        (b"<Door:1|MPos:0.0>\r\n", InterlockOpen, "door"),
        (b"ALARM:1\r\n<Door:0>", InterlockOpen, "door"),
        (b"ALARM:1\r\n", DeviceAlarm, "ALARM:1"),
        (b"error:9\r\n", DeviceAlarm, "error:9"),
        (b"error: Alarm lock\r\n", DeviceAlarm, "Alarm lock"),
        (b"\r\nGrbl 1.1f ['$' for help]\r\n", DeviceRestarted, "Grbl 1.1f"),
        (b"Horus 0.1\r\n", DeviceRestarted, "Horus 0.1"),
        (b"Sardauscan V0.1a\r\n", DeviceRestarted, "Sardauscan"),
        (b"error:20\r\n", DeviceRefused, "error:20"),
        (b"error:90\r\n", DeviceRefused, "error:90"),
        (b"#!*\r\n", DeviceGarbled, "#!*"),
    ],
)
def test_what_a_board_objects_to_light_passes_on_as_its_own_error(
    heard: bytes, meant: type[TurnscanError], said: str
) -> None:
    error = objection("/dev/ttyX", heard)
    assert type(error) is meant
    assert "/dev/ttyX" in str(error)
    assert said in str(error)


def test_a_crowd_of_signs_of_life_is_one_renewal() -> None:
    """A picture a millisecond would else be a message to the guard each."""
    renewed: list[float] = []
    fire = _lit._Fire(SimpleNamespace(renew=renewed.append))
    fire._renewed -= 0.5
    for _ in range(20):
        fire.renew()
    assert len(renewed) < 5


def test_a_long_exposure_passes_for_a_sign_of_life_as_long_as_it_lasts() -> None:
    renewed: list[float] = []
    fire = SimpleNamespace(seen=time.monotonic() - 5.0, renew=lambda: renewed.append(1.0))
    token = _lit._FIRE.set(fire)  # type: ignore[arg-type]
    try:
        _lit.exposing(4.0)
        assert not renewed
        _lit.exposing(600.0)
        assert len(renewed) == 1
    finally:
        _lit._FIRE.reset(token)


@pytest.mark.parametrize("earlier", [None, DeviceTimeout("earlier")])
def test_what_a_guard_did_unasked_passes_as_the_links_failure(
    earlier: TurnscanError | None,
) -> None:
    """Dark that nobody confirmed, and a guard that ended; what failed first is not forgotten."""
    link = GuardedLink.__new__(GuardedLink)
    link.settings = SimpleNamespace(port="/dev/ttyX")  # type: ignore[assignment]
    link._maybe_lit, link._closing = threading.Event(), threading.Event()
    link._unasked_darks, link._answers, link._barred = 0, {}, None
    link._failure = earlier
    link._by_itself(UNKNOWN, b"", b"")
    assert link._failure is earlier if earlier else isinstance(link._failure, LaserStateUnknown)
    link._guard = SimpleNamespace(wait=lambda timeout: 0)  # type: ignore[assignment]
    link._failure = earlier
    link._see_off()
    assert link._failure is earlier if earlier else "has ended" in str(link._failure)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_board_that_knows_no_hold_is_sent_none(dialect: str) -> None:
    """Where nothing is lit the table comes to rest first, by a word that some boards misread."""
    with plugged(dialect) as (device, socket):
        device.off()
        said = b"".join(data for _, data in socket.firmware.received)
        assert (b"!" in said) == TABLE[dialect].holds


@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_off_that_nobody_confirms(dialect: str) -> None:
    with plugged(dialect) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        socket.firmware._deaf_until = math.inf
        with pytest.raises(LaserStateUnknown, match="cut the power") as caught:
            device.off()
        assert caught.value.exit_code == 4
        socket.firmware._deaf_until = 0.0


def test_a_board_that_shows_its_banner_but_confirms_nothing() -> None:
    class Deaf(GrblFirmware):
        def _tell(self, code: int | None) -> None:
            pass

    with Socket(Deaf(), scale=SCALE) as socket, pytest.raises(LaserStateUnknown):
        board(f"grbl:{socket.path}", deadlines=Deadlines(0.1, 0.1, 0.3))


def test_a_guard_that_believes_an_off_is_found(mutant: Callable[..., Path]) -> None:
    script = mutant("self._answer(seq, result if self._sure else UNKNOWN, objection, said)",
                    "self._answer(seq, result, objection, said)")  # fmt: skip
    with plugged("grbl", script=script) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        socket.firmware._deaf_until = math.inf
        device.off()  # no error though nobody confirmed it: what the test above forbids
        assert socket.firmware.lit
        socket.firmware._deaf_until = 0.0


def test_a_lease_that_ran_out_is_reported() -> None:
    with plugged("fabscan") as (device, socket):
        device.light(frozenset({"a"}), 0.1)
        assert darkens(socket, time.monotonic()) < WITHOUT_LEASE
        until(lambda: device._link._lapsed)
        with pytest.raises(DeviceTimeout, match="lease"):
            device.light(frozenset(), 1.0)


# S7


@pytest.mark.parametrize("stubborn", [False, True])
def test_a_door_that_opens_while_lit(stubborn: bool, metronome: Metronome) -> None:
    """Dark within 100 ms each time, even where the board's own door does not put the laser out."""
    with plugged("grbl") as (device, socket):
        board_ = socket.firmware
        for k in range(5):
            device.light(frozenset({"a"}), 2.0)
            begin = time.monotonic()
            if stubborn:
                board_.say(b"[MSG:Check Door]\r\n")
            else:
                board_.open_door()
            assert darkens(socket, begin) < WITHOUT_LEASE
            assert metronome.served(begin, board_.log[-1].time) < 0.1
            with pytest.raises(InterlockOpen):
                device.light(frozenset({"a"}), 2.0)
            for _ in range(3):  # it never goes on by itself
                with pytest.raises(DeviceAlarm, match="acknowledge"):
                    device.light(frozenset({"a"}), 2.0)
                with pytest.raises(DeviceAlarm, match="acknowledge"):
                    device.move_to(0.1, 1.0)
            assert not board_.lit
            device.acknowledge()
            assert device.move_to(0.1 * (k + 1), 5.0)


def relit(device: Any, socket: Socket) -> bool:
    """Whether an order that comes before the scanner has heard of the door lights a laser."""
    device.light(frozenset({"a"}), 2.0)
    lit = sum(bool(entry.outputs) for entry in socket.firmware.log)
    socket.firmware.say(b"[MSG:Check Door]\r\n")
    until(lambda: not socket.firmware.lit)
    device._link._ask(b"L", struct.pack("<dB", 2.0, 1))
    return sum(bool(entry.outputs) for entry in socket.firmware.log) > lit


def test_nothing_is_lit_after_a_door_before_the_scanner_has_heard_of_it() -> None:
    with plugged("grbl") as (device, socket):
        assert not relit(device, socket)
        with pytest.raises(InterlockOpen):
            device.light(frozenset({"a"}), 2.0)
        device.acknowledge()
        device.light(frozenset({"a"}), 2.0)
        assert socket.firmware.lit


def test_a_guard_that_forgets_the_door_is_found(mutant: Callable[..., Path]) -> None:
    script = mutant("if mask and self._barred:", "if False:")
    with plugged("grbl", script=script) as (device, socket):
        assert relit(device, socket)


def test_a_guard_deaf_to_the_door_is_found(mutant: Callable[..., Path]) -> None:
    with plugged("grbl", script=mutant(' or b"Door" in self._tail', "")) as (device, socket):
        device.light(frozenset({"a"}), 2.0)
        socket.firmware.say(b"[MSG:Check Door]\r\n")
        assert wait_dark(socket, time.monotonic(), 0.3) == math.inf


def test_a_door_that_opens_while_turning() -> None:
    with slow_table() as (device, firmware):
        assert isinstance(broken_off(device, firmware, firmware.open_door), InterlockOpen)


# S9


@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(st.floats(allow_nan=True), st.text(max_size=6))
def test_no_lease_and_no_name_out_of_range(
    quiet: tuple[Any, Socket], lease: float, name: str
) -> None:
    device, socket = quiet
    if not 0.0 < lease <= LONGEST_LEASE:
        with pytest.raises(DeviceRefused):
            device.light(frozenset({"a"}), lease)
    if name not in ("a", "b"):
        with pytest.raises(DeviceRefused, match="no laser"):
            device.light(frozenset({"a", name}), 1.0)
    assert not any(entry.outputs for entry in socket.firmware.log)


@pytest.fixture
def quiet() -> Iterator[tuple[Any, Socket]]:
    with plugged("grbl") as pair:
        yield pair


@given(st.integers())
@settings(max_examples=60)
def test_power_out_of_range_raises_and_is_never_clipped(power: int) -> None:
    if 0 < power <= 10_000:
        return
    with pytest.raises(InputError):
        open_lasers(f"grbl:/dev/null?outputs=m3:{power}")


# S12

LIGHTS = {
    "grbl": [b"M3 S1000\n", b"m 4 s1\n", b"M08\n", b"G1 X1 M7\n", b"M(dark)3 S5\n", b"M/3\n",
             b"$N0=M3\n"],
    "horus": [b"M71T1\r\n", b"m 71 T2\r\n", b"G1F1M71T1\r\n"],
    "fabscan": [b"M21\n", b"M19;\n", b"X M021\n"],
    "sardauscan": [b"L 0 1\r", b"\rL 2 7\r"],
}  # fmt: skip


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_guard_passes_no_lighting_line_on(dialect: str) -> None:
    for line in LIGHTS[dialect]:
        with plugged(dialect) as (device, socket):
            with suppress(SafetyError, DeviceDisconnected):
                device._link.write(line[:1])
                device._link.write(line[1:])
            device._link._guard.wait(timeout=60.0)  # it ends, and the scanner hears of it
            assert not any(entry.outputs for entry in socket.firmware.log), line


WORDS = re.compile(
    r"^(?:\s|[GXFT\d.])*M0*(?:3|4|7|8|71|19|21)(?!\d)|^\s*L \S|OUTP\w*(?!1)\d[\w:]* (?:ON|1)"
)


def test_no_other_module_of_the_devices_knows_how_to_light() -> None:
    """Neither its bytes nor a port of its own: what lights lies in _dialects.py alone."""
    folder = Path(turnscan.devices.__file__).parent
    found = []
    for path in sorted(folder.rglob("*.py")):
        if path.name == "_dialects.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes):
                text = node.value if isinstance(node.value, str) else node.value.decode("latin-1")
                if WORDS.search(text):
                    found.append((path.name, text[:40]))
            if isinstance(node, ast.Import | ast.ImportFrom):
                module = getattr(node, "module", None) or node.names[0].name
                if module.split(".")[0] == "serial" and module != "serial.tools":
                    found.append((path.name, "imports serial"))
                if module.split(".")[0] == "pyvisa" and path.name != "_visa.py":
                    found.append((path.name, "imports pyvisa"))
    assert not found
    assert set(TABLE) == {*DIALECTS, "scpi"}


def test_the_contract_sees_a_line_that_lights(tmp_path: Path) -> None:
    for text in ("M3 S1000\n", "G1 F100 M3 S5", "M71T1", "M21\n", "L 0 1\r", "OUTP2 ON"):
        assert WORDS.search(text)
    for text in ("M5", "M9", "M70T1", "M17", "M22", "Lasers are dark", "OUTP1 ON"):
        assert not WORDS.search(text)


# One board, two roles


def test_table_and_lasers_of_one_board_share_its_port() -> None:
    with Socket(FabScanFirmware(), scale=SCALE) as socket:
        with open_devices(f"fabscan:{socket.path}") as devices:
            devices.lasers.light(frozenset({"laser1"}), 1.0)
            assert socket.firmware.lit == {"right"}
            devices.turntable.move_to(0.1, 5.0)  # never lit while it turns
            assert not socket.firmware.lit
        with pytest.raises(DeviceRefused, match="in use"), open_devices(f"fabscan:{socket.path}"):
            open_turntable(f"fabscan:{socket.path}")

"""The laser guard: a tiny process that owns the port and goes dark whenever in doubt.

It runs as a script of its own, so it imports nothing but the standard library and pyserial (and,
for an instrument, PyVISA). The scanner talks to the port only through it, in checked frames on its
standard input and output:

    scanner → guard   W bytes to the port            L seq, lease, mask of the lasers to light
                      D seq: dark, from any state    E lease: what is lit may stay so long
                      Q dark and goodbye
    guard → scanner   R bytes from the port          H the port is open, and whether dark
                      A seq, result, what it heard  U the port is gone

The lasers go dark on the end of its input (the scanner died, however), when a lease runs out that
nobody renewed, on any frame that does not check, and when the board tells of an alarm or an open
door; after that nothing is lit before the scanner itself has asked for dark. No lease is longer
than 2 s. These are the only bytes in turnscan that light a laser, and nothing else can send them: a
W frame with such a line is refused.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import re
import signal
import socket
import struct
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

DONE, UNKNOWN, FAILED, LAPSED = 0, 1, 2, 3
"""Results in an A frame: as asked; dark was not confirmed; the board objected and it is dark;
dark because a lease ran out (seq 0)."""

LONGEST_FRAME = 4096
LONGEST_LEASE = 2.0
LONGEST_HOLD = 1.0
"""s that a table, with nothing lit, has to come to rest before a reset, which loses its place."""
LONGEST_LIT = 120.0
"""s that a laser burns at most, however often its lease is renewed."""
_HEAD = struct.Struct("<cHI")


def pack(kind: bytes, payload: bytes = b"") -> bytes:
    """A frame: kind, length, checksum, payload."""
    return _HEAD.pack(kind, len(payload), zlib.crc32(kind + payload)) + payload


class Frames:
    """Bytes into frames; raises ValueError on the first that does not check."""

    def __init__(self, kinds: bytes) -> None:
        self._kinds = kinds
        self._bytes = bytearray()

    def feed(self, data: bytes) -> Iterable[tuple[bytes, bytes]]:
        """The frames that these bytes complete."""
        self._bytes += data
        while len(self._bytes) >= _HEAD.size:
            kind, length, check = _HEAD.unpack_from(self._bytes)
            if kind not in self._kinds or length > LONGEST_FRAME:
                raise ValueError("not a frame")
            if len(self._bytes) < _HEAD.size + length:
                return
            payload = bytes(self._bytes[_HEAD.size : _HEAD.size + length])
            del self._bytes[: _HEAD.size + length]
            if zlib.crc32(kind + payload) != check:
                raise ValueError("checksum")
            yield kind, payload


@dataclass(frozen=True)
class Exchange:
    """Bytes to send and what confirms them."""

    send: bytes
    confirm: re.Pattern[bytes]
    refuse: re.Pattern[bytes] = re.compile(rb"error[: ][^\r\n]*\r\n|ALARM:|Check Door|Hun\?\r\n")


def _x(send: str, confirm: str) -> Exchange:
    return Exchange(send.encode(), re.compile(confirm.encode()))


@dataclass(frozen=True)
class Dialect:
    """How one kind of board switches lasers."""

    name: str
    baud: int
    most: int
    """Lasers it can switch."""
    dark: Callable[[tuple[str, ...]], list[Exchange]]
    light: Callable[[tuple[str, ...], int], list[Exchange]]
    lights: re.Pattern[bytes]
    """Lines that light a laser, or could; never passed on from the scanner."""
    banner: re.Pattern[bytes]
    """What shows that a board of this kind is there."""
    holds: bool = False
    """Whether ``!`` stops its table so that a reset then keeps the place, which ``?`` tells."""


_OK = r"(?:^|\n)ok\r\n"
_STATUS = re.compile(rb"<([A-Z][A-Za-z]*)(:\d)?[|,]MPos:(-?[\d.]+)[^<>]*>")


def _grbl_dark(outputs: tuple[str, ...]) -> list[Exchange]:
    ok = rf"{_OK}|error:9\r\n"  # locked after an alarm: the reset has switched everything off
    return [_x("\x18", r"Grbl [^\r\n]*\r\n"), _x("M5\n", ok), _x("M9\n", ok)]


def _grbl_light(outputs: tuple[str, ...], mask: int) -> list[Exchange]:
    """Outputs are ``m3:POWER``, ``m7`` or ``m8``; spindle and coolant stand in separate groups."""
    lit = [output for i, output in enumerate(outputs) if mask >> i & 1]
    lines = ["M9"]
    spindle = next((o[3:] for o in lit if o.startswith("m3:")), None)
    # With $32=1 the beam comes only in modal G1; without an axis word nothing moves.
    lines += [f"G1 F100 M3 S{spindle}" if spindle else "M5"]
    lines += [o.upper() for o in lit if not o.startswith("m3:")]
    return [_x(line + "\n", _OK) for line in lines]


def _horus_dark(outputs: tuple[str, ...]) -> list[Exchange]:
    ok = rf"{_OK}|error: Alarm lock\r\n"
    off = [_x(f"M70T{output}\r\n", ok) for output in outputs]
    return [_x("\x18\r\n", r"Horus [^\r\n]*\r\n"), *off]


def _horus_light(outputs: tuple[str, ...], mask: int) -> list[Exchange]:
    # Dark ones first, and lit ones off and on again: the board cuts a laser after 255 s in silence.
    off = [_x(f"M70T{output}\r\n", _OK) for output in outputs]
    return off + [_x(f"M71T{o}\r\n", _OK) for i, o in enumerate(outputs) if mask >> i & 1]


_FABSCAN = {"right": ("M21", "M22"), "left": ("M19", "M20")}


def _fabscan_dark(outputs: tuple[str, ...]) -> list[Exchange]:
    # The first line end closes a half line that may lie in the board's buffer; all of it twice.
    once = [_x(f"{_FABSCAN[o][1]}\n", rf"{_FABSCAN[o][1]}\n>\r\n") for o in _FABSCAN]
    return [Exchange(b"\n" + once[0].send, once[0].confirm), *once[1:], *once]


def _fabscan_light(outputs: tuple[str, ...], mask: int) -> list[Exchange]:
    words = [_FABSCAN[o][1 - (mask >> i & 1)] for i, o in enumerate(outputs)]
    words.sort(key=lambda word: word in ("M19", "M21"))
    return [_x(f"{word}\n", rf"{word}\n>\r\n") for word in words]


def _sardauscan_dark(outputs: tuple[str, ...]) -> list[Exchange]:
    once = [_x(f"L {i} 0\r", rf"SET_LASER: {i}\(-?\d+\) = (?:0|-1)\r\n") for i in range(4)]
    return [Exchange(b"\r" + once[0].send, once[0].confirm), *once[1:], *once]


def _sardauscan_light(outputs: tuple[str, ...], mask: int) -> list[Exchange]:
    want = sorted((mask >> i & 1, o) for i, o in enumerate(outputs))
    return [_x(f"L {o} {v}\r", rf"SET_LASER: {o}\(-?\d+\) = {v}\r\n") for v, o in want]


_ON, _OFF = r"(?:^|\n)(?:1|ON)\r?\n", r"(?:^|\n)(?:0|OFF)\r?\n"


def _scpi_dark(outputs: tuple[str, ...]) -> list[Exchange]:
    return [_x(f"OUTP{output} OFF\nOUTP{output}?\n", _OFF) for output in outputs]


def _scpi_light(outputs: tuple[str, ...], mask: int) -> list[Exchange]:
    """The gate of the laser, and only while channel 1 swings the mirror."""
    if not mask:
        return _scpi_dark(outputs)
    asked = [("OUTP1?\n", _ON), *((f"OUTP{o} ON\nOUTP{o}?\n", _ON) for o in outputs)]
    off = re.compile(_OFF.encode())
    return [Exchange(send.encode(), re.compile(on.encode()), off) for send, on in asked]


DIALECTS: dict[str, Dialect] = {
    d.name: d
    for d in (
        Dialect(
            "grbl", 115200, 2, _grbl_dark, _grbl_light,
            re.compile(rb"M\+?0*[3478](?!\d)", re.I), re.compile(rb"Grbl "),
            holds=True,
        ),
        Dialect(
            "horus", 115200, 4, _horus_dark, _horus_light,
            re.compile(rb"M\+?0*71", re.I), re.compile(rb"Horus "),
            holds=True,
        ),
        Dialect(
            "fabscan", 115200, 2, _fabscan_dark, _fabscan_light,
            re.compile(rb"M\+?0*(?:19|21)(?!\d)", re.I), re.compile(rb"M22\n>"),
        ),
        Dialect(
            "sardauscan", 115200, 4, _sardauscan_dark, _sardauscan_light,
            re.compile(rb"(?:^|[\r\n])L", re.I), re.compile(rb"SET_LASER|Sardauscan"),
        ),
        # Any output but that of channel 1, the mirror's, and all that could switch one unseen.
        Dialect(
            "scpi", 115200, 1, _scpi_dark, _scpi_light,
            re.compile(
                rb"OUTP(?!(?:UT)?(?:1(?:ON|OFF|0|1)|\d?\?)(?:[;\r\n]|$))|APPL|\*RCL|MEM", re.I
            ),
            re.compile(f"{_ON}|{_OFF}".encode()),
        ),
    )
}  # fmt: skip


def open_port(path: str, baud: int, dtr: bool, library: str = "") -> Any:
    """Open a serial port for us alone, DTR and RTS as told; raises OSError.

    With a ``library`` of PyVISA ``path`` is a VISA resource instead.
    """
    if library:
        from turnscan.devices._visa import VisaPort

        return VisaPort(path, library, baud)
    import serial

    port = serial.Serial(timeout=0.05, write_timeout=0.05, exclusive=True)
    port.port, port.baudrate, port.dtr, port.rts = path, baud, dtr, dtr
    port.open()
    return port


def darken(
    steps: Iterable[Exchange],
    send: Callable[[bytes], None],
    hear: Callable[[float], bytes],
    patience: float,
) -> tuple[bool, bytes]:
    """Send every step, whatever comes back; True where each was confirmed, and all that was heard.

    ``hear`` returns what came within so many seconds.
    """
    sure, said = True, bytearray()
    for step in steps:
        # After a first silence the rest is sent without hope: what counts is that it goes out.
        heard, end = bytearray(), time.monotonic() + (patience if sure else patience / 8)
        send(step.send)
        while not step.confirm.search(heard) and (left := end - time.monotonic()) > 0:
            heard += hear(left)
            del heard[:-LONGEST_FRAME]
        sure = sure and step.confirm.search(heard) is not None
        said += heard
    return sure, bytes(said[-1024:])


@dataclass(frozen=True)
class Settings:
    """What the scanner tells its guard at the start."""

    port: str
    dialect: str
    outputs: tuple[str, ...]
    baud: int
    dtr: bool
    connect: float
    """s to wait for a first confirmed dark; boards boot for two."""
    confirm: float
    """s to wait for a board's answer."""
    library: str = ""
    """Of PyVISA, where the port is a VISA resource."""

    def open(self) -> Any:
        """The port. Raises OSError and ValueError."""
        return open_port(self.port, self.baud, self.dtr, self.library)


class Guard:
    """The process: one loop that owns port and lasers, threads that only listen and speak."""

    def __init__(self, settings: Settings) -> None:
        self._set = settings
        self._dialect = DIALECTS[settings.dialect]
        self._events: queue.Queue[tuple[str, bytes]] = queue.Queue(maxsize=4096)
        self._later: list[bytes] = []
        self._out: queue.Queue[bytes] = queue.Queue(maxsize=4096)
        self._port: Any = None
        self._line = b""
        self._lit, self._sure = False, False
        self._lease_end = self._last_end = 0.0
        self._leave = False
        self._barred = b""
        """What made it go dark by itself; nothing is lit until the scanner has said dark, too."""
        self._hurry = threading.Event()
        """Set while the scanner waits for dark: nothing else is sent any more."""

    def run(self) -> int:
        """Serve until told or forced to end; 0 dark for certain, 4 not, 3 no port."""
        threading.Thread(target=self._speak, daemon=True).start()
        try:
            self._open()
        except (OSError, ValueError) as e:
            busy = "lock" in str(e).lower() or getattr(e, "errno", 0) in (11, 16)
            self._tell(b"U", (b"busy " if busy else b"absent ") + str(e).encode()[:200])
            self._flush()
            return 3
        threading.Thread(target=self._listen_parent, daemon=True).start()
        self._first_dark()
        while not self._leave:
            if self._lit and time.monotonic() >= self._lease_end:
                self._dark(0, LAPSED)
            elif (event := self._next()) is not None:
                self._act(*event)
        return self.last_word()

    def leave(self) -> None:
        """Dark and goodbye, from any thread: nobody is there any more who could ask for light."""
        self._hurry.set()
        self._events.put(("end", b""))

    def last_word(self) -> int:
        """Dark once more before the end, over a port opened anew where the old one is gone."""
        end = time.monotonic() + 1.0
        while self._port is None and not self._sure and time.monotonic() < end:
            with contextlib.suppress(OSError, ValueError):
                self._open()
            time.sleep(0.02)
        if self._port is not None:
            self._dark(0, DONE)
        self._flush()
        return 0 if self._sure else 4

    def _open(self) -> None:
        self._port = self._set.open()
        threading.Thread(target=self._listen_port, args=(self._port,), daemon=True).start()

    def _first_dark(self) -> None:
        end, said = time.monotonic() + self._set.connect, b""
        while True:
            self._sure, heard = self._darken()
            said = (said + heard)[-1024:]
            if self._sure or self._leave or time.monotonic() >= end:
                self._tell(b"H", bytes([self._sure]) + said)
                return

    def _next(self) -> tuple[str, bytes] | None:
        if self._later:
            return "frame", self._later.pop(0)
        longest = 5.0
        if self._lit:
            longest = max(0.0, min(longest, self._lease_end - time.monotonic()))
        try:
            return self._events.get(timeout=longest)
        except queue.Empty:
            return None

    def _act(self, source: str, data: bytes) -> None:
        kind, payload = data[:1], data[1:]
        if source == "port":
            self._tell(b"R", data)
            if self._lit and (b"ALARM" in data or b"Door" in data):
                self._dark(0, DONE)
                self._barred = data[-256:]
        elif source == "end" or kind == b"Q":
            self._leave = True
        elif kind == b"W":
            self._pass_on(payload)
        elif kind == b"E":
            self._extend(payload)
        elif kind == b"L":
            self._light(*struct.unpack("<IdB", payload))
        elif kind == b"D":
            self._barred = b""
            self._dark(struct.unpack("<I", payload)[0], DONE)

    def _pass_on(self, data: bytes) -> None:
        """The scanner's bytes to the port, unless the line they make could light a laser."""
        self._line += data
        line = re.sub(rb"\([^)\r\n]*\)?|[ \t/]", b"", self._line)
        self._line = self._line[max(self._line.rfind(b"\n"), self._line.rfind(b"\r")) + 1 :][-256:]
        if self._dialect.lights.search(line):
            self._leave = True  # only an L frame lights; who tries otherwise is not to be trusted
        elif not self._hurry.is_set():
            self._send(data)

    def _light(self, seq: int, lease: float, mask: int) -> None:
        if not 0.0 < lease <= LONGEST_LEASE or mask >> len(self._set.outputs):
            self._dark(seq, FAILED)
            return
        if mask and self._barred:
            self._dark(seq, FAILED, self._barred)
            return
        if mask:  # counted as lit from before the first byte
            self._lit, self._sure = True, False
            self._lease_end = time.monotonic() + lease
            self._last_end = time.monotonic() + LONGEST_LIT
        for step in self._dialect.light(self._set.outputs, mask):
            heard, end = bytearray(), time.monotonic() + self._set.confirm
            self._send(step.send)
            while (found := step.confirm.search(heard)) is None:
                left = end - time.monotonic()
                if left <= 0 or self._hurry.is_set() or step.refuse.search(heard):
                    break
                heard += self._hear(min(left, 0.02))
                del heard[:-LONGEST_FRAME]
            if found is None or heard[found.end() :].strip():  # or more than was asked for
                self._dark(seq, FAILED, bytes(heard))
                return
        self._lit, self._sure = bool(mask), not mask
        self._answer(seq, DONE, b"", b"")

    def _extend(self, payload: bytes) -> None:
        """More time for what is lit; it lights nothing, so it may come late, or twice."""
        (lease,) = struct.unpack("<d", payload)
        if self._lit and 0.0 < lease <= LONGEST_LEASE:
            self._lease_end = min(time.monotonic() + lease, self._last_end)

    def _dark(self, seq: int, result: int, objection: bytes = b"") -> None:
        said = b""
        self._hurry.clear()
        self._hold_still()
        for _ in range(3):
            self._sure, heard = self._darken()
            said = (said + heard)[-1024:]
            if self._sure or self._port is None:
                break
        self._lit = False  # or unknown, which the answer says; repeating it is up to the scanner
        self._answer(seq, result if self._sure else UNKNOWN, objection, said)

    def _hold_still(self) -> None:
        """Where nothing can be lit, let the table come to rest: a reset in motion loses its place.

        It ends with `LONGEST_HOLD`, and at once where the board does not answer.
        """
        if self._lit or not self._sure or not self._dialect.holds:
            return
        end, before = time.monotonic() + LONGEST_HOLD, b""
        self._send(b"!")
        while time.monotonic() < end:
            self._send(b"?")
            heard, patience = bytearray(), time.monotonic() + self._set.confirm
            while (found := _STATUS.search(heard)) is None:
                if (left := patience - time.monotonic()) <= 0:
                    return
                heard += self._hear(left)
            state, more, place = found.groups()
            if state not in (b"Run", b"Jog", b"Hold") or (place == before and more != b":1"):
                return
            before = place
            self._hear(0.02)

    def _darken(self) -> tuple[bool, bytes]:
        """Once through the dark bytes; what still waited to be sent is thrown away first."""
        with contextlib.suppress(OSError):
            if self._port is not None:
                self._port.reset_output_buffer()
        self._line = b""
        steps = self._dialect.dark(self._set.outputs)
        return darken(steps, self._send, self._hear, self._set.confirm)

    def _send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):  # a full buffer shows as silence, a lost port by itself
            if self._port is not None:
                self._port.write(data)

    def _hear(self, longest: float) -> bytes:
        """What the port says within so long; frames of the scanner wait their turn."""
        end = time.monotonic() + longest
        while (left := end - time.monotonic()) > 0:
            try:
                source, data = self._events.get(timeout=left)
            except queue.Empty:
                break
            if source == "port":
                return data
            if source == "end":
                self._leave = True
            elif data[:1] == b"E":
                self._extend(data[1:])
            else:
                self._later.append(data)
        return b""

    def _listen_parent(self) -> None:
        frames = Frames(b"WLDEQ")
        with contextlib.suppress(OSError, ValueError):
            while data := os.read(0, 4096):
                for kind, payload in frames.feed(data):
                    if kind in b"DQ":
                        self._hurry.set()
                    self._events.put(("frame", kind + payload))
        self.leave()

    def _listen_port(self, port: Any) -> None:
        try:
            while True:
                if data := port.read(port.in_waiting or 1):
                    self._events.put(("port", data))
        except (OSError, TypeError, ValueError) as e:
            self._port = None
            with contextlib.suppress(OSError):
                port.close()
            self._tell(b"U", b"gone " + str(e).encode()[:200])
            self._events.put(("end", b""))

    def _answer(self, seq: int, result: int, objection: bytes, said: bytes) -> None:
        """What was heard before it went dark, and what since."""
        objection = objection[-1024:]
        head = struct.pack("<IBH", seq, result, len(objection))
        self._tell(b"A", head + objection + said)

    def _tell(self, kind: bytes, payload: bytes) -> None:
        with contextlib.suppress(queue.Full):  # a stopped scanner must never hold up its guard
            self._out.put_nowait(pack(kind, payload[:LONGEST_FRAME]))

    def _speak(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                os.write(1, self._out.get())
                self._out.task_done()

    def _flush(self) -> None:
        end = time.monotonic() + 0.2
        while self._out.unfinished_tasks and time.monotonic() < end:
            time.sleep(0.001)


def main(argument: str) -> int:
    """Run the guard with `Settings` in JSON."""
    given = json.loads(argument)
    guard = Guard(Settings(**{**given, "outputs": tuple(given["outputs"])}))
    for name in ("SIGINT", "SIGHUP"):  # meant for the scanner, which then ends or goes on
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    # Python runs a handler only when the main thread wakes, which may be long after; a byte in a
    # socket is there at once, whichever thread the signal hit.
    heard, told = socket.socketpair()
    told.setblocking(False)
    signal.set_wakeup_fd(told.fileno())
    signal.signal(signal.SIGTERM, lambda *_: None)

    def listen_signal() -> None:
        heard.recv(1)
        guard.leave()

    threading.Thread(target=listen_signal, daemon=True).start()
    try:
        return guard.run()
    except BaseException:
        guard.last_word()
        raise


if __name__ == "__main__":
    os._exit(main(sys.argv[1]))

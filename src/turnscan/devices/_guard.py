"""The laser guard: a small process that owns the port and goes dark whenever in doubt.

It runs as a program of its own (`_run_guard.py`), so it imports nothing but the standard library,
pyserial (and, for an instrument, PyVISA) and `_dialects.py`. The scanner talks to the port only
through it, in checked frames on its standard input and output:

    scanner → guard   W bytes to the port            L seq, lease, mask of the lasers to light
                      D seq: dark, from any state    E lease: what is lit may stay so long
                      Q dark and goodbye
    guard → scanner   R bytes from the port          H the port is open, and whether dark
                      A seq, result, what it heard   U the port is gone
                      P the guard's loop goes round  K not confirmed dark; it keeps trying

The lasers go dark on the end of its input (the scanner died, however), when a lease runs out that
nobody renewed, on any frame that does not check, and when the board tells of an alarm or an open
door; after that nothing is lit before the scanner itself has asked for dark. No lease is longer
than 2 s. A dark that the board does not confirm is repeated every second, also after the scanner
has gone and while the cable is out, for ten minutes. A W frame with a line that is not on the
dialect's list is refused.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import queue
import re
import signal
import socket
import stat
import struct
import threading
import time
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from turnscan.devices._dialects import DIALECTS, LineFilter, darken, foreign_as_oserror, open_port

DONE, UNKNOWN, FAILED, LAPSED = 0, 1, 2, 3
"""Results in an A frame: as asked; dark was not confirmed; the board objected and it is dark;
dark because a lease ran out (seq 0). Seq 0 answers nothing: FAILED is a door or an alarm."""

LONGEST_FRAME = 4096
LONGEST_LEASE = 2.0
LONGEST_HOLD = 1.0
"""s that a table, with nothing lit, has to come to rest before a reset, which loses its place."""
LONGEST_LIT = 120.0
"""s that a laser burns at most, however often its lease is renewed."""
PULSE = 0.25
"""s between two P frames while a laser may be lit, or an answer is due."""
AGAIN = 1.0
"""s from a dark that was not confirmed to the next."""
REOPEN = 0.25
"""s between two attempts to open a port that has disconnected."""
NICENESS = -10
"""The guard's, where it may choose: it works for some microseconds at a time."""
KEEP_TRYING = 600.0
"""s for which a guard that is no longer needed tries to get a dark confirmed."""
_SOON = 1.0
"""s for which it does so before it says that it has to keep trying."""
_HEAD = struct.Struct("<cHI")
_STATUS = re.compile(rb"<([A-Z][A-Za-z]*)(:\d)?[|,]MPos:(-?[\d.]+)[^<>]*>")


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


QUIET = 2.5
"""s in which a board that was opened says something; they boot for two."""


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
    keep_trying: float = KEEP_TRYING
    """s, see `KEEP_TRYING`."""
    rescue: bool = False
    """Whether it takes over from a guard that died: a laser may be lit, and nothing controls it."""
    scanner: int = 0
    """Its process id."""

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
        self._words: queue.Queue[bytes] = queue.Queue(maxsize=64)
        """For the person."""
        self._port: Any = None
        self._reader: threading.Thread | None = None
        self._filter = LineFilter(self._dialect)
        self._tail = b""
        """The end of what the board said, so that a message is heard that comes in parts."""
        self._lit, self._sure = False, False
        self._maybe = settings.rescue
        """Whether a laser may burn: it was ordered, and since then no dark was confirmed."""
        self._lease_end = self._last_end = 0.0
        self._again = self._pulsed = 0.0
        self._leave = self._informed = False
        self._terms = 0
        self._barred = b""
        """What made it go dark by itself; nothing is lit until the scanner has said dark, too."""
        self._hurry = threading.Event()
        """Set while the scanner waits for dark: nothing else is sent any more."""

    def run(self) -> int:
        """Serve until asked or forced to end; 0 dark for certain, 4 not, 3 no port."""
        threading.Thread(target=self._speak, args=(1, self._out), daemon=True).start()
        threading.Thread(target=self._speak, args=(2, self._words), daemon=True).start()
        if self._set.rescue:
            return self.last_word()
        try:
            self._open_soon()
        except (OSError, ValueError) as e:
            self._tell(b"U", (b"busy " if _busy(e) else b"absent ") + str(e).encode()[:200])
            self._flush()
            return 3
        threading.Thread(target=self._listen_parent, daemon=True).start()
        self._first_dark()
        while not self._leave:
            self._pulse()
            now = time.monotonic()
            if self._lit and now >= self._lease_end:
                self._dark(0, LAPSED)
            elif self._again and now >= self._again:
                self._dark(0, DONE, tries=1)
                self._inform()
            elif (event := self._next()) is not None:
                self._act(*event)
        return self.last_word()

    def leave(self) -> None:
        """Dark and goodbye, from any thread: no request for light can follow."""
        self._hurry.set()
        self._events.put(("end", b""))

    def terminated(self) -> None:
        """As `leave`; the second time it does not keep trying any more."""
        self._terms += 1
        self.leave()

    def last_word(self) -> int:
        """Dark once more before the end, over a port opened again where the old one was lost.

        A laser that may be lit keeps it here until dark is confirmed, for `keep_trying` s, whatever
        goes wrong meanwhile.
        """
        begin, terms, announced = time.monotonic(), self._terms, False
        end = begin + (max(self._set.keep_trying, _SOON) if self._maybe else _SOON)
        while True:
            try:
                if self._port is None and not self._sure:
                    self._open()
                if self._port is not None:
                    self._dark(0, DONE, tries=1 if announced or not self._maybe else 3)
            except Exception:  # noqa: BLE001 a port that hangs up meanwhile raises all kinds
                self._sure = False
            now = time.monotonic()
            if self._sure or now >= end or self._terms > terms:
                break
            if not self._maybe and self._port is not None:
                break
            if self._maybe and now >= begin + _SOON and not announced:
                announced = True
                self._tell(b"K", b"")
                self._inform()
            self._rest(announced)
        self._inform()
        if self._informed:
            self._say("given up: the laser may be lit")
        self._flush()
        return 0 if self._sure else 4

    def _inform(self) -> None:
        """A person hears that the laser may be lit, and that it is dark again; each once.

        From here, as the scanner may have ended, or be unable to pass it on.
        """
        if self._maybe and not self._informed:
            self._informed = True
            self._say("the laser may be lit: cut its power; turnscan keeps trying to reach it")
        elif self._informed and self._sure:
            self._informed = False
            self._say("the laser is dark")

    def _rest(self, keeps_trying: bool) -> None:
        """Until the next attempt; another program may have the port meanwhile."""
        pause = REOPEN if self._port is None else AGAIN
        if keeps_trying:
            self._let_go()
            self._keep_nobody_waiting()
        end = time.monotonic() + (pause if keeps_trying else 0.02)
        while (left := end - time.monotonic()) > 0:
            self._hear(left)

    def _open_soon(self) -> None:
        """A guard that keeps trying has the port for moments: it gives way to this one."""
        end = time.monotonic() + _SOON
        while True:
            try:
                self._open()
                return
            except OSError as e:
                if not _busy(e) or time.monotonic() >= end:
                    raise
                time.sleep(0.05)

    def _open(self) -> None:
        self._port = self._set.open()
        self._reader = threading.Thread(target=self._listen_port, args=(self._port,), daemon=True)
        self._reader.start()

    def _let_go(self) -> None:
        """Close the port, by the thread that reads it."""
        self._port = None
        if self._reader is not None:
            self._reader.join(timeout=0.5)

    def _first_dark(self) -> None:
        begun, said = time.monotonic(), b""
        while True:
            self._sure, heard = self._darken()
            said = (said + heard)[-1024:]
            waited = time.monotonic() - begun
            over = waited >= self._set.connect or (not said and waited >= QUIET)
            if self._sure or self._leave or over:
                self._tell(b"H", bytes([self._sure]) + said)
                return

    def _next(self) -> tuple[str, bytes] | None:
        if self._later:
            return "frame", self._later.pop(0)
        longest = 5.0
        if self._lit:
            longest = min(PULSE, self._lease_end - time.monotonic())
        elif self._again:
            longest = min(PULSE, self._again - time.monotonic())
        try:
            return self._events.get(timeout=max(longest, 0.0))
        except queue.Empty:
            return None

    def _act(self, source: str, data: bytes) -> None:
        kind, payload = data[:1], data[1:]
        if source == "port":
            self._overhear(data)
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

    def _overhear(self, data: bytes) -> None:
        """What the board says goes to the scanner, unless it is the door or an alarm while lit."""
        self._tail = (self._tail + data)[-256:]
        if self._lit and (b"ALARM" in self._tail or b"Door" in self._tail):
            self._barred, self._tail = self._tail, b""
            self._answer(0, FAILED, self._barred, b"")
            self._dark(0, DONE)
        else:
            self._tell(b"R", data)

    def _pass_on(self, data: bytes) -> None:
        """The scanner's bytes to the port, if they are lines that is permitted."""
        try:
            passed = self._filter.feed(data, self._lit)
        except ValueError:
            self._leave = True  # only an L frame lights; who tries otherwise is not to be trusted
            return
        if passed and not self._hurry.is_set():
            self._send(passed)

    def _light(self, seq: int, lease: float, mask: int) -> None:
        if not 0.0 < lease <= LONGEST_LEASE or mask >> len(self._set.outputs):
            self._dark(seq, FAILED)
            return
        if mask and self._barred:
            self._dark(seq, FAILED, self._barred)
            return
        if mask:  # counted as lit from before the first byte
            self._lit, self._sure, self._maybe = True, False, True
            self._lease_end = time.monotonic() + lease
            self._last_end = time.monotonic() + LONGEST_LIT
        begun = self._tail = self._tail[self._tail.rfind(b"\n") + 1 :]
        for step in self._dialect.light(self._set.outputs, mask):
            heard, end = bytearray(), time.monotonic() + self._set.confirm
            self._send(step.send)
            while (found := step.confirm.search(heard)) is None:
                left = end - time.monotonic()
                if left <= 0 or self._hurry.is_set() or step.refuse.search(heard):
                    break
                heard += self._hear(min(left, 0.02))
                del heard[:-LONGEST_FRAME]
            # Or more than was asked for, such as the banner of a board that has restarted.
            if found is None or (heard[: found.start()] + heard[found.end() :]).strip():
                self._dark(seq, FAILED, begun + bytes(heard))
                return
        self._lit, self._sure, self._maybe = bool(mask), not mask, bool(mask)
        self._again = 0.0
        self._answer(seq, DONE, b"", b"")

    def _extend(self, payload: bytes) -> None:
        """More time for what is lit; it lights nothing, so it may come late, or twice."""
        (lease,) = struct.unpack("<d", payload)
        if self._lit and 0.0 < lease <= LONGEST_LEASE:
            self._lease_end = min(time.monotonic() + lease, self._last_end)

    def _dark(self, seq: int, result: int, objection: bytes = b"", tries: int = 3) -> None:
        """Dark, and whether it was confirmed as an answer; if not, it is repeated in a second."""
        said = b""
        self._hurry.clear()
        self._hold_still()
        for _ in range(tries):
            self._sure, heard = self._darken()
            said = (said + heard)[-1024:]
            if self._sure or self._port is None or self._leave:
                break
        self._lit, self._tail = False, b""
        self._maybe = self._maybe and not self._sure
        self._again = 0.0 if self._sure else time.monotonic() + AGAIN
        self._answer(seq, result if self._sure else UNKNOWN, objection, said)

    def _hold_still(self) -> None:
        """Where nothing can be lit, let the table come to rest: a reset in motion loses its place.

        It ends with `LONGEST_HOLD`, and at once where the board does not answer.
        """
        if self._maybe or not self._sure or not self._dialect.holds:
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
        with contextlib.suppress(OSError, ValueError), foreign_as_oserror():
            if self._port is not None:
                self._port.reset_output_buffer()
        self._filter.clear()
        steps = self._dialect.dark(self._set.outputs)
        return darken(steps, self._send, self._hear, self._set.confirm)

    def _send(self, data: bytes) -> None:
        # A full buffer shows as silence, a lost port by itself.
        with contextlib.suppress(OSError, ValueError), foreign_as_oserror():
            if self._port is not None:
                self._port.write(data)

    def _hear(self, longest: float) -> bytes:
        """What the port says within so long; frames of the scanner wait their turn."""
        end = time.monotonic() + longest
        while (left := end - time.monotonic()) > 0:
            self._pulse()
            try:
                source, data = self._events.get(timeout=min(left, PULSE))
            except queue.Empty:
                continue
            if source == "port":
                return data
            if source == "end":
                self._leave = True
            elif data[:1] == b"E":
                self._extend(data[1:])
            else:
                self._later.append(data)
        return b""

    def _pulse(self) -> None:
        """Tell the scanner that this loop goes round; only this loop does."""
        now = time.monotonic()
        if now >= self._pulsed + 0.8 * PULSE:
            self._pulsed = now
            self._tell(b"P", b"")

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
            with foreign_as_oserror():
                while self._port is port:
                    if data := port.read(port.in_waiting or 1):
                        self._events.put(("port", data))
        except (OSError, ValueError) as e:
            self._port = None
            self._tell(b"U", b"gone " + str(e).encode()[:200])
            self._events.put(("end", b""))
        with contextlib.suppress(OSError, ValueError), foreign_as_oserror():
            port.close()

    def _answer(self, seq: int, result: int, objection: bytes, said: bytes) -> None:
        """What was heard before it went dark, and what since."""
        objection = objection[-1024:]
        head = struct.pack("<IBH", seq, result, len(objection))
        self._tell(b"A", head + objection + said)

    def _tell(self, kind: bytes, payload: bytes) -> None:
        with contextlib.suppress(queue.Full):  # a stopped scanner must never hold up its guard
            self._out.put_nowait(pack(kind, payload[:LONGEST_FRAME]))

    def _speak(self, file: int, what: queue.Queue[bytes]) -> None:
        """A thread of its own, as there may be no reader."""
        with contextlib.suppress(OSError):
            while True:
                os.write(file, what.get())
                what.task_done()

    def _flush(self) -> None:
        """What was said is out before the end, if anybody reads it."""
        now = time.monotonic()
        for what, patience in ((self._out, 0.2), (self._words, 0.5)):
            while what.unfinished_tasks and time.monotonic() < now + patience:
                time.sleep(0.001)

    def _say(self, text: str) -> None:
        """To the person, whose program may have ended."""
        with contextlib.suppress(queue.Full):
            self._words.put_nowait(f"turnscan: {self._set.port}: {text}\n".encode())

    def _keep_nobody_waiting(self) -> None:
        """Let go of a pipe once the scanner has ended: who reads it waits for all that hold it."""
        with contextlib.suppress(OSError):
            if os.getppid() != self._set.scanner and not self._words.unfinished_tasks:
                mode = os.fstat(2).st_mode
                if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
                    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _busy(error: Exception) -> bool:
    return getattr(error, "errno", 0) in (errno.EAGAIN, errno.EBUSY)


def _own_signals(guard: Guard) -> None:
    """Whatever the program that started this one had ignored or blocked, `nohup` for one."""
    for name in ("SIGINT", "SIGHUP"):  # meant for the scanner, which then ends or goes on
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    # Python runs a handler only when the main thread wakes, which may be long after; a byte in a
    # socket is there at once, whichever thread the signal hit.
    heard, woken = socket.socketpair()
    woken.setblocking(False)
    signal.set_wakeup_fd(woken.detach())
    signal.signal(signal.SIGTERM, lambda *_: None)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})

    def listen_signal() -> None:
        while heard.recv(1):
            guard.terminated()

    threading.Thread(target=listen_signal, daemon=True).start()


def _ahead_of_others() -> None:
    """Go before whatever keeps all processors busy, such as a reconstruction, where the system
    lets this user have it so."""
    with contextlib.suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)


def main(argument: str) -> int:
    """Run the guard with `Settings` in JSON."""
    _ahead_of_others()
    given = json.loads(argument)
    guard = Guard(Settings(**{**given, "outputs": tuple(given["outputs"])}))
    _own_signals(guard)
    try:
        return guard.run()
    except BaseException:
        guard.last_word()
        raise

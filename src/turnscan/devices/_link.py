"""Bytes to and from a board: through the laser guard, with a deadline on every wait."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import queue
import struct
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from turnscan.devices import _guard
from turnscan.devices._lines import shown
from turnscan.devices._sentences import door_open
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceRestarted,
    DeviceTimeout,
    LaserStateUnknown,
    SafetyError,
    TurnscanError,
)

GUARD_SCRIPT = Path(_guard.__file__)
CUT = "cut the power of the lasers, then look at the cable and the board"


@dataclass(frozen=True)
class Deadlines:
    """How long to wait for what, s."""

    acknowledge: float = 2.0
    """For the answer to a command."""
    move_extra: float = 5.0
    """Beyond the time that a move should take."""
    connect: float = 10.0
    """For a board to boot and answer."""


class Link(Protocol):
    """Bytes in, bytes out, and the two things that only a guard may do."""

    def write(self, data: bytes) -> None:
        """Send; returns at once."""
        ...

    def read(self, timeout: float) -> bytes:
        """What has come; waits up to ``timeout`` s for a first byte, b"" where none came."""
        ...

    def light(self, mask: int, lease: float) -> None:
        """Light exactly the lasers whose bit is set; dark after ``lease`` s."""
        ...

    def renew(self, lease: float) -> None:
        """What is lit may stay so for ``lease`` s from now."""
        ...

    def dark(self) -> bytes:
        """All dark; what the board said to it. Raises LaserStateUnknown."""
        ...

    def close(self) -> None:
        """Dark, then let go of the port."""
        ...


class GuardedLink:
    """A serial port owned by a `turnscan.devices._guard` process of its own.

    Opening it sends the dark bytes first. Raises DeviceNotFound (no such port), DeviceRefused (in
    use), DeviceTimeout (silent), DeviceGarbled (speaks another dialect) or LaserStateUnknown.
    """

    def __init__(
        self,
        port: str,
        dialect: str,
        outputs: tuple[str, ...],
        *,
        baud: int | None = None,
        dtr: bool = False,
        library: str = "",
        deadlines: Deadlines | None = None,
        script: Path = GUARD_SCRIPT,
    ) -> None:
        d = deadlines or Deadlines()
        self._d = d
        self.settings = _guard.Settings(
            port, dialect, outputs, baud or _guard.DIALECTS[dialect].baud, dtr,
            d.connect, min(d.acknowledge, 0.6), library,
        )  # fmt: skip
        self._bytes: queue.Queue[bytes] = queue.Queue(maxsize=4096)
        self._answers: dict[int, queue.SimpleQueue[tuple[int, bytes, bytes]]] = {}
        self._hello: queue.Queue[tuple[bytes, bytes]] = queue.Queue(maxsize=4)
        self._pipe = threading.Lock()
        self._numbers = itertools.count(1)
        self._darks = 0
        self._failure: TurnscanError | None = None
        self._lapsed = False
        self._maybe_lit = threading.Event()
        self._closing = threading.Event()
        self._alone = threading.Lock()
        self._guard = subprocess.Popen(  # noqa: S603 (our own script, no shell)
            [sys.executable, "-I", str(script), json.dumps(self.settings.__dict__)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
        )  # fmt: skip
        self._listener = threading.Thread(target=self._listen, daemon=True, name="guard listener")
        self._listener.start()
        try:
            self._greet()
        except BaseException:
            self.close()
            raise

    @property
    def guard_pid(self) -> int:
        """The guard's process id."""
        return self._guard.pid

    def _greet(self) -> None:
        port, dialect = self.settings.port, self.settings.dialect
        try:
            kind, text = self._hello.get(timeout=self._d.connect + 10.0)
        except queue.Empty:
            raise DeviceTimeout(f"{port}: the laser guard did not open it") from None
        if kind != b"H":
            raise self._failure or DeviceDisconnected(f"{port}: gone while connecting")
        if text[:1] == b"\1":
            return
        said = text[1:]
        if not said.strip():
            raise DeviceTimeout(
                f"{port}: silent, no {dialect} board answered within {self._d.connect:g} s",
                hint="look at cable, power and baud rate",
            )
        if not _guard.DIALECTS[dialect].banner.search(said):
            raise DeviceGarbled(
                f"{port}: does not speak {dialect}; it said {shown(said)}",
                hint="try another dialect: grbl, horus, fabscan, sardauscan"
                if not self.settings.library
                else "name another resource",
            )
        raise LaserStateUnknown(f"{port}: the board did not confirm lasers off", hint=CUT)

    def write(self, data: bytes) -> None:
        """Send. Raises DeviceDisconnected, SafetyError where the guard has ended."""
        self._frame(b"W", data)

    def read(self, timeout: float) -> bytes:
        """What has come since. Raises DeviceAlarm where a dark from elsewhere fell in between."""
        darks, end = self._darks, time.monotonic() + timeout
        while True:
            self._check()
            if darks != self._darks:
                raise DeviceAlarm(f"{self.settings.port}: interrupted, lasers were switched off")
            left = end - time.monotonic()
            try:
                return self._bytes.get(timeout=min(left, 0.05)) if left > 0 else self._at_once()
            except queue.Empty:
                if left <= 0:
                    return b""

    def _at_once(self) -> bytes:
        return self._bytes.get_nowait()

    def light(self, mask: int, lease: float) -> None:
        """See `Link`. Raises the named error of what the board answered instead, lasers dark."""
        self._check()
        lapsed, self._lapsed = self._lapsed, False
        if lapsed:
            raise DeviceTimeout(
                f"{self.settings.port}: a laser's lease ran out while it was needed",
                hint="give a longer lease than exposure and transfer take",
            )
        if mask:
            self._maybe_lit.set()
        result, heard, _ = self._ask(b"L", struct.pack("<dB", lease, mask))
        if result == _guard.DONE:
            if not mask:
                self._maybe_lit.clear()
            return
        if result == _guard.UNKNOWN:
            raise self._unknown(heard)
        self._maybe_lit.clear()
        raise objection(self.settings.port, heard)

    def renew(self, lease: float) -> None:
        """See `Link`; nothing is answered. Raises what has befallen the guard."""
        self._frame(b"E", struct.pack("<d", lease))

    def dark(self) -> bytes:
        """See `Link`; from any thread and state, also after the guard has ended."""
        self._darks += 1
        try:
            self._check()
            result, _, heard = self._ask(b"D", b"")
        except TurnscanError as e:
            self._failure = self._failure or e
            self._guard.kill()  # it holds the port; what it cannot do is done without it
            return self._dark_alone()
        if result == _guard.UNKNOWN:
            raise self._unknown(heard)
        self._drain()
        self._maybe_lit.clear()
        self._lapsed = False
        return heard

    def close(self) -> None:
        """Dark, confirmed by the guard before it ends. Raises LaserStateUnknown."""
        if self._closing.is_set():
            return
        self._closing.set()
        with contextlib.suppress(TurnscanError):
            self._frame(b"Q")
        with contextlib.suppress(OSError):
            if self._guard.stdin is not None:
                self._guard.stdin.close()
        try:
            code = self._guard.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._guard.kill()
            code = self._guard.wait(timeout=10.0)
            self._dark_alone()
            code = 0
        self._listener.join(timeout=5.0)
        if code == 4 and self._maybe_lit.is_set():
            raise self._unknown(b"")

    def _unknown(self, heard: bytes) -> LaserStateUnknown:
        said = f"; it said {shown(heard)}" if heard.strip() else ""
        return LaserStateUnknown(
            f"{self.settings.port}: the board did not confirm lasers off{said}", hint=CUT
        )

    def _drain(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                self._bytes.get_nowait()

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closing.is_set():
            raise DeviceDisconnected(f"{self.settings.port}: closed")

    def _frame(self, kind: bytes, payload: bytes = b"") -> None:
        """Below 4096 bytes the pipe takes a frame whole; the lock keeps them in one order."""
        if not self._closing.is_set() or kind != b"Q":
            self._check()
        if not self._pipe.acquire(timeout=1.0):
            raise SafetyError(f"{self.settings.port}: the laser guard does not take orders")
        try:
            if self._guard.stdin is not None:
                self._guard.stdin.write(_guard.pack(kind, payload))
        except (OSError, ValueError):
            raise self._failure or SafetyError(
                f"{self.settings.port}: the laser guard has ended", hint="start again"
            ) from None
        finally:
            self._pipe.release()

    def _ask(self, kind: bytes, payload: bytes) -> tuple[int, bytes, bytes]:
        seq = next(self._numbers)
        answer = self._answers[seq] = queue.SimpleQueue()
        try:
            self._frame(kind, struct.pack("<I", seq) + payload)
            # A dark tries three times through every step; sixteen steps are the most there are.
            end = time.monotonic() + 1.0 + 48 * self.settings.confirm
            while time.monotonic() < end:
                try:
                    return answer.get(timeout=0.05)
                except queue.Empty:
                    self._check()
            raise SafetyError(f"{self.settings.port}: the laser guard does not answer", hint=CUT)
        finally:
            del self._answers[seq]

    def _listen(self) -> None:
        frames = _guard.Frames(b"RHAU")
        out: Any = self._guard.stdout
        with contextlib.suppress(OSError, ValueError):
            while data := os.read(out.fileno(), 65536):
                for kind, payload in frames.feed(data):
                    self._take(kind, payload)
        out.close()
        if not self._closing.is_set() and self._failure is None:
            self._rescue()
        with contextlib.suppress(queue.Full):
            self._hello.put_nowait((b"U", b""))

    def _take(self, kind: bytes, payload: bytes) -> None:
        port = self.settings.port
        if kind == b"R":
            try:
                self._bytes.put_nowait(payload)
            except queue.Full:
                self._failure = DeviceGarbled(f"{port}: talks without end")
        elif kind == b"H":
            self._hello.put_nowait((kind, payload))
        elif kind == b"U":
            word, _, text = payload.decode(errors="replace").partition(" ")
            self._failure = _port_error(port, word, text)
            self._hello.put_nowait((kind, payload))
        else:
            seq, result, cut = struct.unpack_from("<IBH", payload)
            heard = payload[7:]
            if seq == 0 and result in (_guard.LAPSED, _guard.UNKNOWN):
                self._lapsed = True
                if result == _guard.UNKNOWN and not self._closing.is_set():
                    self._failure = self._unknown(heard)
            elif seq in self._answers:
                self._answers[seq].put((result, heard[:cut], heard[cut:]))

    def _rescue(self) -> None:
        """The guard has died: dark without it, at once, then nothing more over this link."""
        port = self.settings.port
        try:
            self._dark_alone()
        except LaserStateUnknown as e:
            self._failure = e
        else:
            self._failure = SafetyError(
                f"{port}: the laser guard died; the lasers were switched off without it",
                hint="start again",
            )

    def _dark_alone(self) -> bytes:
        """Open the port ourselves and send the dark bytes. Raises LaserStateUnknown."""
        longest = 1.0 + 3 * self.settings.confirm
        # One thread at a time: they would take the port away from each other.
        if not self._alone.acquire(timeout=2 * longest):
            raise self._unknown(b"")
        try:
            return self._dark_by(time.monotonic() + longest)
        finally:
            self._alone.release()

    def _dark_by(self, end: float) -> bytes:
        s, heard = self.settings, b""
        dialect = _guard.DIALECTS[s.dialect]
        while time.monotonic() < end:
            try:
                with contextlib.closing(s.open()) as port:
                    sure, heard = _guard.darken(
                        dialect.dark(s.outputs), port.write, _hearing(port), s.confirm
                    )
            except (OSError, ValueError):
                time.sleep(0.02)
                continue
            if sure:
                self._maybe_lit.clear()
                return heard
        raise self._unknown(heard)


def _hearing(port: Any) -> Any:
    def hear(longest: float) -> bytes:
        port.timeout = min(longest, 0.02)
        data: bytes = port.read(port.in_waiting or 1)
        return data

    return hear


def _port_error(port: str, word: str, text: str) -> DeviceError:
    if word == "busy":
        return DeviceRefused(f"{port}: in use by another program", hint="close that program")
    if word == "absent":
        # pyserial says it twice, with the name of the port: the end says why.
        why = "there is no such port" if "[Errno 2]" in text else text
        return DeviceNotFound(
            f"{port}: cannot be opened: {why}", hint="look at the cable and the port's name"
        )
    return DeviceDisconnected(f"{port}: gone: {text}", hint="plug it in again, then resume")


def objection(port: str, heard: bytes) -> TurnscanError:
    """The error that a board's words amount to."""
    if not heard.strip():
        return DeviceTimeout(f"{port}: no answer to a laser command")
    if b"Door" in heard:
        return door_open(port)
    if b"ALARM" in heard:
        return DeviceAlarm(f"{port}: {shown(heard)}", hint="look at the machine, then acknowledge")
    if b"Grbl " in heard or b"Horus " in heard or b"Sardauscan V" in heard:
        return DeviceRestarted(
            f"{port}: the board restarted ({shown(heard)})",
            hint="its position is lost: set the table to its mark again",
        )
    if b"error" in heard:
        return DeviceRefused(f"{port}: the board refused to switch a laser: {shown(heard)}")
    return DeviceGarbled(f"{port}: answered a laser command with {shown(heard)}")

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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from turnscan.devices import _guard
from turnscan.devices._dialects import DIALECTS
from turnscan.devices._line_protocol import objection, shown
from turnscan.devices._port_error import port_error
from turnscan.devices._rescue import Rescue
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
    DeviceGarbled,
    DeviceTimeout,
    LaserStateUnknown,
    LeaseEnded,
    SafetyError,
    TurnscanError,
)

GUARD_SCRIPT = Path(_guard.__file__).with_name("_run_guard.py")
_SILENT = 4
"""Pulses of the guard that may stay away, one after the other, before it counts as hanging."""
_SILENT_INSTRUMENT = 12
"""The same behind PyVISA, which waits for half a second at a time."""
_PART = 2048
"""Bytes of a frame; a pipe takes up to 4096 whole."""
_LONGEST_ANSWER = 10.0
"""s; longer than a dark may take that the board never confirms."""
_LONGEST_END = 15.0
"""s for a guard to end once it was asked to."""
CUT = "cut the power of the lasers, then check the cable and the controller"


@dataclass(frozen=True)
class Deadlines:
    """How long to wait for what, s."""

    acknowledge: float = 2.0
    """For the answer to a command."""
    move_extra: float = 5.0
    """Beyond the time that a move should take."""
    connect: float = 10.0
    """For a board to boot and answer; one that says nothing at all is given up sooner."""
    keep_trying: float = _guard.KEEP_TRYING
    """To get a dark confirmed once everything else has ended."""


class Interrupted(DeviceAlarm):
    """A command was broken off, as lasers were switched off meanwhile; nothing is wrong."""

    def __init__(self, port: str) -> None:
        super().__init__(f"{port}: interrupted, lasers were switched off")


class Link(Protocol):
    """Bytes in, bytes out, and the two things that only a guard may do."""

    @property
    def darks(self) -> int:
        """How often the lasers were switched off; a board may forget its modes with each time."""
        ...

    def write(self, data: bytes, darks: int | None = None) -> None:
        """Send; returns at once. Raises Interrupted where there was a dark since ``darks``."""
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


class _Answer:
    """One that is due."""

    def __init__(self, kind: bytes, payload: bytes) -> None:
        self.dark = kind == b"D"
        self.lights = kind == b"L" and payload[-1:] != b"\0"
        self.came: queue.SimpleQueue[tuple[int, bytes, bytes]] = queue.SimpleQueue()


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
        self._script = script
        self.settings = _guard.Settings(
            port, dialect, outputs, baud or DIALECTS[dialect].baud, dtr,
            d.connect, min(d.acknowledge, 0.6), library, d.keep_trying,
        )  # fmt: skip
        self._bytes: queue.Queue[bytes] = queue.Queue(maxsize=4096)
        self._answers: dict[int, _Answer] = {}
        self._hello: queue.Queue[tuple[bytes, bytes]] = queue.Queue(maxsize=1)
        self._pipe = threading.RLock()  # knows its owner, see `_frame`
        self._numbers = itertools.count(1)
        self._heard = 0
        self._darks = self._darks_before = 0
        """Darks that are on their way to the board, and how many of them a `write` came after."""
        self._unasked_darks = 0
        """Those that the guard did by itself."""
        self._failure: TurnscanError | None = None
        self._barred: TurnscanError | None = None
        """The door or the alarm for which the guard went dark by itself."""
        self._lapsed = False
        self._maybe_lit = threading.Event()
        self._closing = threading.Event()
        self._gone = threading.Event()
        """Set once the port of a laser has disconnected that may be lit: the guard reopens it."""
        self._keeps_trying = threading.Event()
        """Set once that, or a last dark, was not done in a second."""
        self._ended = threading.Event()
        """Set once the guard has ended and what follows from that is done."""
        self._alone = Rescue(self.settings, self._start_rescuer, self._maybe_lit)
        self._guard = self._start(self.settings, subprocess.PIPE)
        self._listener = threading.Thread(target=self._listen, daemon=True, name="guard listener")
        self._listener.start()
        threading.Thread(target=self._watch, daemon=True, name="guard watch").start()
        try:
            self._greet()
        except BaseException:
            self.close()
            raise

    def _start(self, settings: _guard.Settings, pipe: int) -> subprocess.Popen[bytes]:
        given = {**settings.__dict__, "scanner": os.getpid()}
        return subprocess.Popen(  # noqa: S603 (our own script, no shell)
            [sys.executable, "-I", str(self._script), json.dumps(given)],
            stdin=pipe, stdout=pipe, bufsize=0, start_new_session=True,
        )  # fmt: skip

    def _start_rescuer(self) -> subprocess.Popen[bytes]:
        return self._start(replace(self.settings, rescue=True), subprocess.DEVNULL)

    @property
    def guard_pid(self) -> int:
        """The guard's process id."""
        return self._guard.pid

    def _greet(self) -> None:
        port, dialect = self.settings.port, self.settings.dialect
        try:
            kind, text = self._hello.get(timeout=self._d.connect + 10.0)
        except queue.Empty:
            raise DeviceTimeout(f"{port}: the laser guard could not open it") from None
        if kind != b"H":
            raise self._failure or DeviceDisconnected(f"{port}: disconnected while connecting")
        if text[:1] == b"\1":
            return
        said = text[1:]
        if not said.strip():
            raise DeviceTimeout(
                f"{port}: silent, no {dialect} controller answered within "
                f"{min(self._d.connect, _guard.QUIET):g} s",
                hint="check cable, power and baud rate; a laser that was lit before may still be "
                "lit: cut its power",
            )
        if not DIALECTS[dialect].banner.search(said):
            raise DeviceGarbled(
                f"{port}: does not speak {dialect}; it said {shown(said)}",
                hint="try another dialect: grbl, horus, fabscan, sardauscan"
                if not self.settings.library
                else "name another resource",
            )
        raise LaserStateUnknown(f"{port}: the controller did not confirm lasers off", hint=CUT)

    @property
    def darks(self) -> int:
        """See `Link`."""
        return self._darks + self._unasked_darks

    def write(self, data: bytes, darks: int | None = None) -> None:
        """See `Link`. Raises DeviceDisconnected, SafetyError where the guard has ended."""
        self._check_barred()
        for at in range(0, len(data), _PART):
            self._frame(b"W", data[at : at + _PART], darks)

    def read(self, timeout: float) -> bytes:
        """What has come since.

        Who waits for the answer to a `write` meets Interrupted where a dark fell in between.
        """
        end = time.monotonic() + timeout
        while True:
            self._check()
            if timeout > 0.0 and self._darks != self._darks_before:
                raise Interrupted(self.settings.port)
            self._check_barred()
            left = end - time.monotonic()
            try:
                return self._bytes.get(timeout=min(left, 0.05)) if left > 0 else self._at_once()
            except queue.Empty:
                if left <= 0:
                    return b""

    def _at_once(self) -> bytes:
        return self._bytes.get_nowait()

    def light(self, mask: int, lease: float) -> None:
        """See `Link`. Raises the named error of its other answer, lasers dark."""
        darks = self._darks
        self._check()
        self._check_barred()
        self._check_lease()
        result, heard, said = self._ask(b"L", struct.pack("<dB", lease, mask))
        if result == _guard.DONE:
            self._check_lease()  # it may have expired just before: the board was reset
            return
        if result == _guard.UNKNOWN:
            raise self._unknown(heard)
        # What follows is the guard's own dark, but a message that was split may end there.
        door = b"Door" in said or b"ALARM" in said
        if self._darks != darks and not (door or b"Door" in heard or b"ALARM" in heard):
            raise Interrupted(self.settings.port)
        raise objection(self.settings.port, heard + said if door else heard)

    def renew(self, lease: float) -> None:
        """See `Link`; nothing is answered. Raises what has befallen the guard."""
        self._check_barred()
        self._frame(b"E", struct.pack("<d", lease))

    def dark(self) -> bytes:
        """See `Link`; from any thread and state, also after the guard has ended."""
        try:
            self._check()
            result, _, heard = self._ask(b"D", b"")
        except TurnscanError as e:
            self._failure = self._failure or e
            if self._gone.is_set() and not self._ended.is_set():
                return self._dark_by_guard()
            self._guard.kill()  # it holds the port; what it cannot do is done without it
            return self._dark_alone()
        if result == _guard.UNKNOWN:
            raise self._unknown(heard)
        self._lapsed, self._barred = False, None
        return heard

    def _dark_by_guard(self) -> bytes:
        """The guard is at it already, as the port has disconnected. Raises LaserStateUnknown."""
        end = time.monotonic() + self._alone.longest
        while self._maybe_lit.is_set() and not self._ended.is_set() and time.monotonic() < end:
            time.sleep(0.01)
        if self._maybe_lit.is_set():
            raise self._unknown(b"")
        return b""

    def close(self) -> None:
        """Dark, confirmed before the guard ends. Raises LaserStateUnknown, and then goes on trying.

        Whatever becomes of the guard meanwhile: `_listen` sees how it ends, and steps in.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        with contextlib.suppress(TurnscanError):
            self._frame(b"Q")
        with contextlib.suppress(OSError):
            if self._guard.stdin is not None:
                self._guard.stdin.close()
        end = time.monotonic() + _LONGEST_END
        while not self._ended.wait(0.01) and not self._gives_up_waiting():
            if time.monotonic() >= end:
                self._guard.kill()
                self._ended.wait(_LONGEST_END)
                break
        if self._maybe_lit.is_set():
            raise self._unknown(b"")

    def _gives_up_waiting(self) -> bool:
        return self._keeps_trying.is_set() and self._maybe_lit.is_set()

    def _unknown(self, heard: bytes) -> LaserStateUnknown:
        said = f"; it said {shown(heard)}" if heard.strip() else ""
        if self._maybe_lit.is_set():
            said += f"; turnscan keeps trying for {self.settings.keep_trying / 60:.3g} minutes"
        return LaserStateUnknown(
            f"{self.settings.port}: the controller did not confirm lasers off{said}", hint=CUT
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

    def _check_barred(self) -> None:
        """The door and the alarm are said once, as what they are; a dark is what ends them."""
        if self._barred is not None:
            raise self._barred

    def _check_lease(self) -> None:
        """What has expired is said once."""
        lapsed, self._lapsed = self._lapsed, False
        if lapsed:
            raise LeaseEnded(
                f"{self.settings.port}: the lease of a laser expired while it was needed",
                hint="the expected picture did not arrive in time: check the camera",
            )

    def _frame(self, kind: bytes, payload: bytes = b"", darks: int | None = None) -> None:
        """The lock keeps frames in one order; who waits for a guard that hangs sees it killed.

        A dark counts here, as what was written between its request and its frame came before it.
        ``darks``: what `darks` was when what is sent was right; raises Interrupted.
        """
        if not self._closing.is_set() or kind != b"Q":
            self._check()
        try:
            if not self._pipe.acquire(timeout=1.0):
                raise SafetyError(f"{self.settings.port}: the laser guard does not accept requests")
            self._darks += kind == b"D"
            if darks is not None and darks != self.darks:
                raise Interrupted(self.settings.port)
            if kind == b"W" and payload != b"!":  # of another thread than that which reads
                self._darks_before = self._darks
            self._send(_guard.pack(kind, payload))
        finally:
            # A signal may fall before anything notes that it was taken, or before this: its owner
            # lets go of all that it holds, and for all others this does nothing.
            with contextlib.suppress(RuntimeError):
                while True:
                    self._pipe.release()

    def _send(self, frame: bytes) -> None:
        try:
            if self._guard.stdin is not None:
                self._guard.stdin.write(frame)
        except (OSError, ValueError):
            self._ended.wait(1.0)  # then it is known how, and what became of the lasers
            raise self._failure or SafetyError(
                f"{self.settings.port}: the laser guard has ended", hint="start again"
            ) from None

    def _ask(self, kind: bytes, payload: bytes) -> tuple[int, bytes, bytes]:
        seq = next(self._numbers)
        answer = self._answers[seq] = _Answer(kind, payload)
        if answer.lights:
            self._maybe_lit.set()
        try:
            self._frame(kind, struct.pack("<I", seq) + payload)
            end = time.monotonic() + _LONGEST_ANSWER
            while time.monotonic() < end:
                try:
                    return answer.came.get(timeout=0.05)
                except queue.Empty:
                    self._check()
            raise SafetyError(f"{self.settings.port}: the laser guard does not answer", hint=CUT)
        finally:
            del self._answers[seq]

    def _watch(self) -> None:
        """Kill a guard that hangs or was stopped: `_listen` then does what it no longer does.

        What is judged is not a time but pulses that stayed away, so that a scanner that was itself
        stopped blames nobody.
        """
        most = _SILENT_INSTRUMENT if self.settings.library else _SILENT
        heard, silent = -1, 0
        while not self._ended.wait(_guard.PULSE):
            silent = silent + 1 if heard == self._heard and self._waits() else 0
            heard = self._heard
            if silent >= most:
                self._guard.kill()
                return

    def _waits(self) -> bool:
        """Whether the guard's loop must be going round."""
        busy = bool(self._answers) or self._sending() or self._closing.is_set()
        return busy or self._maybe_lit.is_set()

    def _sending(self) -> bool:
        """Whether another thread holds the pipe."""
        free = self._pipe.acquire(blocking=False)
        if free:
            self._pipe.release()
        return not free

    def _listen(self) -> None:
        """Until the guard's output ends, and then what follows from that, whatever goes wrong."""
        try:
            self._take_all()
        except Exception:  # noqa: BLE001 a guard that nobody understands any more is none
            self._guard.kill()
        try:
            self._see_off()
        except Exception as e:  # noqa: BLE001 whoever waits for the lasers must hear of it
            self._failure = SafetyError(
                f"{self.settings.port}: the laser guard has ended, and replacing it failed: "
                f"{type(e).__name__}: {e}", hint=CUT,
            )  # fmt: skip
        finally:
            self._ended.set()
            self._greeting(b"U", b"")

    def _take_all(self) -> None:
        frames = _guard.Frames(b"RHAUPK")
        out: Any = self._guard.stdout
        with contextlib.closing(out):
            while data := os.read(out.fileno(), 65536):
                self._heard += 1
                for kind, payload in frames.feed(data):
                    self._take(kind, payload)

    def _greeting(self, kind: bytes, payload: bytes) -> None:
        """The first is what `_greet` waits for; no other is expected."""
        with contextlib.suppress(queue.Full):
            self._hello.put_nowait((kind, payload))

    def _see_off(self) -> None:
        """The guard has ended. Only its word 0 means dark; after any other it is done from here."""
        code = self._last_code()
        if code == 0:
            self._maybe_lit.clear()
            if not self._closing.is_set():
                self._failure = self._failure or self._died("has ended")
        elif self._maybe_lit.is_set() or not (self._closing.is_set() or self._failure):
            self._rescue()

    def _last_code(self) -> int | None:
        """With which the guard has ended; None where it cannot even be killed."""
        for _ in range(2):
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self._guard.wait(timeout=5.0)
            self._guard.kill()  # its output is closed, but it lives
        return None

    def _take(self, kind: bytes, payload: bytes) -> None:
        port = self.settings.port
        if kind == b"R":
            try:
                self._bytes.put_nowait(payload)
            except queue.Full:
                self._failure = DeviceGarbled(f"{port}: sends data without end")
        elif kind == b"H":
            self._greeting(kind, payload)
        elif kind == b"U":
            word, _, text = payload.decode(errors="replace").partition(" ")
            if word == "gone" and self._maybe_lit.is_set():
                self._gone.set()
            self._failure = self._failure or port_error(port, word, text)
            self._greeting(kind, payload)
        elif kind == b"K":
            self._gone.set()
            self._keeps_trying.set()
        elif kind == b"A":
            seq, result, cut = struct.unpack_from("<IBH", payload)
            heard, said = payload[7 : 7 + cut], payload[7 + cut :]
            if (answer := self._answers.get(seq)) is not None:
                self._note(answer, result)
                if answer.dark:
                    self._drain()  # here, as what comes next may answer another thread's command
                answer.came.put((result, heard, said))
            elif seq == 0:
                self._by_itself(result, heard, said)

    def _note(self, answer: _Answer | None, result: int) -> None:
        """Whether a laser may be lit, frame by frame in the guard's order.

        An order to light that it has not answered yet may come after a dark that it tells of.
        """
        if result == _guard.DONE and answer is not None and answer.lights:
            self._maybe_lit.set()
        elif result != _guard.UNKNOWN:
            orders = [a for a in list(self._answers.values()) if a.lights and a is not answer]
            if not orders:
                self._maybe_lit.clear()

    def _by_itself(self, result: int, heard: bytes, said: bytes) -> None:
        """The guard went dark without being asked."""
        if result == _guard.FAILED:
            self._barred = objection(self.settings.port, heard)
            return
        if result == _guard.LAPSED:
            self._lapsed = True
        if result == _guard.UNKNOWN:
            self._failure = self._failure or self._unknown(said)
        if self._barred is None:  # where it is barred, nothing is sent before the next dark
            self._unasked_darks += 1
        self._note(None, result)

    def _rescue(self) -> None:
        """Dark without the guard, at once, then nothing more over this link."""
        try:
            self._dark_alone()
        except LaserStateUnknown as e:
            self._failure = e
        else:
            self._failure = self._died("died")

    def _died(self, how: str) -> SafetyError:
        return SafetyError(
            f"{self.settings.port}: the laser guard {how}; the lasers were switched off",
            hint="start again",
        )

    def _dark_alone(self) -> bytes:
        """Dark without the guard. Raises LaserStateUnknown; another one then goes on trying."""
        sure, heard = self._alone.dark()
        if not sure:
            raise self._unknown(heard)
        self._maybe_lit.clear()
        return heard

"""A turntable and its lasers behind one serial port: what the four dialects share."""

from __future__ import annotations

import contextlib
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from turnscan.devices._guard import LONGEST_LEASE
from turnscan.devices._lines import Lines
from turnscan.devices._link import Deadlines, Link
from turnscan.devices._sentences import Kind, Sentence, sentence
from turnscan.devices._steps import Steps
from turnscan.errors import (
    DeviceAlarm,
    DeviceError,
    DeviceGarbled,
    DeviceRefused,
    DeviceRestarted,
    DeviceTimeout,
    InterlockOpen,
    LaserStateUnknown,
    LeaseEnded,
    SafetyError,
    TurnscanError,
)

_NEEDS_A_PERSON = (
    DeviceAlarm, DeviceRestarted, DeviceTimeout, DeviceGarbled, InterlockOpen,
)  # fmt: skip


@dataclass(frozen=True)
class Setup:
    """What an address says of a board, whatever its dialect."""

    port: str
    names: tuple[str, ...]
    """Of the lasers, in the order of the board's outputs."""
    steps: Steps | None
    """None where the board knows it itself."""
    overshoot: float
    """rad beyond the target when turning back, so that the last bit is always forwards."""
    speed: float | None
    """rad/s; None leaves it to the board."""
    options: dict[str, str]


class Board(ABC):
    """`turnscan.devices.Turntable` and `turnscan.devices.Lasers` of one board.

    One command is in flight at a time. After an alarm or a restart nothing is sent but dark, until
    `acknowledge`. Whatever goes wrong, the lasers are dark before the error leaves.
    """

    def __init__(self, setup: Setup, link: Link, deadlines: Deadlines | None = None) -> None:
        self.setup = setup
        self._link = link
        self._d = deadlines or Deadlines()
        self._lines = Lines(link, setup.port)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._unsettled = False
        self._lit: frozenset[str] = frozenset()
        self._lost: TurnscanError | None = None
        self._unit = 0
        self._remembers = True
        self._steps = setup.steps or Steps(Fraction(self._default_units()))
        try:
            self._lines.clear()
            self._connect()
        except BaseException:
            with contextlib.suppress(DeviceError):
                link.close()
            raise

    @property
    def names(self) -> tuple[str, ...]:
        """The lasers there are."""
        return self.setup.names

    @property
    def angle(self) -> float:
        """rad where the table stands, counted from the board's own zero where `remembers`."""
        return self._steps.angle_of(self._unit)

    @property
    def remembers(self) -> bool:
        """Whether `angle` at connecting came from the board, which had kept it; otherwise it is 0.

        After a restart a board counts from zero: an angle that differs from what a scan file says
        means that the angle is lost.
        """
        return self._remembers and self._lost is None

    @property
    def alarm(self) -> str:
        """Why nothing moves until `acknowledge`; empty when nothing is wrong."""
        return "" if self._lost is None else str(self._lost)

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`. The time is the shorter of ``timeout`` and the move's own plus 5 s.

        Raises DeviceRefused when `stop` was called, InputError for an angle that is none.
        """
        target = self._steps.unit_of(angle)
        end = time.monotonic() + timeout
        with self._command(timeout):
            if self._lit:
                self._switch(frozenset(), 1.0)
            self._stop.clear()
            beyond = self._steps.unit_of(self.setup.overshoot)
            if target < self._unit and beyond:
                self._leg(target - beyond, end)
            if target != self._unit:
                self._leg(target, end)
        reached = self._steps.angle_of(target)
        return angle if abs(reached - angle) < 1e-9 else reached

    def stop(self) -> None:
        """See `Turntable`. Where a board is deaf while it turns, after the piece of ≤ 15° it is in.

        A move that is stopped raises DeviceRefused in its own thread.
        """
        self._stop.set()
        self._halt()

    def light(self, lit: frozenset[str], lease: float) -> None:
        """See `Lasers`. Raises DeviceRefused for an unknown name or a lease out of range."""
        unknown = sorted(lit - set(self.names))
        if unknown:
            there = ", ".join(self.names)
            raise DeviceRefused(f"{self.setup.port}: no laser {unknown[0]!r}; there is {there}")
        self._check_lease(lease)
        with self._command(self._d.acknowledge):
            self._switch(lit, lease)

    def renew(self, lease: float) -> None:
        """See `Lasers`. Raises DeviceRefused for a lease out of range."""
        self._check_lease(lease)
        self._link.renew(lease)

    def off(self) -> None:
        """See `Lasers`. Waits for nobody; raises LaserStateUnknown where it is not confirmed."""
        self._unsettled = True
        self._lit = frozenset()
        heard = self._link.dark()
        if b"ALARM" in heard:
            self._lose(DeviceAlarm(
                f"{self.setup.port}: lasers were switched off while the table turned",
                hint="the position is lost: set the table to its mark, then acknowledge",
            ))  # fmt: skip

    def acknowledge(self) -> None:
        """A person has looked: the table stands at zero from now on."""
        with self._locked(self._d.acknowledge):
            self._lines.clear()
            self._unlock()
            self._zero()
            self._lost, self._unit, self._unsettled = None, 0, False
            self._settle()

    def close(self) -> None:
        """Dark, and let go of the port. Raises LaserStateUnknown."""
        self._stop.set()
        self._link.close()

    def _found_locked(self) -> None:
        """Connected to a board that waits for a person; it is believed, not unlocked."""
        self._lose(DeviceAlarm(
            f"{self.setup.port}: the board was found in an alarm",
            hint="look at the machine, set the table to its mark, then acknowledge",
        ))  # fmt: skip

    # What a dialect adds.

    @abstractmethod
    def _default_units(self) -> int:
        """Steps of one turn where an address says nothing."""

    @abstractmethod
    def _connect(self) -> None:
        """Make sure of the board; the lasers are dark already."""

    def _settle(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Set the modes again after a dark. Raises DeviceRestarted where the place is lost."""

    def _zero(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Where the table stands is the board's zero from now on."""

    def _unlock(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Take a board out of its alarm."""

    @abstractmethod
    def _go(self, unit: int, end: float) -> None:
        """Turn there and be at rest; the counted unit is the caller's business."""

    def _halt(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Ask a turning board to stop; called from any thread."""

    def _piece(self) -> int | None:
        """The longest move at once, in units; None where the board can be stopped."""
        return None

    # What drivers use.

    @contextlib.contextmanager
    def _locked(self, timeout: float) -> Iterator[None]:
        if not self._lock.acquire(timeout=max(timeout, 0.0)):
            raise DeviceTimeout(f"{self.setup.port}: busy with another command")
        try:
            yield
        finally:
            self._lock.release()

    @contextlib.contextmanager
    def _command(self, timeout: float) -> Iterator[None]:
        """One command in flight; lasers dark before any error of it leaves."""
        with self._locked(timeout):
            if self._lost is not None:
                raise DeviceAlarm(
                    f"{self.setup.port}: waits for a person after: {self._lost.message}",
                    hint="look at the machine, set the table to its mark, then acknowledge",
                )
            try:
                if self._unsettled:
                    self._unsettled = False
                    self._lines.clear()
                    self._settle()
                self._lines.expect_nothing()
                yield
            except BaseException as e:
                if not isinstance(e, LaserStateUnknown):
                    self._panic(e)
                if isinstance(e, _NEEDS_A_PERSON) and not isinstance(e, LeaseEnded):
                    self._lose(e)
                raise

    def _check_lease(self, lease: float) -> None:
        if not 0.0 < lease <= LONGEST_LEASE:
            raise DeviceRefused(
                f"{self.setup.port}: lease {lease:g} s",
                hint=f"above 0 to {LONGEST_LEASE:g} s; renew it while it is needed",
            )

    def _panic(self, error: BaseException) -> None:
        was_lit = bool(self._lit)
        try:
            self.off()
        except SafetyError:
            if was_lit:
                raise
        except DeviceError as e:
            error.add_note(f"and then: {e}")

    def _lose(self, error: TurnscanError) -> None:
        if self._lost is None:
            self._lost = error

    def _switch(self, lit: frozenset[str], lease: float) -> None:
        mask = sum(1 << i for i, name in enumerate(self.names) if name in lit)
        self._lit = self._lit | lit
        self._link.light(mask, lease)
        self._lines.expect_nothing()  # a door that opened while it was lit
        self._lit = lit

    def _leg(self, target: int, end: float) -> None:
        """One way, in pieces where the board cannot be stopped."""
        piece = self._piece()
        while self._unit != target:
            there = target
            if piece is not None:
                there = self._unit + max(-piece, min(piece, target - self._unit))
            if self._stop.is_set():
                raise DeviceRefused(f"{self.setup.port}: stopped")
            self._go(there, end)
            self._unit = there

    def _turn_end(self, base: int, target: int) -> int | None:
        """The whole turn from ``base`` that a move crosses, where a board's zero is set anew."""
        turns = int(Fraction(target - base) / self._steps.per_turn)
        if turns == 0 or self._steps.per_turn.denominator != 1:
            return None
        return base + int(turns * self._steps.per_turn)

    def _moved_by_itself(self, place: float, expected: float) -> DeviceRestarted:
        return DeviceRestarted(
            f"{self.setup.port}: the board stands at {place:g}, it was left at {expected:g}",
            hint="its position is lost: set the table to its mark, then acknowledge",
        )

    def _ask(
        self,
        text: str,
        end: float | None = None,
        *,
        each: Callable[[Sentence], None] | None = None,
        until: Kind = Kind.OK,
    ) -> Sentence:
        """Send a line and read to its answer; settings, messages, numbers go to ``each``.

        Raises DeviceTimeout, DeviceGarbled, DeviceRefused, DeviceAlarm, DeviceRestarted.
        """
        self._lines.expect_nothing()
        self._link.write(text.encode("ascii"))
        end = time.monotonic() + self._d.acknowledge if end is None else end
        what = repr(text.strip())
        while True:
            said = sentence(self._lines.next(end, what))
            if said.kind is until:
                return said
            if said.is_door or said.kind not in (Kind.SETTING, Kind.MESSAGE, Kind.NUMBER):
                raise said.as_error(self.setup.port)
            if each is not None:
                each(said)

    def _must_be_ok(self, line: bytes) -> None:
        said = sentence(line)
        if said.kind is not Kind.OK:
            raise said.as_error(self.setup.port)

    def _move_end(self, expected: float, end: float) -> float:
        return min(end, time.monotonic() + expected + self._d.move_extra)

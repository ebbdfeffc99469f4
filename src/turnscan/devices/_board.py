"""A turntable and its lasers behind one serial port: what the four dialects share."""

from __future__ import annotations

import contextlib
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

from turnscan.devices._guard import LONGEST_LEASE
from turnscan.devices._guard_client import Deadlines, Interrupted, Link
from turnscan.devices._left import Ledger, Left, new_counting
from turnscan.devices._line_protocol import Lines
from turnscan.devices._replies import Kind, Sentence, look_and_acknowledge, lost_place, sentence
from turnscan.devices._steps import Steps
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
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

_SETTLING = 0.03
"""s between two looks at a table that slows down."""
FEW_TURNS = 16
"""So far from its zero a board's count is exact."""

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
        self._unsettled = self._held = False
        self._offs = 0
        self._settled = link.darks
        """Darks of the link before the modes of the board were set: a move is sent only where there
        was none since, as a board that was reset would count it from another zero."""
        self._lit: frozenset[str] = frozenset()
        self._lost: TurnscanError | None = None
        self._remembers = False
        self._left = Left(new_counting(), 0, 0)
        self._ledger: Ledger | None = None
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
        """rad where the table stands, counted from where it was zero in this `counting`."""
        return self._steps.angle_of(self._unit)

    @property
    def remembers(self) -> bool:
        """Whether `angle` at connecting was that of an earlier time; otherwise it counts from zero.

        A board that counts zero may just as well have restarted; it is believed only where this
        computer has noted that the table was left there.
        """
        return self._remembers and self._lost is None

    @property
    def counting(self) -> str:
        """Names the stretch in which `angle` has one and the same zero; empty where not noted."""
        kept = self._ledger is not None and self._ledger.kept
        return self._left.counting if kept else ""

    def still(self, counting: str) -> bool | None:
        """Whether `angle` has the zero that it had in that `counting`; None where unknown."""
        if self._lost is not None:
            return False
        if counting and self._left.counting == counting:
            return True
        if not self._remembers:
            return False
        return None if not counting or self._left.adopted else False

    @property
    def alarm(self) -> str:
        """Why nothing moves until `acknowledge`; empty when nothing is wrong."""
        return "" if self._lost is None else str(self._lost)

    def move_to(self, angle: float, timeout: float) -> float:
        """See `Turntable`. The time is the shorter of ``timeout`` and the move's own plus 5 s.

        Raises DeviceRefused when `stop` was called, InputError for an angle that is none.
        """
        nearest = self._steps.unit_of(angle)
        end = time.monotonic() + timeout
        with self._command(timeout):
            if self._lit:
                self._switch(frozenset(), 1.0)
            self._stop.clear()
            target = self._reachable(nearest)
            beyond = self._steps.unit_of(self.setup.overshoot)
            if target < self._unit and beyond:
                self._leg(self._reachable(target - beyond), end)
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
        """See `Lasers`. Does not wait; raises LaserStateUnknown where it is not confirmed."""
        self._unsettled, self._held = True, False
        self._offs += 1
        self._lit = frozenset()
        heard = self._link.dark()
        if b"ALARM" in heard:
            self._lose(DeviceAlarm(
                f"{self.setup.port}: lasers were switched off while the table turned",
                hint=lost_place(self.setup.port),
            ))  # fmt: skip

    def acknowledge(self) -> None:
        """A person has looked and set the table to its mark: it stands at zero from now on."""
        with self._locked(self._d.acknowledge):
            self._end_hold()
            self._lines.clear()
            self._unlock()
            self._claim()
            self._zero()
            self._lost, self._remembers = None, True
            self._note(replace(self._left, fresh=False))
            self._set_modes()

    def look_over(self) -> bool:
        """End the alarm after a person has inspected the machine. Whether `angle` was kept."""
        with self._locked(self._d.acknowledge):
            self._end_hold()
            self._lines.clear()
            self._unlock()
            self._lost = None
            self._set_modes()
        return self._remembers

    def close(self) -> None:
        """Dark, and let go of the port. Raises LaserStateUnknown."""
        self._stop.set()
        self._link.close()

    # What a dialect adds.

    @abstractmethod
    def _default_units(self) -> int:
        """Steps of one turn where an address says nothing."""

    @abstractmethod
    def _connect(self) -> None:
        """Make sure of the board; the lasers are dark already."""

    def _settle(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Set the modes again after a dark. Raises DeviceRestarted where the place is lost."""

    def _count(self) -> int | None:
        """Units that the board says it has turned; None where it cannot say."""
        return None

    def _zero(self) -> None:
        """Where the table stands is zero from now on."""
        self._lose_count(self._count() or 0, 0)

    def _unlock(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Take a board out of its alarm."""

    @abstractmethod
    def _go(self, unit: int, end: float) -> None:
        """Turn there and be at rest; the counted unit is the caller's business."""

    def _tolerance(self) -> int:
        """Units by which the position that the board reports may be wrong."""
        return 0

    def _before_move(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Make sure that the board is as it was left; until then nothing turns."""

    def _come_to_rest(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """A move was broken off: let the table come to rest, and note where it is."""

    def _reachable(self, unit: int) -> int:
        """The unit nearest to one at which the board can stop."""
        return unit

    def _hold_still(self, ask: str) -> Sentence:
        """Hold, of GRBL and its kin; the status once the table is at rest.

        Raises DeviceTimeout where it does not come to rest.
        """
        end = time.monotonic() + self._d.acknowledge + self._d.move_extra
        self._lines.clear()
        self._link.write(b"!")
        before = None
        while True:
            self._link.write(ask.encode("ascii"))
            while (said := self._next_sentence(end)).kind is not Kind.STATUS:
                if said.kind in (Kind.ALARM, Kind.BANNER):
                    raise said.as_error(self.setup.port)
            slowing = said.fields["state"] in ("Run", "Jog") or said.text.startswith("<Hold:1")
            place = said.fields.get("MPos")
            if not slowing and place == before:
                return said
            before = place
            time.sleep(_SETTLING)

    def _next_sentence(self, end: float) -> Sentence:
        """The next sentence; the rest of an answer that was cut by a signal is passed over."""
        while True:
            line = self._lines.next(end, "'?'")
            with contextlib.suppress(DeviceGarbled):
                return sentence(line)

    def _halt(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Ask a turning board to stop; called from any thread."""

    def _hold(self) -> None:
        """`_halt` of GRBL and its kin; a table at rest is not held, but the lasers put out.

        A hold that reaches the board behind a reset lasts: the next command ends it.
        """
        if self._left.target is None:
            self.off()
        else:
            self._link.write(b"!")
            self._held = True  # afterwards: if a reset came meanwhile there is one too many

    def _end_hold(self) -> bool:
        """With a reset, where one may last; whether it was done."""
        held = self._held
        if held:
            self.off()
        return held

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
                    f"{self.setup.port}: waits for an acknowledgement after: {self._lost.message}",
                    hint=look_and_acknowledge(self.setup.port),
                )
            offs = self._offs
            try:
                offs += self._end_hold()
                if self._unsettled or self._settled != self._link.darks:
                    self._lines.clear()
                    self._set_modes()
                self._lines.expect_nothing()
                yield
            except BaseException as e:
                interrupted = self._interrupted(e, offs)
                if not isinstance(e, LaserStateUnknown):
                    self._panic(e)
                if isinstance(e, _NEEDS_A_PERSON) and not interrupted:
                    self._lose(e)
                raise

    def _set_modes(self) -> None:
        """Again after a dark; another one that comes meanwhile makes it necessary once more."""
        self._settled, self._unsettled = self._link.darks, False
        try:
            self._settle()
        except BaseException:
            self._unsettled = True
            raise

    def _interrupted(self, error: BaseException, offs: int) -> bool:
        """Whether an error says no more than that another thread put the lasers out, or stopped.

        ``offs``: how often they had been put out before the command.
        """
        if isinstance(error, (LeaseEnded, Interrupted)):
            return True
        broken_off = self._offs != offs or self._held
        return broken_off and isinstance(error, (DeviceTimeout, DeviceGarbled))

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
        if isinstance(error, DeviceRestarted):
            self._lose_count(self._unit - self._left.base, self._unit)
        elif isinstance(error, DeviceAlarm) and self._left.target is not None:
            self._note(replace(self._left, alarmed=True))
        if self._lost is None:
            self._lost = error

    def _switch(self, lit: frozenset[str], lease: float) -> None:
        mask = sum(1 << i for i, name in enumerate(self.names) if name in lit)
        self._lit = self._lit | lit
        try:
            self._link.light(mask, lease)
        except DeviceTimeout:
            with contextlib.suppress(DeviceGarbled):
                self._lines.expect_nothing()  # an alarm that came before says why
            raise
        self._lines.expect_nothing()  # a door that opened while it was lit
        self._lit = lit

    def _leg(self, target: int, end: float) -> None:
        """One way, in pieces where the board cannot be stopped."""
        piece = self._piece()
        while self._unit != target:
            there = target
            if piece is not None:
                there = self._unit + max(-piece, min(piece, target - self._unit))
                there = self._reachable(there)
            if self._stop.is_set():
                raise DeviceRefused(f"{self.setup.port}: stopped")
            self._turn(there, end)

    def _turn(self, there: int, end: float) -> None:
        """One move; where it is broken off the table comes to rest, so that its place is known."""
        self._before_move()
        if self._unsettled:  # a reset came since, and with it the board counts from elsewhere
            raise Interrupted(self.setup.port)
        self._claim()
        try:
            # In here, so that a signal between the note and the move finds the table at rest too.
            self._note(replace(self._left, target=there, sent=False, fresh=False))
            self._go(there, end)
        except BaseException as e:
            if not isinstance(e, (DeviceDisconnected, SafetyError, DeviceAlarm, DeviceRestarted)):
                with contextlib.suppress(TurnscanError):
                    self._come_to_rest()
            raise
        self._note(replace(self._left, unit=there, target=None, sent=False, alarmed=False))

    def _rebased(self, unit: int) -> int | None:
        """The whole turn at which the board is to count from zero again, before it counts too far.

        None where a move to ``unit`` needs no such thing.
        """
        turns = int(Fraction(unit - self._left.base) / self._steps.per_turn)
        if abs(turns) < FEW_TURNS or self._steps.per_turn.denominator != 1:
            return None
        return self._left.base + int(turns * self._steps.per_turn)

    # Where the table is.

    @property
    def _unit(self) -> int:
        return self._left.unit

    def _note(self, left: Left) -> None:
        """What is known of the table, from now on and for the next who connects."""
        self._left = left
        if self._ledger is not None:
            self._ledger.write(left)

    def _claim(self) -> None:
        if self._ledger is not None:
            self._ledger.claim()

    def _found(self, count: int | None, *, locked: bool = False) -> None:
        """Connected: where the table stands by the board's own count and by what was noted.

        ``count`` is None where the board has none. ``locked``: it waits in an alarm.
        """
        self._ledger = Ledger(self.setup.port, type(self).__name__, self._steps)
        before = self._ledger.read()
        place = None if before is None else before.place(count, self._tolerance(), locked=locked)
        self._remembers = True
        if before is not None and place is not None:
            self._remembers = not before.fresh
            self._note(replace(before, unit=place, target=None, sent=False, alarmed=False))
        elif before is None and count and not locked:
            self._note(Left(new_counting(), 0, count, adopted=True))
        else:
            self._lose_count(count or 0, count or 0)
        if locked:
            self._lose(DeviceAlarm(
                f"{self.setup.port}: the controller was found in an alarm",
                hint=look_and_acknowledge(self.setup.port),
            ))  # fmt: skip

    def _lose_count(self, count: int, unit: int) -> None:
        """What was counted is worth nothing any more: from now on ``count`` means ``unit``."""
        self._remembers = False
        self._note(Left(new_counting(), unit - count, unit, fresh=True))

    def _agree(self, count: int | None = None) -> None:
        """The table is at rest. Raises DeviceRestarted where it is not where it was left."""
        count = self._count() if count is None else count
        place = self._left.place(count, self._tolerance(), watched=True)
        if place is None:
            raise self._elsewhere(count, self._unit)
        self._note(replace(self._left, unit=place, target=None, sent=False, alarmed=False))

    def _elsewhere(self, count: int | None, unit: int) -> DeviceRestarted:
        return DeviceRestarted(
            f"{self.setup.port}: the controller counts {count} steps where "
            f"{unit - self._left.base} are right",
            hint=lost_place(self.setup.port),
        )

    def _ask(
        self,
        text: str,
        end: float | None = None,
        *,
        each: Callable[[Sentence], None] | None = None,
        until: Kind = Kind.OK,
        darks: int | None = None,
    ) -> Sentence:
        """Send a line and read to its answer; settings, messages, numbers go to ``each``.

        ``darks``: see `Link.write`.

        Raises DeviceTimeout, DeviceGarbled, DeviceRefused, DeviceAlarm, DeviceRestarted.
        """
        self._lines.expect_nothing()
        self._link.write(text.encode("ascii"), darks)
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

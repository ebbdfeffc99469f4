"""FabScanPi: every byte is echoed, a prompt ends every answer, moves are relative."""

from __future__ import annotations

import math
import re
import time
from dataclasses import replace

from turnscan.devices._board import Board
from turnscan.devices._replies import lost_place
from turnscan.devices._steps import Steps, travel_time
from turnscan.errors import DeviceGarbled, DeviceRestarted

PHASES = 3200
"""T of one turn where an address says nothing."""
PER_PULSE = 4
"""T of one pulse: the board walks through a Gray code, each move from its beginning."""
LONGEST_MOVE = 32767
"""T; the board reads numbers with 16 bits."""
ACCELERATION = 500.0
"""T/s² of G02."""
_VERSION = re.compile(rb"v\.\d{8}")
_MARK = b"M20"
"""Half a line, which a board forgets when it restarts; it does nothing but put a laser out."""


class FabScanBoard(Board):
    """A FabScanPi board. It answers every line alike, so only the echo shows that it understood.

    It knows no absolute position, keeps no alarm, restarts in silence and is deaf while it turns.
    So between commands half a line lies in its buffer: completed, it asks for the version, and a
    board that has restarted does not understand it. While a laser burns there is none. Of its
    commands G02 alone is used: after G06 (which ``M05`` with a green of 6 starts, too) its moves
    are wrong. ``steps_per_rev`` counts T; the table is moved by whole pulses.
    """

    def _default_units(self) -> int:
        return PHASES

    def _connect(self) -> None:
        self._marked = self._in_phase = False
        self._move_sent = b""
        self._steps = Steps(self._steps.per_turn / PER_PULSE)
        version = self._say("M200;")
        if len(version) != 1 or not _VERSION.fullmatch(version[0]):
            raise DeviceGarbled(f"{self.setup.port}: not a FabScanPi: {version!r}")
        self._rate = 1200.0
        if self.setup.speed is not None:
            turns = self.setup.speed / (2 * math.pi)
            self._rate = min(3000.0, turns * float(self._steps.per_turn) * PER_PULSE)
        self._found(None)
        self._settle()

    def _settle(self) -> None:
        self._marked = False  # what was dark before has completed the line
        self._agree()
        self._say("M17")
        self._mark()

    def _unlock(self) -> None:
        self._in_phase = False

    def _mark(self) -> None:
        self._link.write(_MARK)
        end = time.monotonic() + self._d.acknowledge
        self._lines.echo(_MARK, end, repr(_MARK.decode()))
        self._marked = True

    def _unmark(self) -> None:
        """Raises DeviceRestarted where the board has forgotten the half line."""
        if self._marked:
            self._marked = False
            if not any(
                map(_VERSION.fullmatch, self._said("0;", time.monotonic() + self._d.acknowledge))
            ):
                raise DeviceRestarted(
                    f"{self.setup.port}: the controller has restarted since it was last asked",
                    hint=lost_place(self.setup.port),
                )

    def _say(self, text: str, end: float | None = None) -> list[bytes]:
        """Send a line; the lines between its echo and the prompt."""
        self._unmark()
        return self._said(text, time.monotonic() + self._d.acknowledge if end is None else end)

    def _said(self, text: str, end: float) -> list[bytes]:
        self._lines.expect_nothing()
        self._link.write(f"{text}\n".encode())
        said: list[bytes] = []
        while (line := self._lines.next(end, repr(text))) != b">":
            said.append(line)
            if line == self._move_sent:
                self._note(replace(self._left, sent=True))
            if len(said) > 20 or not line.isascii():
                raise DeviceGarbled(f"{self.setup.port}: answered {text!r} with {line[:40]!r}")
        if not said or said[0] != text.encode():
            heard = said[0][:40] if said else b""
            raise DeviceGarbled(f"{self.setup.port}: echoed {heard!r} for {text!r}")
        return said[1:]

    def _switch(self, lit: frozenset[str], lease: float) -> None:
        self._unmark()
        super()._switch(lit, lease)
        if not lit:
            self._mark()

    def _leg(self, target: int, end: float) -> None:
        # Where STEP and DIR stand is not known, and a first pulse forwards might go backwards.
        if not self._in_phase and target > self._unit:
            super()._leg(self._unit - 1, end)
        super()._leg(target, end)

    def _before_move(self) -> None:
        self._say("M17")  # a board that has restarted unseen has released its motor

    def _go(self, unit: int, end: float) -> None:
        steps = PER_PULSE * (unit - self._unit)
        text = f"G02 T{steps} F{self._rate:.0f}"
        end = self._move_end(travel_time(steps, self._rate, ACCELERATION), end)
        self._move_sent = text.encode()
        rest = self._said(text, end)
        if rest:
            self._move_sent = b""
            raise DeviceRestarted(f"{self.setup.port}: said {rest[0][:40]!r} while turning")
        # Before anything else: a signal from here on finds the table at rest where it was to go.
        self._note(replace(self._left, unit=unit, target=None, sent=False))
        self._move_sent = b""
        self._in_phase = True
        self._mark()

    def _come_to_rest(self) -> None:
        """It cannot be stopped: wait for the end of the piece that it is in."""
        sent, self._move_sent = self._move_sent, b""
        if self._left.target is None:
            return
        end = time.monotonic() + self._d.acknowledge + self._d.move_extra
        while sent and self._lines.next(end, "'G02'") != b">":
            pass  # the prompt comes after the echo, which a signal may have swallowed
        if sent:
            self._in_phase = True
            self._note(replace(self._left, unit=self._left.target, target=None, sent=False))
        else:
            self._note(replace(self._left, target=None))

    def _piece(self) -> int | None:
        return min(LONGEST_MOVE // PER_PULSE, max(1, round(self._steps.per_turn / 24)))

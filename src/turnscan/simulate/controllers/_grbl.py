"""GRBL 1.1h as it behaves on an Arduino Uno, after its published source, in words of our own."""

from __future__ import annotations

from dataclasses import replace

from turnscan.simulate.controllers import _grbl_reports as reports
from turnscan.simulate.controllers._grbl_machine import STARTUP_LINES, GrblMachine, Queued, Waiting
from turnscan.simulate.controllers._grbl_words import Block, Modes, Refused, number, parse

_DIVISORS = ("100", "101", "102", "110", "111", "112", "120", "121", "122")
"""Steps/mm, rates and accelerations."""


class GrblFirmware(GrblMachine):
    """GRBL 1.1h. Laser outputs are ``m3`` (spindle), ``m8`` and, built with ``mist``, ``m7``.

    The table is the X axis; words of the others are read and have no effect.
    """

    def _start_up(self) -> Waiting:
        for line in self.startup:
            if line:
                try:
                    code = yield from self._gcode(line)
                except Refused as refusal:
                    code = refusal.code
                self.say(b">%s:%s" % (line.encode("latin-1"), reports.status(code or 0)))
        return None

    def _line(self, text: str, over: bool) -> Waiting:
        if over:
            return 11
        if not text:
            return 0
        if text.startswith("$"):
            return (yield from self._system(text))
        if self.locked or self.jogging:
            return 9
        return (yield from self._gcode(text))

    def _gcode(self, text: str, jog: bool = False) -> Waiting:
        before = self.modes
        block = parse(text, before, mist=self._mist, jog=jog)
        if block.moves and self._trip("move"):
            return None
        lights = block.modes.spindle != 5 or block.modes.coolant
        if lights and set(text) & {"M"} and self._trip("light"):
            return None
        if jog:
            return (yield from self._jog(block))
        yield from self._switch(before, block)
        if block.once == 4 and not self.check:
            yield self._idle
            end = self.now + block.values["P"]
            self.after(block.values["P"], lambda: None)
            yield lambda: self.now >= end and not self._suspended
        self._coordinates(block)
        yield from self._motion(block)
        self.modes = replace(self.modes, motion=block.modes.motion)
        if block.flow >= 0:
            yield from self._flow_of(block.flow)
        return 0

    def _switch(self, before: Modes, block: Block) -> Waiting:
        """Spindle, then coolant, each after all moves that were planned before it."""
        modes, laser = block.modes, self._flag("32")
        disabled = laser and modes.motion not in (1, 2, 3)
        power = 0.0 if disabled else modes.speed
        force = (
            laser and not block.moves and before.spindle == 3
            and (before.motion in (1, 2, 3)) == disabled
        )  # fmt: skip
        changed = (before.speed != modes.speed or force) and not (laser and block.moves)
        if changed and before.spindle != 5 and not self.check:
            yield self._idle
            self._spin(before.spindle, power)
        if before.spindle != modes.spindle and not self.check:
            yield self._idle
            self._spin(modes.spindle, power)
        self._show()
        if before.coolant != modes.coolant and not self.check:
            yield self._idle
            self._cool(modes.coolant)
        self.modes = replace(modes, motion=before.motion)
        self._show()
        return None

    def _coordinates(self, block: Block) -> None:
        """G10, G28.1, G30.1, G92 and G92.1, and the system in force."""
        x, at = block.values.get("X"), self._planned / self.scale
        length, system = self.modes.length, str(self.modes.system)
        if block.once == 92.1:
            self.shift = 0.0
        elif block.once in (28.1, 30.1):
            self.stored[f"{block.once:.0f}"] = at
        elif x is not None and block.once == 92:
            self.shift = at - self.stored[system] - x * length
        elif x is not None and block.once == 10:
            chosen = int(block.values.get("P", 0))
            place = at - self.shift - x * length if int(block.values["L"]) == 20 else x * length
            self.stored[str(53 + chosen) if chosen else system] = place
        else:
            return
        self._reports.offset_due()

    def _motion(self, block: Block) -> Waiting:
        motion = block.modes.motion
        if block.once in (28, 30):
            targets = [self._target(block)] if block.axis and "X" in block.values else []
            targets.append(round(self.stored[f"{block.once:.0f}"] * self.scale))
            for target in targets:
                yield from self._plan(target, 0.0)
        elif block.moves and motion != 80:
            yield from self._plan(self._target(block), 0.0 if motion == 0 else self._rate(block))
            if motion >= 380 and not self.check:
                yield self._idle
                if motion in (382, 384):  # nothing touched the probe
                    self._alarm(5)
        return None

    def _target(self, block: Block) -> int:
        if "X" not in block.values:
            return self._planned
        x = block.values["X"] * block.modes.length
        if block.once != 53:
            if block.modes.distance == 91:
                x += self._planned / self.scale
            else:
                x += self.stored[str(block.modes.system)] + self.shift
        return round(x * self.scale)

    def _rate(self, block: Block) -> float:
        if block.modes.feed_mode == 93:  # the whole way in a minute divided by F
            return abs(self._target(block) - self._planned) / self.scale * block.modes.feed
        return block.modes.feed

    def _plan(self, target: int, rate: float) -> Waiting:
        """A rate of 0 is as fast as it goes."""
        if self.check:
            return None
        yield self._room
        if target != self._planned:
            modes, laser = self.modes, self._flag("32")
            power = 0.0 if modes.spindle == 5 or (laser and not rate) else modes.speed
            pulsed = laser and modes.spindle == 4
            self._queue.append(Queued(target, rate, power, pulsed))
            self._planned = target
        return None

    def _jog(self, block: Block) -> Waiting:
        if not block.moves:
            return 26
        yield from self._plan(self._target(block), self._rate(block))
        self.jogging = self.busy
        return 0

    def _flow_of(self, flow: int) -> Waiting:
        yield self._idle
        if flow == 0:
            if not self.check:
                self._pause()
                yield self._idle
            return None
        self.modes = replace(
            self.modes, motion=1, plane=17, distance=90, feed_mode=94, system=54, spindle=5,
            coolant=frozenset(),
        )  # fmt: skip
        if not self.check:
            self._reports.offset_due()
            self._spin(5, 0.0)
            self._cool(frozenset())
            self._show()
        self.overrides = dict.fromkeys(self.overrides, 100)
        self.say(reports.message("Pgm End"))
        return None

    # Lines that begin with a dollar.

    def _state(self) -> str:
        return reports.state(self._snapshot())

    def _system(self, text: str) -> Waiting:
        state, head = self._state(), text[1:2]
        if head == "":
            self.say(reports.HELP)
            return 0
        if head == "J":
            if state not in ("Idle", "Jog"):
                return 8
            return (yield from self._gcode(text[3:], jog=True)) if text[2:3] == "=" else 3
        if head in "$GCX":
            return self._ask(head, state) if len(text) == 2 else 3
        if state not in ("Idle", "Alarm"):
            return 8
        if head == "N" and len(text) > 2:
            return (yield from self._store_line(text)) if state == "Idle" else 8
        return self._keep(text)

    def _ask(self, head: str, state: str) -> int:
        if head == "$":
            if state in ("Run", "Hold:0", "Hold:1"):
                return 8
            self.say(reports.settings(self.settings))
        elif head == "G":
            self.say(reports.modes(self.modes))
        elif head == "C":
            if self.check:
                self.say(reports.message("Disabled") + b"ok\r\n")
                self._task = None
                self._reset()
                return 0
            if state != "Idle":
                return 8
            self.check = True
            self.say(reports.message("Enabled"))
        elif self.locked:
            if self.door == "open":
                return 13
            self.locked = False
            self.say(reports.message("Caution: Unlocked"))
        return 0

    def _keep(self, text: str) -> int:
        """Commands for a board at rest, and settings."""
        if text == "$#":
            self.say(reports.parameters(self.stored, self.shift))
        elif text == "$I":
            self.say(reports.BUILD)
        elif text == "$N":
            self.say(
                b"".join(
                    b"$N%d=%s\r\n" % (i, s.encode("latin-1")) for i, s in enumerate(self.startup)
                )
            )
        elif text == "$H":
            if not self._flag("22"):
                return 5
            self._alarm(9)  # a turntable has no switch to find
        elif text == "$SLP":
            self.after(0.0, self._sleep)
        elif text in ("$RST=$", "$RST=*", "$RST=#"):
            if text != "$RST=#":
                self.settings = dict(reports.DEFAULTS)
            if text != "$RST=$":
                self.stored = dict.fromkeys(reports.STORED, 0.0)
            if text == "$RST=*":
                self.startup = [""] * STARTUP_LINES
            self.say(reports.message("Restoring defaults") + b"ok\r\n")
            self._task = None
            self._reset()
        else:
            return self._setting(text)
        return 0

    def _sleep(self) -> None:
        self.asleep = True
        self.speed, self._flow = 0.0, frozenset()
        self._show()
        self.say(reports.message("Sleeping"))

    def _setting(self, text: str) -> int:
        key, at = number(text, 1)
        if text[at : at + 1] != "=":
            return 3
        value, at = number(text, at + 1)
        name = str(int(key))
        if at != len(text) or key > 255 or name not in self.settings:
            return 3
        if value < 0 or (name in _DIVISORS and float(reports.shown("0.000", value)) == 0):
            return 4  # the firmware takes a zero, and divides by it at the next move
        if name == "0" and value < 3:
            return 6
        if name == "20" and value and not self._flag("22"):
            return 10
        self.settings[name] = reports.shown(self.settings[name], value)
        if name == "22" and not value:
            self.settings["20"] = "0"
        return 0

    def _store_line(self, text: str) -> Waiting:
        """A line that every start runs; it is run at once, too."""
        key, at = number(text, 2)
        if text[at : at + 1] != "=":
            return 3
        line = text[at + 1 :]
        if line:
            code = yield from self._gcode(line)
            if code:
                return code
        if int(key) >= STARTUP_LINES:
            return 3
        self.startup[int(key)] = line
        return 0

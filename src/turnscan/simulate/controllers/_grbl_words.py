"""How GRBL 1.1 reads a line: words into numbers, modal groups, and its numbered refusals.

After its published source, in words of our own; what looks odd here is odd on the board, too.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field, replace
from typing import Any

_DIGITS = 8
"""As many count; more only shift the decimal point."""
_INCH = 25.4
_MOST_COORDINATES = 6
_AXES = frozenset("XYZ")
_NOT_NEGATIVE = frozenset("FNPTS")
_KNOWN = frozenset("FIJKLNPRSTXYZ")


class Refused(Exception):
    """The board answers ``error:code``."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(frozen=True)
class Modes:
    """What stays in force from one line to the next."""

    motion: int = 0
    """80: none; 380 and more: a probe."""
    plane: int = 17
    units: int = 21
    distance: int = 90
    feed_mode: int = 94
    system: int = 54
    spindle: int = 5
    coolant: frozenset[str] = frozenset()
    tool: int = 0
    feed: float = 0.0
    """mm/min."""
    speed: float = 0.0
    """Of the spindle, which is the power of a laser."""

    @property
    def length(self) -> float:
        """mm of a unit of length."""
        return _INCH if self.units == 20 else 1.0


@dataclass
class Block:
    """A line that was understood."""

    modes: Modes
    axis: str = ""
    """What the axis words are for: ``motion``, ``set`` (G10, G28, G30, G92) or ``tool``."""
    once: float = 0.0
    """A command without a lasting effect: 4, 10, 28, 28.1, 30, 30.1, 53, 92 or 92.1."""
    flow: int = -1
    """Program flow: 0 pause, 2 or 30 end; -1: none."""
    values: dict[str, float] = field(default_factory=dict)

    @property
    def moves(self) -> bool:
        """Whether an axis of the board turns."""
        return self.axis == "motion" and bool(_AXES & self.values.keys())


def number(text: str, at: int) -> tuple[float, int]:
    """The number at a place of a line, and where it ends. Raises Refused(2) where there is none.

    In single precision: the board has no other.
    """
    begin = at
    if text[at : at + 1] in ("+", "-"):
        at += 1
    whole, exponent, digits, point = 0, 0, 0, False
    while at < len(text) and (text[at] in "0123456789" or (text[at] == "." and not point)):
        if text[at] == ".":
            point = True
        else:
            digits += 1
            if digits <= _DIGITS:
                whole, exponent = whole * 10 + int(text[at]), exponent - point
            elif not point:
                exponent += 1
        at += 1
    if not digits:
        raise Refused(2)
    value = whole * 10.0**exponent
    return single(-value if text[begin] == "-" else value), at


def single(value: float) -> float:
    """The nearest number of single precision."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def command(value: float) -> tuple[int, int]:
    """A G or M number as the board takes it apart: a byte, and hundredths in 16 bits.

    Both wrap around: ``M16387`` is M3, because 100 · 16384 is a multiple of 65536.
    """
    whole = int(value) & 0xFF
    hundredths = math.floor(abs(100 * (value - whole)) + 0.5)
    return whole, (hundredths if value >= whole else -hundredths) & 0xFFFF


class _Reader:
    """One line's words, into a `Block`."""

    def __init__(self, modes: Modes, jog: bool) -> None:
        if jog:
            modes = replace(modes, motion=1, feed_mode=94)
        self.block = Block(modes)
        self.groups: set[str] = set()

    def read(self, text: str) -> None:
        at = 0
        while at < len(text):
            letter = text[at]
            if not "A" <= letter <= "Z":
                raise Refused(1)
            value, at = number(text, at + 1)
            if letter == "G":
                self._group(self._g(*command(value)))
            elif letter == "M":
                self._group(self._m(*command(value)))
            else:
                self._value(letter, value)

    def _group(self, name: str) -> None:
        if name in self.groups:
            raise Refused(21)
        self.groups.add(name)

    def _set(self, name: str, value: int) -> None:
        lasting: dict[str, Any] = {name: value}
        self.block.modes = replace(self.block.modes, **lasting)

    def _axis(self, kind: str) -> None:
        if self.block.axis:
            raise Refused(24)
        self.block.axis = kind

    def _g(self, whole: int, part: int) -> str:
        if whole in (10, 28, 30, 92, 4, 53):
            return self._g_once(whole, part)
        if whole in (0, 1, 2, 3, 38):
            self._axis("motion")
            if whole == 38 and part not in (20, 30, 40, 50):
                raise Refused(20)
            self._set("motion", 380 + part // 10 if whole == 38 else whole)
            return self._whole(0 if whole == 38 else part, "motion")
        if whole in (43, 49):
            self._axis("tool")
            if whole == 43 and part != 10:
                raise Refused(20)
            return "tool"
        if whole in (90, 91) and part:
            if (whole, part) != (91, 10):
                raise Refused(20)
            return "arc distance"
        lasting = {
            80: "motion", 17: "plane", 18: "plane", 19: "plane", 90: "distance", 91: "distance",
            93: "feed_mode", 94: "feed_mode", 20: "units", 21: "units", 40: "", 61: "",
            **dict.fromkeys(range(54, 60), "system"),
        }  # fmt: skip
        if whole not in lasting or (whole == 61 and part):
            raise Refused(20)
        self._whole(part, "")
        if lasting[whole]:
            self._set(lasting[whole], whole)
        return lasting[whole] or f"G{whole}"

    def _g_once(self, whole: int, part: int) -> str:
        if whole in (10, 28, 30, 92) and part == 0:
            self._axis("set")
        if whole in (28, 30, 92):
            if part not in (0, 10):
                raise Refused(20)
            self.block.once = whole + part / 100
            return "once"
        self.block.once = whole
        return self._whole(part, "once")

    def _whole(self, part: int, group: str) -> str:
        if part:
            raise Refused(23)
        return group

    def _m(self, whole: int, part: int) -> str:
        if part:
            raise Refused(23)
        if whole in (0, 1, 2, 30):
            self.block.flow = -1 if whole == 1 else whole
            return "flow"
        if whole in (3, 4, 5):
            self._set("spindle", whole)
            return "spindle"
        if whole in (7, 8, 9):
            now = self.block.modes.coolant | {f"m{whole}"}
            coolant = frozenset() if whole == 9 else now
            self.block.modes = replace(self.block.modes, coolant=coolant)
            return "coolant"
        raise Refused(20)

    def _value(self, letter: str, value: float) -> None:
        if letter not in _KNOWN:
            raise Refused(20)
        if letter == "T" and value > 255:
            raise Refused(38)
        if letter in self.block.values:
            raise Refused(25)
        if letter in _NOT_NEGATIVE and value < 0:
            raise Refused(4)
        self.block.values[letter] = value


def parse(text: str, modes: Modes, *, mist: bool, jog: bool = False) -> Block:
    """A line without blanks and comments, in capitals. Raises Refused.

    ``mist``: the board was built with M7. A jog's text begins after ``$J=``.
    """
    reader = _Reader(modes, jog)
    reader.read(text)
    block, values = reader.block, reader.block.values
    if "m7" in block.modes.coolant and not mist:
        raise Refused(20)
    if _AXES & values.keys() and not block.axis:
        block.axis = "motion"
    if values.get("N", 0) > 10_000_000:
        raise Refused(27)
    _feed(block, modes, jog)
    block.modes = replace(
        block.modes, speed=values.get("S", modes.speed), tool=int(values.get("T", modes.tool))
    )
    _check(block, set(values))
    if jog and (reader.groups - {"distance", "units", "once"} or block.once not in (0, 53)):
        raise Refused(16)
    return block


def _feed(block: Block, before: Modes, jog: bool) -> None:
    """The feed rate in mm/min, 0 where none is defined."""
    given = block.values.get("F")
    if jog and given is None:
        raise Refused(22)
    if block.modes.feed_mode == 93:
        if block.axis == "motion" and block.modes.motion not in (0, 80) and given is None:
            raise Refused(22)
        feed = given or 0.0
    elif given is not None:
        feed = given * block.modes.length
    else:
        feed = before.feed if before.feed_mode == 94 else 0.0
    block.modes = replace(block.modes, feed=feed)


def _check(block: Block, unused: set[str]) -> None:
    """What the board refuses of a whole line. Raises Refused."""
    axes, motion = _AXES & block.values.keys(), block.modes.motion
    if block.once == 4:
        if "P" not in unused:
            raise Refused(28)
        unused.discard("P")
    if block.axis == "tool" and axes - {"Z"}:
        raise Refused(37)
    if block.once in (10, 92) and not axes:
        raise Refused(26)
    if block.once == 10:
        _check_coordinates(block.values)
        unused -= {"L", "P"}
    if block.once == 53 and motion not in (0, 1):
        raise Refused(30)
    if motion == 80 and axes:
        raise Refused(31)
    if block.axis == "motion" and motion != 80:
        _check_motion(block, axes, unused)
    unused -= {"N", "F", "S", "T"}
    if block.axis:
        unused -= _AXES
    if unused:
        raise Refused(36)


def _check_coordinates(values: dict[str, float]) -> None:
    if not {"L", "P"} & values.keys():
        raise Refused(28)
    if values.get("P", 0) > _MOST_COORDINATES:
        raise Refused(29)
    if int(values.get("L", 0)) not in (2, 20) or ("R" in values and int(values["L"]) == 2):
        raise Refused(20)


def _check_motion(block: Block, axes: frozenset[str], unused: set[str]) -> None:
    motion = block.modes.motion
    if motion != 0 and block.modes.feed == 0:
        raise Refused(22)
    if motion in (0, 1):
        if not axes:
            block.axis = ""
        return
    if not axes:
        raise Refused(26)
    if motion in (2, 3):
        if not axes & {"X", "Y"}:
            raise Refused(32)
        if "R" not in unused and not {"I", "J"} & unused:
            raise Refused(35)
        unused -= {"R"} if "R" in unused else {"I", "J", "K"}

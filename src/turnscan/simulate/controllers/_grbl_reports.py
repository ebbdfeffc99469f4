"""What GRBL 1.1h says: status, settings, parameters, messages, and its override bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from turnscan.simulate.controllers._grbl_words import Modes

_DEFAULTS = (
    "0=10 1=25 2=0 3=0 4=0 5=0 6=0 10=1 11=0.010 12=0.002 13=0 20=0 21=0 22=0 23=0 24=25.000 "
    "25=500.000 26=250 27=1.000 30=1000 31=0 32=0 100=250.000 101=250.000 102=250.000 110=500.000 "
    "111=500.000 112=500.000 120=10.000 121=10.000 122=10.000 130=200.000 131=200.000 132=200.000"
)
DEFAULTS: Mapping[str, str] = dict(pair.split("=") for pair in _DEFAULTS.split())
STORED = ("54", "55", "56", "57", "58", "59", "28", "30")
"""Coordinates in EEPROM, in the order of ``$#``."""
UNLOCK = b"[MSG:'$H'|'$X' to unlock]\r\n"
HELP = b"[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]\r\n"
BUILD = b"[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\n"


def _by(step: int, least: int, most: int) -> Callable[[int], int]:
    return lambda now: max(least, min(most, now + step))


def _to(value: int) -> Callable[[int], int]:
    return lambda now: value


OVERRIDES: Mapping[int, tuple[str, Callable[[int], int]]] = {
    0x90: ("feed", _to(100)), 0x91: ("feed", _by(10, 10, 200)), 0x92: ("feed", _by(-10, 10, 200)),
    0x93: ("feed", _by(1, 10, 200)), 0x94: ("feed", _by(-1, 10, 200)),
    0x95: ("rapid", _to(100)), 0x96: ("rapid", _to(50)), 0x97: ("rapid", _to(25)),
    0x99: ("spindle", _to(100)), 0x9A: ("spindle", _by(10, 10, 200)),
    0x9B: ("spindle", _by(-10, 10, 200)), 0x9C: ("spindle", _by(1, 10, 200)),
    0x9D: ("spindle", _by(-1, 10, 200)),
}  # fmt: skip


def shown(like: str, value: float) -> str:
    """A setting's value as the board lists it."""
    return f"{float(value):.3f}" if "." in like else f"{float(value):.0f}"


def settings(values: Mapping[str, str]) -> bytes:
    """The answer to ``$$``."""
    return "".join(f"${k}={v}\r\n" for k, v in values.items()).encode()


def status(code: int) -> bytes:
    """The answer to a line."""
    return f"error:{code}\r\n".encode() if code else b"ok\r\n"


def message(text: str) -> bytes:
    """A message in brackets."""
    return f"[MSG:{text}]\r\n".encode()


def modes(now: Modes) -> bytes:
    """The answer to ``$G``."""
    motion = f"38.{now.motion - 380}" if now.motion >= 380 else str(now.motion)
    coolant = " ".join(sorted(m.upper() for m in now.coolant)) or "M9"
    return (
        f"[GC:G{motion} G{now.system} G{now.plane} G{now.units} G{now.distance} G{now.feed_mode} "
        f"M{now.spindle} {coolant} T{now.tool} F{now.feed / now.length:.0f} S{now.speed:.0f}]\r\n"
    ).encode()


def parameters(stored: Mapping[str, float], shift: float) -> bytes:
    """The answer to ``$#``."""
    text = "".join(f"[G{name}:{stored[name]:.3f},0.000,0.000]\r\n" for name in STORED)
    text += f"[G92:{shift:.3f},0.000,0.000]\r\n[TLO:0.000]\r\n[PRB:0.000,0.000,0.000:0]\r\n"
    return text.encode()


@dataclass(frozen=True)
class Snapshot:
    """What a board is doing, as far as a status report tells."""

    slowing: bool
    asleep: bool
    locked: bool
    check: bool
    door: str
    """``open``, ``closed``, ``restoring`` or empty."""
    hold: bool
    jogging: bool
    busy: bool
    settings: Mapping[str, str]
    modes: Modes
    offset: float
    """Of the coordinate system in use, mm."""
    place: float
    """mm of the X axis."""
    rate: float
    """mm/s."""
    planner: int
    """Moves for which the planner has room."""
    inbox: int
    """Bytes for which the receive buffer has room."""
    speed: float
    """Of the spindle."""
    overrides: Mapping[str, int]
    lit: frozenset[str]


def state(board: Snapshot) -> str:
    """What a status report begins with."""
    if board.asleep:
        return "Sleep"
    if board.locked:
        return "Alarm"
    if board.check:
        return "Check"
    if board.door:
        return (
            f"Door:{2 if board.slowing else {'open': 1, 'closed': 0, 'restoring': 3}[board.door]}"
        )
    if board.hold:
        return f"Hold:{int(board.slowing)}"
    if board.jogging:
        return "Jog"
    return "Run" if board.busy else "Idle"


class Reports:
    """Status reports: offsets and overrides are in only some of them."""

    def __init__(self) -> None:
        self._offset = self._overrides = 0

    def offset_due(self) -> None:
        """The next report contains the offset."""
        self._offset = 0

    def overrides_due(self) -> None:
        """The next report without an offset contains overrides and outputs."""
        self._overrides = 0

    def status(self, board: Snapshot) -> bytes:
        """The answer to ``?``."""
        word, mask = state(board), int(float(board.settings["10"]))
        inches = float(board.settings["13"]) != 0
        places, length = (4, 25.4) if inches else (3, 1.0)
        rest = ",".join([f"{0:.{places}f}"] * 2)
        place = board.place - (0.0 if mask & 1 else board.offset)
        rate = board.rate * 60 / length
        text = f"<{word}|{'M' if mask & 1 else 'W'}Pos:{place / length:.{places}f},{rest}"
        if mask & 2:
            text += f"|Bf:{board.planner},{board.inbox}"
        text += f"|FS:{rate:.0f},{board.speed:.0f}"
        moving = word.startswith(("Run", "Hold", "Jog", "Door"))
        if self._offset > 0:
            self._offset -= 1
        else:
            self._offset = 29 if moving else 9
            self._overrides = max(self._overrides, 1)
            text += f"|WCO:{board.offset / length:.{places}f},{rest}"
        if self._overrides > 0:
            self._overrides -= 1
        else:
            self._overrides = 19 if moving else 9
            o = board.overrides
            text += f"|Ov:{o['feed']},{o['rapid']},{o['spindle']}" + _outputs(board)
        return f"{text}>\r\n".encode()


def _outputs(board: Snapshot) -> str:
    letters = ""
    if board.speed > 0:
        letters += "C" if board.modes.spindle == 4 else "S"
    letters += "F" * ("m8" in board.lit) + "M" * ("m7" in board.lit)
    return f"|A:{letters}" if letters else ""

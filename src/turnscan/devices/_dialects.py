"""The commands that switch the lasers of each kind of board, and the lines that is permitted.

These are the only bytes in turnscan that light a laser. The guard imports this module without the
rest of turnscan, so it needs nothing but the standard library and pyserial (and, for an
instrument, PyVISA).
"""

from __future__ import annotations

import contextlib
import errno
import re
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

_MOST_HEARD = 4096
_LONGEST_LOSS = 24
"""Bytes on the way to a board that may get lost in one stretch without lighting anything."""
_LONGEST_LINE = 64
"""Bytes; below what any of the firmwares takes without cutting it."""


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
    lines: re.Pattern[bytes]
    """The lines that is permitted from the scanner, without their end. None of them lights a laser,
    neither alone nor behind what is left of another that was truncated: none begins with a digit
    but 0, with which no word for light ends.
    """
    banner: re.Pattern[bytes]
    """What shows that a board of this kind is there."""
    instant: frozenset[bytes] = frozenset()
    """Bytes that the board picks out of the stream wherever they stand, or half a line that it is
    to keep; they pass as a frame of their own only. Not ``~``: going on after a hold or a door
    would restore the light."""
    lit_lines: re.Pattern[bytes] | None = None
    """Those of the lines that is permitted while a laser burns; None: all."""
    holds: bool = False
    """Whether ``!`` stops its table so that a reset then keeps the place, which ``?`` tells."""


_OK = r"(?:^|\n)ok\r\n"


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
    # Where a stretch gets lost, two lines become one: "L 0 " and "1 0" would light laser 0. So its
    # line is the first, and stands far behind the others when all of them are sent again.
    once = [_x(f"L {i} 0\r", rf"SET_LASER: {i}\(-?\d+\) = (?:0|-1)\r\n") for i in (1, 0, 2, 3)]
    again = Exchange(b"\r" * _LONGEST_LOSS + once[0].send, once[0].confirm)
    return [Exchange(b"\r" + once[0].send, once[0].confirm), *once[1:], again, *once[1:]]


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


_NUMBER = r"-?\d{1,7}(?:\.\d{1,6})?"
# Spellings that turnscan uses, and no others: there is no need to know what a firmware makes of the
# rest. GRBL drops what overflows its buffer, so that two lines may become one: none has an M.
_GRBL = rf"\$[$#GINX]|(?:(?:G(?:0?[01]|4|10|20|21|54|90|91|92|94)|[XFPL]{_NUMBER}) ?)+"
_HORUS = rf"[?!]|\$[$#GINX]|G(?:0?1|50)(?:[XF]{_NUMBER})*|M(?:17|18|50)"
# With half of M20 before it, "0;" asks for the version.
_FABSCAN_LINE = r"0;|M(?:17|18|100|114|200|201);?|G0?[0-2](?: [TLF]-?\d{1,6})+;?"
_SARDAUSCAN = r"sardauscan|T(?: [SC]| [AR] -?\d{1,6})?"
_SCPI = (
    r"\*IDN\?|\*CLS|\*OPC\?|SYST:ERR\?|OUTP[12]\?|OUTP1 (?:ON|OFF)"
    r"|SOUR[12]:(?:FUNC|FREQ|VOLT|VOLT:OFFS)(?:\?| [A-Z]{2,4}| [-+.\de]{1,16})"
)


def _p(text: str) -> re.Pattern[bytes]:
    return re.compile(text.encode("ascii"))


_HOLD = frozenset({b"?", b"!", b"\x18"})

DIALECTS: dict[str, Dialect] = {
    d.name: d
    for d in (
        Dialect("grbl", 115200, 2, _grbl_dark, _grbl_light, _p(_GRBL), _p("Grbl "), _HOLD,
            holds=True,
        ),
        Dialect(
            "horus", 115200, 4, _horus_dark, _horus_light, _p(_HORUS), _p("Horus "),
            _HOLD | {b"\x18\r\n"}, holds=True,
        ),
        Dialect(
            "fabscan", 115200, 2, _fabscan_dark, _fabscan_light, _p(_FABSCAN_LINE), _p(r"M22\n>"),
            frozenset({b"M20"}),
        ),
        Dialect(
            "sardauscan", 115200, 4, _sardauscan_dark, _sardauscan_light, _p(_SARDAUSCAN),
            _p("SET_LASER|Sardauscan"),
        ),
        # While the laser is lit nothing may stop the mirror.
        Dialect(
            "scpi", 115200, 1, _scpi_dark, _scpi_light, _p(_SCPI), _p(f"{_ON}|{_OFF}"),
            lit_lines=_p(r"[^?]+\?"),
        ),
    )
}  # fmt: skip


class LineFilter:
    """What of the scanner's bytes may go to the board: whole lines that its dialect lists."""

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._rest = b""

    def clear(self) -> None:
        """Forget the beginning of a line."""
        self._rest = b""

    def feed(self, data: bytes, lit: bool = False) -> bytes:
        """The bytes to pass on; the beginning of a line waits for its end.

        Raises ValueError for a line that is not on the list.
        """
        if data in self._dialect.instant:
            return data
        *whole, self._rest = re.split(rb"(?<=[\r\n])", self._rest + data)
        for line in whole:
            self._check(line.rstrip(b"\r\n"), lit)
        if len(self._rest) > _LONGEST_LINE:
            raise ValueError("an endless line")
        return b"".join(whole)

    def _check(self, line: bytes, lit: bool) -> None:
        d = self._dialect
        passes = len(line) <= _LONGEST_LINE and d.lines.fullmatch(line) is not None
        if lit and d.lit_lines is not None:
            passes = passes and d.lit_lines.fullmatch(line) is not None
        if line and not passes:
            raise ValueError(f"not a line of {d.name} that is permitted")


@contextlib.contextmanager
def foreign_as_oserror() -> Iterator[None]:
    """What a port raises that hangs up meanwhile, such as ``termios.error``, is an OSError here."""
    try:
        yield
    except (OSError, ValueError):
        raise
    except Exception as e:
        raise OSError(errno.EIO, f"{type(e).__name__}: {e}") from e


def open_port(path: str, baud: int, dtr: bool, library: str = "") -> Any:
    """Open a serial port for us alone, DTR and RTS both ``dtr``; raises OSError.

    With a ``library`` of PyVISA ``path`` is a VISA resource instead.
    """
    if library:
        from turnscan.devices._visa import VisaPort

        return VisaPort(path, library, baud)
    import serial

    port = serial.Serial(timeout=0.05, write_timeout=0.05, exclusive=True)
    port.port, port.baudrate, port.dtr, port.rts = path, baud, dtr, dtr
    with foreign_as_oserror():
        port.open()
    return port


def send(port: Any, data: bytes) -> None:
    """Write to an open serial port; a full buffer shows as silence, as does a stalled computer."""
    import serial

    with contextlib.suppress(serial.SerialTimeoutException):
        port.write(data)


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
            del heard[:-_MOST_HEARD]
        sure = sure and step.confirm.search(heard) is not None
        said += heard
    return sure, bytes(said[-1024:])

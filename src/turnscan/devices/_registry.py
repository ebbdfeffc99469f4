"""Turntables and lasers by address: ``grbl:/dev/ttyUSB0?steps_per_rev=3200&lasers=left,right``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast
from urllib.parse import parse_qsl, unquote

from turnscan.devices._protocols import Lasers, Turntable
from turnscan.errors import DeviceError, DeviceNotFound, InputError, TurnscanError
from turnscan.remedy import Option, Remedy

TURNTABLES, LASERS = "turnscan.turntables", "turnscan.lasers"
"""The entry-point groups. An entry is a function from the whole address to the device."""

OVERSHOOT_DEG = 1.0
_COMMON = ("steps_per_rev", "lasers", "outputs", "overshoot_deg", "speed_deg", "baud", "dtr")
_DEFAULT_OUTPUTS = {
    "grbl": ("m3:1000", "m8"),
    "horus": ("1", "2", "3", "4"),
    "fabscan": ("right", "left"),
    "sardauscan": ("0", "1", "2", "3"),
}


def open_turntable(address: str) -> Turntable:
    """The turntable at an address. A board's is at the same time its lasers.

    Raises InputError for an address that is none, DeviceError and SafetyError as the device does.
    """
    return cast(Turntable, _open(TURNTABLES, address))


def open_lasers(address: str) -> Lasers:
    """The lasers at an address. Raises as `open_turntable`."""
    return cast(Lasers, _open(LASERS, address))


@dataclass(frozen=True)
class Devices:
    """What a scan needs besides a camera."""

    turntable: Turntable
    lasers: Lasers


@contextmanager
def open_devices(turntable: str, lasers: str | None = None) -> Iterator[Devices]:
    """Both, closed at the end, lasers first; the same address (or none) means the same board.

    Raises as `open_turntable`, and InputError where the turntable's board has no lasers.
    """
    table = open_turntable(turntable)
    opened: list[Any] = [table]
    try:
        if lasers is None or lasers == turntable:
            if not isinstance(table, Lasers):
                raise InputError(f"{turntable}: has no lasers", hint="give an address for them")
            yield Devices(table, table)
            return
        light = open_lasers(lasers)
        opened.insert(0, light)
        yield Devices(table, light)
    finally:
        _close_all(opened)


def acknowledge_alarm(address: str) -> tuple[bool, bool]:
    """End the alarm of a board whose machine a person has inspected.

    Returns whether it was in an alarm, and whether the angle of its table is still known.
    Raises as `open_turntable`, and InputError for a turntable that has no alarms.
    """
    table: Any = open_turntable(address)
    try:
        if not hasattr(table, "look_over"):
            raise InputError(
                f"{address}: has no alarms", hint=Remedy("it needs no ", Option("acknowledge"))
            )
        alarm = bool(table.alarm)
        return alarm, table.look_over()
    finally:
        _close_all([table])


def _close_all(opened: list[Any]) -> None:
    """Every one is closed, whatever the others raise; the first error leaves."""
    errors: list[TurnscanError] = []
    for device in opened:
        try:
            getattr(device, "close", lambda: None)()
        except TurnscanError as e:
            errors.append(e)
    if errors:
        raise errors[0]


def _open(group: str, address: str) -> object:
    scheme, colon, _ = address.partition(":")
    if not colon or not scheme:
        raise InputError(f"{address!r}: not an address", hint="write for example grbl:/dev/ttyUSB0")
    found = _entry(group, scheme)
    if found is None:
        kinds = ", ".join(sorted({e.name for e in _entries(group)}))
        raise InputError(f"{address}: no driver {scheme!r}", hint=f"there is {kinds}")
    try:
        device = found.load()(address)
    except TurnscanError:
        raise
    except Exception as e:  # a driver of others breaks only itself
        raise DeviceError(
            f"{address}: its driver ({found.value}) failed: {type(e).__name__}: {e}",
            hint="update or remove the package it comes from",
        ) from e
    wanted = Turntable if group == TURNTABLES else Lasers
    if not isinstance(device, wanted):
        raise DeviceNotFound(f"{address}: its driver ({found.value}) gives no {wanted.__name__}")
    return device


def _entries(group: str) -> list[EntryPoint]:
    return [*entry_points(group=group)]


def _entry(group: str, scheme: str) -> EntryPoint | None:
    return next((e for e in _entries(group) if e.name == scheme), None)


@dataclass(frozen=True)
class Address:
    """A board's address, taken apart."""

    dialect: str
    port: str
    options: dict[str, str]


def parse_address(address: str) -> Address:
    """``DIALECT:PORT?key=value&…``. Raises InputError naming the key and the value."""
    dialect, _, rest = address.partition(":")
    port, _, query = rest.partition("?")
    if not port:
        raise InputError(f"{address}: no port", hint=f"write {dialect}:/dev/ttyUSB0")
    given = parse_qsl(query, keep_blank_values=True)
    options = dict(given)
    if len(options) != len(given):
        raise InputError(f"{address}: a key is given twice")
    for key in options:
        if key not in _COMMON:
            raise InputError(f"{address}: no key {key!r}", hint=f"there is {', '.join(_COMMON)}")
    return Address(dialect, unquote(port), options)


def board(address: str, **link_options: Any) -> Any:
    """The board at an address of one of our four dialects; ``link_options`` as `GuardedLink` has.

    Raises as `open_turntable`.
    """
    from turnscan.devices._board import Board, Setup
    from turnscan.devices._fabscan import FabScanBoard
    from turnscan.devices._grbl import GrblBoard
    from turnscan.devices._guard_client import GuardedLink
    from turnscan.devices._horus import HorusBoard
    from turnscan.devices._sardauscan import SardauscanBoard
    from turnscan.devices._steps import Steps

    kinds: dict[str, type[Board]] = {
        "grbl": GrblBoard,
        "horus": HorusBoard,
        "fabscan": FabScanBoard,
        "sardauscan": SardauscanBoard,
    }
    a = parse_address(address)
    outputs, names = _outputs(a)
    per_turn = _value(a, "steps_per_rev", Fraction, None)
    overshoot = math.radians(_value(a, "overshoot_deg", float, OVERSHOOT_DEG))
    speed = _value(a, "speed_deg", float, None)
    if not 0.0 <= overshoot <= math.pi or (speed is not None and not 0.0 < speed <= 3600.0):
        raise InputError(f"{address}: overshoot 0 to 180°, speed above 0 to 3600 °/s")
    setup = Setup(
        a.port, names, None if per_turn is None else Steps(per_turn), overshoot,
        None if speed is None else math.radians(speed), a.options,
    )  # fmt: skip
    dtr = {"on": True, "off": False}.get(a.options.get("dtr", "off"))
    if dtr is None:
        raise InputError(f"{address}: dtr={a.options['dtr']}", hint="on or off")
    baud = _value(a, "baud", int, None)
    link = GuardedLink(a.port, a.dialect, outputs, baud=baud, dtr=dtr, **link_options)
    return kinds[a.dialect](setup, link, link_options.get("deadlines"))


def _value(a: Address, key: str, kind: Callable[[str], Any], default: Any) -> Any:
    if key not in a.options:
        return default
    try:
        value = kind(a.options[key])
        if not math.isfinite(value):
            raise ValueError
    except (ValueError, ZeroDivisionError, OverflowError):
        raise InputError(f"{a.dialect}:{a.port}: {key}={a.options[key]} is no number") from None
    return value


def _outputs(a: Address) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The board's outputs and the lasers' names, in one order."""
    there = _DEFAULT_OUTPUTS[a.dialect]
    names = tuple(filter(None, a.options.get("lasers", "").split(",")))
    given = tuple(filter(None, a.options.get("outputs", "").split(",")))
    outputs = tuple(map(_checked(a), given)) or there[: len(names) or _usual(a.dialect)]
    names = names or tuple(f"laser{i + 1}" for i in range(len(outputs)))
    if len(set(names)) != len(names) or len(set(outputs)) != len(outputs):
        raise InputError(f"{a.dialect}:{a.port}: a laser is given twice")
    if len(names) != len(outputs):
        raise InputError(
            f"{a.dialect}:{a.port}: {len(names)} lasers on {len(outputs)} outputs",
            hint=f"outputs there are: {', '.join(there)}",
        )
    return outputs, names


def _usual(dialect: str) -> int:
    return 1 if dialect == "grbl" else 2


def _checked(a: Address) -> Callable[[str], str]:
    def check(output: str) -> str:
        if a.dialect != "grbl":
            if output not in _DEFAULT_OUTPUTS[a.dialect]:
                raise InputError(f"{a.dialect}:{a.port}: no output {output!r}")
            return output
        word, _, power = output.partition(":")
        if word == "m3" and (power or "1000").isascii() and (power or "1000").isdigit():
            if 0 < int(power or 1000) <= 10000:
                return f"m3:{int(power or 1000)}"
            raise InputError(f"{a.port}: power {power}", hint="S of M3, 1 to 10000")
        if output not in ("m7", "m8"):
            raise InputError(f"{a.port}: no output {output!r}", hint="m3:POWER, m7 or m8")
        return output

    return check


def manual(address: str) -> Turntable:
    """``manual:``."""
    from turnscan.devices._manual import ManualTurntable

    if address != "manual:":
        raise InputError(f"{address}: manual: takes nothing more")
    return ManualTurntable()

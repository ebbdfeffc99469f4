"""A camera's address, taken apart: ``SCHEME:NAME?key=value&…``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from urllib.parse import parse_qsl, unquote

from turnscan.errors import DeviceRefused, InputError


def split_address(address: str, keys: Iterable[str]) -> tuple[str, Mapping[str, str]]:
    """The name in ``SCHEME:NAME?key=value&…`` and the values of its keys.

    Raises InputError naming a key that is not one of ``keys`` or is given twice.
    """
    name, _, query = address.partition(":")[2].partition("?")
    allowed = tuple(keys)
    pairs = parse_qsl(query, keep_blank_values=True)
    for key, _ in pairs:
        if key not in allowed:
            there = ", ".join(allowed) or "none"
            raise InputError(f"{address}: no option {key!r}", hint=f"there is {there}")
    options = dict(pairs)
    if len(options) != len(pairs):
        raise InputError(f"{address}: an option is given twice", hint="give every option once")
    return unquote(name), options


def number_of(
    options: Mapping[str, str], key: str, default: float, low: float, high: float
) -> float:
    """The number behind a key. Raises InputError for one that is not from ``low`` to ``high``."""
    try:
        value = float(options[key]) if key in options else default
    except ValueError:
        value = math.nan
    if not low <= value <= high and key in options:
        raise InputError(
            f"{key}={options[key]}: not a number for {key}", hint=f"give {low:g} to {high:g}"
        )
    return value


def whole_of(options: Mapping[str, str], key: str, default: int, low: int, high: int) -> int:
    """The whole number behind a key. Raises InputError as `number_of` does."""
    value = number_of(options, key, default, low, high)
    if value != int(value):
        raise InputError(f"{key}={options[key]}: not a whole number")
    return int(value)


def check_exposure_and_gain(name: str, seconds: float, gain: float) -> None:
    """Raise DeviceRefused for an exposure or a gain that no camera can have."""
    if not 0.0 < seconds < math.inf:
        raise DeviceRefused(f"{name}: exposure {seconds:g} s", hint="give a time above 0 s")
    if not 0.0 < gain < math.inf:
        raise DeviceRefused(f"{name}: gain {gain:g}", hint="give a factor above 0")

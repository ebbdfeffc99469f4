"""JSON from outside, strictly: no NaN, no key twice, no text or nesting beyond the limits."""

from __future__ import annotations

import json
from typing import Any, Final, NoReturn

from turnscan.errors import FormatError, LimitExceeded

JSON_BYTES: Final = 16 << 20
"""Characters of one JSON text."""
JSON_DEPTH: Final = 32
"""Nesting of one JSON text."""
_SHOWN = 40
"""Characters of a text that is no JSON, in a message."""


def strict_json(text: str, where: str) -> Any:
    """Parse JSON without NaN, duplicate keys or deep nesting.

    Raises FormatError naming the place, LimitExceeded for a text that is too long or too deep.
    """
    if len(text) > JSON_BYTES:
        raise LimitExceeded(f"{where}: {len(text)} characters; at most {JSON_BYTES} are accepted")
    try:
        body = json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)
    except json.JSONDecodeError as e:
        raise FormatError(f"{where}: {_shown(text)} is not JSON ({e})") from None
    except (ValueError, RecursionError) as e:
        raise FormatError(f"{where}: {e}") from None
    if _depth(body) > JSON_DEPTH:
        raise LimitExceeded(f"{where}: nested deeper than {JSON_DEPTH} levels")
    return body


def _shown(text: str) -> str:
    return repr(text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"key {key!r} is given twice")
        out[key] = value
    return out


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number that a file can hold")


def _depth(body: Any) -> int:
    deepest, layer = 0, [body]
    while layer and deepest <= JSON_DEPTH:
        deepest += 1
        inner: list[Any] = []
        for item in layer:
            if isinstance(item, dict):
                inner += item.values()
            elif isinstance(item, list):
                # A list of a million numbers costs no second look at each of them.
                inner += [i for i in item if isinstance(i, dict | list)]
        layer = inner
    return deepest

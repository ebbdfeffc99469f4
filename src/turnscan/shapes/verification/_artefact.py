"""Artefacts: bodies whose dimensions somebody measured, and the file that says them."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from turnscan.errors import FormatError
from turnscan.json_text import strict_json

Kind = Literal["sphere", "ball-bar", "plate", "step-block"]
Test = Literal[
    "form", "form95", "size", "distance", "flatness", "thickness", "height", "repeatability"
]

FORMAT, VERSION = "turnscan-artefact", 1
_K = 2.0
"""Coverage factor of the uncertainties in the file."""
_LARGEST = 1e4
"""mm."""
_HINT = "turnscan artefact writes such a file with its comments"
_TESTS: Mapping[Kind, tuple[Test, ...]] = {
    "sphere": ("form", "form95", "size"),
    "ball-bar": ("form", "form95", "size", "distance"),
    "plate": ("flatness", "thickness"),
    "step-block": ("flatness", "height"),
}
_KEYS: Mapping[Kind, tuple[str, ...]] = {
    "sphere": ("diameter",),
    "ball-bar": ("diameters", "distance"),
    "plate": ("thickness",),
    "step-block": ("heights",),
}


@dataclass(frozen=True)
class Length:
    """A dimension that was measured."""

    value: float
    """mm."""
    sigma: float
    """mm, standard uncertainty."""


@dataclass(frozen=True)
class Artefact:
    """What is known of a body that a scanner is verified with."""

    kind: Kind
    name: str
    diameters: tuple[Length, ...] = ()
    """Of its balls: one of a sphere, two of a ball bar."""
    distance: Length | None = None
    """Between the centres of a ball bar."""
    thickness: Length | None = None
    """Of a plate, between its broad faces; None where it is not to be tested."""
    heights: tuple[Length, ...] = ()
    """Of the further levels of a step block above its first one, ascending."""
    form: float = 0.0
    """mm: largest deviation of its balls or faces from their form."""
    measured: str = ""
    """Who measured it, when and with what; empty where its dimensions are only nominal."""
    limits: Mapping[Test, float] = field(default_factory=dict)
    """mm: what the test values may be at most, by test."""
    scatter: float | None = None
    """mm: standard deviation of the test values when it is set up again and again; None: not
    known."""


def artefact_from_text(text: str, where: str) -> Artefact:
    """Read an artefact from TOML, or from JSON where the text begins with ``{``.

    Lengths are mm; what ends in ``_U_mm`` is an expanded uncertainty (k = 2). Raises FormatError
    naming the key and its value, and what was expected.
    """
    if text.lstrip().startswith("{"):
        body = strict_json(text, where)
    else:
        try:
            body = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as e:
            raise FormatError(f"{where}: {e}", hint=_HINT) from None
    return _Reader(body, where).artefact()


@dataclass
class _Reader:
    """Takes the keys of a file one by one, and complains of what is left."""

    body: dict[str, Any]
    where: str

    def artefact(self) -> Artefact:
        if not isinstance(self.body, dict) or self.body.get("format") != FORMAT:
            raise self._wrong(f'not an artefact file, it has no format = "{FORMAT}"')
        version = self.body.get("version")
        if version != VERSION or isinstance(version, bool):
            raise self._wrong(f"version {version!r}, expected {VERSION}")
        given = self.body.get("kind")
        kind: Kind | None = next((k for k in get_args(Kind) if k == given), None)
        if kind is None:
            raise self._wrong(f"kind {given!r}, expected one of {', '.join(get_args(Kind))}")
        self._only(kind)
        dimensions = self._dimensions(kind)
        drift = self._table("drift", ("scatter_mm",))
        return Artefact(
            kind=kind,
            name=self._text("name"),
            measured=self._text("measured"),
            form=self._number("form_mm", self.body.get("form_mm"), zero=True),
            limits=self._limits(kind),
            scatter=None
            if "scatter_mm" not in drift
            else self._number("drift.scatter_mm", drift["scatter_mm"]),
            **dimensions,
        )

    def _only(self, kind: Kind) -> None:
        lengths = [f"{k}_{u}" for k in _KEYS[kind] for u in ("mm", "U_mm")]
        known = ["format", "version", "kind", "name", "measured", "form_mm", "limits_mm", "drift"]
        extra = sorted(set(self.body) - {*known, *lengths})
        if extra:
            raise self._wrong(
                f"{extra[0]!r} has no meaning for a {kind}; its lengths are {', '.join(lengths)}"
            )

    def _dimensions(self, kind: Kind) -> dict[str, Any]:
        if kind == "sphere":
            return {"diameters": self._lengths("diameter", 1)}
        if kind == "ball-bar":
            (distance,) = self._lengths("distance", 1)
            return {"diameters": self._lengths("diameters", 2), "distance": distance}
        if kind == "plate":
            has = "thickness_mm" in self.body
            return {"thickness": self._lengths("thickness", 1)[0] if has else None}
        heights = self._lengths("heights", None)
        if not 1 <= len(heights) <= 10 or np.any(np.diff([0.0, *(h.value for h in heights)]) <= 0):
            raise self._wrong(
                f"heights_mm {[h.value for h in heights]}: expected 1 to 10 above each other"
            )
        return {"heights": heights}

    def _lengths(self, key: str, count: int | None) -> tuple[Length, ...]:
        values = self._list(f"{key}_mm", count)
        spread = self.body.get(f"{key}_U_mm")
        each = spread if isinstance(spread, list) else [spread] * len(values)
        if len(each) != len(values):
            raise self._wrong(f"{key}_U_mm: {len(each)} values for {len(values)} lengths")
        U = [self._number(f"{key}_U_mm", u) for u in each]
        for value, wide in zip(values, U, strict=True):
            if wide >= value:
                raise self._wrong(f"{key}_U_mm = {wide:g} is not below the length, {value:g} mm")
        return tuple(Length(v, u / _K) for v, u in zip(values, U, strict=True))

    def _list(self, key: str, count: int | None) -> list[float]:
        given = self.body.get(key)
        values = given if isinstance(given, list) else [given] * (count or 1)
        if count is not None and len(values) != count:
            raise self._wrong(f"{key}: {len(values)} values, expected {count}")
        return [self._number(key, v) for v in values]

    def _number(self, key: str, value: Any, zero: bool = False) -> float:
        if value is None:
            raise self._wrong(f"{key} is missing")
        ok = isinstance(value, int | float) and not isinstance(value, bool)
        if not ok or not (0 <= value < _LARGEST) or (value == 0 and not zero):
            least = "0 or more" if zero else "above 0"
            raise self._wrong(f"{key} = {value!r}, expected mm {least} and below {_LARGEST:g}")
        return float(value)

    def _text(self, key: str) -> str:
        value = self.body.get(key)
        if not isinstance(value, str):
            raise self._wrong(f"{key} is missing" if value is None else f"{key}: not a text")
        if len(value) > 500 or (key == "name" and not value.strip()):
            raise self._wrong(f"{key}: expected a text of 1 to 500 characters")
        return value

    def _table(self, key: str, known: tuple[str, ...]) -> dict[str, Any]:
        table = self.body.get(key, {})
        if not isinstance(table, dict):
            raise self._wrong(f"{key}: not a table")
        extra = sorted(set(table) - set(known))
        if extra:
            raise self._wrong(f"{key}: no {extra[0]!r}; there is {', '.join(known)}")
        return table

    def _limits(self, kind: Kind) -> dict[Test, float]:
        tests = tests_of(kind)
        table = self._table("limits_mm", tests)
        return {t: self._number(f"limits_mm.{t}", table[t]) for t in tests if t in table}

    def _wrong(self, what: str) -> FormatError:
        return FormatError(f"{self.where}: {what}", hint=_HINT)


def tests_of(kind: Kind) -> tuple[Test, ...]:
    """The tests that an artefact of that kind allows, and the repeatability of each."""
    return (*_TESTS[kind], "repeatability")

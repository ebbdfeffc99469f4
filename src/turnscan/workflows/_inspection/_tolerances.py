"""Tolerances from a table, and the limits of ISO 286-1 and ISO 2768-1 for sizes."""

from __future__ import annotations

import csv
import re
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from turnscan.errors import FormatError, InputError
from turnscan.workflows._files._reading import read_bytes

Verdict = Literal["pass", "fail", "undecided", ""]
_MOST_BYTES = 2**20
_COLUMNS = ["feature", "quantity", "tolerance"]
QUANTITIES = (
    "diameter", "tube diameter", "cone angle", "distance", "axis distance", "axis to plane",
    "angle", "profile",
)  # fmt: skip
_HINT = (
    "rows `feature,quantity,tolerance`, as in `3,diameter,H7`, `1-2,distance,+0.1 -0`, "
    "`*,*,ISO 2768-m` or `*,profile,0.2`"
)
_MM = 1e-3
_DIGITS = 3
"""Of a nominal size in mm that count when its step is looked up: facets of an STL and differences
of coordinates give 30.000000000000004 for 30, which is no larger size."""

_STEPS = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
"""mm: upper ends of the nominal sizes of ISO 286-1."""
_GRADES = {
    1: (0.8, 1, 1, 1.2, 1.5, 1.5, 2, 2.5, 3.5, 4.5, 6, 7, 8),
    2: (1.2, 1.5, 1.5, 2, 2.5, 2.5, 3, 4, 5, 7, 8, 9, 10),
    3: (2, 2.5, 2.5, 3, 4, 4, 5, 6, 8, 10, 12, 13, 15),
    4: (3, 4, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20),
    5: (4, 5, 6, 8, 9, 11, 13, 15, 18, 20, 23, 25, 27),
    6: (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40),
    7: (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63),
    8: (14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97),
    9: (25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155),
    10: (40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250),
    11: (60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400),
    12: (100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630),
    13: (140, 180, 220, 270, 330, 390, 460, 540, 630, 720, 810, 890, 970),
    14: (250, 300, 360, 430, 520, 620, 740, 870, 1000, 1150, 1300, 1400, 1550),
    15: (400, 480, 580, 700, 840, 1000, 1200, 1400, 1600, 1850, 2100, 2300, 2500),
    16: (600, 750, 900, 1100, 1300, 1600, 1900, 2200, 2500, 2900, 3200, 3600, 4000),
    17: (1000, 1200, 1500, 1800, 2100, 2500, 3000, 3500, 4000, 4600, 5200, 5700, 6300),
    18: (1400, 1800, 2200, 2700, 3300, 3900, 4600, 5400, 6300, 7200, 8100, 8900, 9700),
}
"""µm: standard tolerances IT1 to IT18 for those sizes."""
_PLACES = {
    "d": (20, 30, 40, 50, 65, 80, 100, 120, 145, 170, 190, 210, 230),
    "e": (14, 20, 25, 32, 40, 50, 60, 72, 85, 100, 110, 125, 135),
    "f": (6, 10, 13, 16, 20, 25, 30, 36, 43, 50, 56, 62, 68),
    "g": (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20),
    "h": (0,) * 13,
}
"""µm: how far a shaft of that letter begins below its nominal size, and a hole above it."""
_GENERAL_STEPS = (3, 6, 30, 120, 400, 1000, 2000)
_GENERAL: dict[str, tuple[float | None, ...]] = {
    "f": (0.05, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5),
    "m": (0.1, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2),
    "c": (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0),
    "v": (None, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0),
}
"""mm: ISO 2768-1, table 1, for sizes from 0.5 mm."""
_FIT = re.compile(r"(JS|js|[D-Hd-h])(\d{1,2})")
_ISO_2768 = re.compile(r"(?:ISO\s*)?2768\s*-\s*([fmcv])[HKL]?", re.IGNORECASE)
_NUMBER = r"(\d+(?:\.\d*)?|\.\d+)"
_BOTH = re.compile(rf"(?:±|\+/-|\+-)\s*{_NUMBER}")
_TWO = re.compile(rf"([+-]?{_NUMBER})\s*[/ ]\s*([+-]?{_NUMBER})")


@dataclass(frozen=True)
class Tolerance:
    """A row of the table."""

    features: tuple[int, ...]
    """Numbers of the features, from 1; none for every one."""
    quantity: str
    """One of `QUANTITIES`, or ``*`` for every size."""
    text: str
    """As it stands in the table."""

    @property
    def rank(self) -> tuple[bool, bool]:
        """How particular it is: of rows that fit the last of the highest rank counts."""
        return bool(self.features), self.quantity != "*"

    def fits(self, features: Sequence[int], quantity: str) -> bool:
        """Whether it speaks of a quantity of these features; ``*`` speaks of sizes, not profiles.

        ISO 286 and 2768-1 are for lengths: of every size, they pass angles over.
        """
        mine = not self.features or sorted(self.features) == sorted(features)
        if self.quantity != "*":
            return mine and self.quantity == quantity
        length = quantity not in ("angle", "cone angle")
        iso = bool(_FIT.fullmatch(self.text) or _ISO_2768.fullmatch(self.text))
        return mine and quantity != "profile" and (length or not iso)

    def limits(self, nominal: float) -> tuple[float, float]:
        """Lower and upper deviation from a nominal size (mm, or degrees for angles).

        Raises InputError where the standard has none for that size.
        """
        return limits_of(self.text, nominal, self.quantity == "profile")


def limits_of(text: str, nominal: float, zone: bool = False) -> tuple[float, float]:
    """Lower and upper deviation that a tolerance allows from ``nominal``.

    ``±0.1``, ``+0.2 -0.1``, ``0.1`` (the same as ±0.1, or what a ``zone`` is wide at most), ``H7``
    and the like of ISO 286-1 (letters D to H and JS, small for shafts; to 500 mm), ``ISO 2768-m``
    (f, m, c, v of ISO 2768-1). Raises InputError for anything else, and sizes out of the tables.
    """
    if m := re.fullmatch(_NUMBER, text):
        width = float(m[1])
        return -width, width
    if zone:
        raise InputError(f"{text!r} is not the width of a profile", hint="write a number of mm")
    if m := _BOTH.fullmatch(text):
        return -float(m[1]), float(m[1])
    if m := _TWO.fullmatch(text):
        low, high = sorted((float(m[1]), float(m[3])))
        return low, high
    if m := _FIT.fullmatch(text):
        return _iso_286(m[1], int(m[2]), nominal)
    if m := _ISO_2768.fullmatch(text):
        return _iso_2768(m[1].lower(), nominal)
    raise InputError(f"{text!r} is not a tolerance", hint=_HINT)


def _iso_286(letter: str, grade: int, nominal: float) -> tuple[float, float]:
    if grade not in _GRADES:
        raise InputError(f"{letter}{grade}: ISO 286 has grades 1 to 18", hint="choose one of them")
    size = round(nominal, _DIGITS)
    if not 0 < size <= _STEPS[-1]:
        raise InputError(
            f"{letter}{grade} of {nominal:g} mm: ISO 286 limits are known to {_STEPS[-1]} mm",
            hint="write the limits as numbers",
        )
    step = bisect_left(_STEPS, size)
    width = _GRADES[grade][step] * _MM
    if letter.lower() == "js":
        return -width / 2, width / 2
    away = _PLACES[letter.lower()][step] * _MM
    return (away, away + width) if letter.isupper() else (-away - width, 0.0 - away)


def _iso_2768(letter: str, nominal: float) -> tuple[float, float]:
    size = round(nominal, _DIGITS)
    known = 0.5 <= size <= _GENERAL_STEPS[-1]
    off = _GENERAL[letter][bisect_left(_GENERAL_STEPS, size)] if known else None
    if off is None:
        raise InputError(
            f"ISO 2768-{letter} says nothing of {nominal:g} mm", hint="write the limits as numbers"
        )
    return -off, off


def verdict(off: float, sigma: float, limits: tuple[float, float]) -> Verdict:
    """Whether a deviation keeps its limits, by the rule of ISO 14253-1 with k = 2.

    It passes or fails where the expanded uncertainty leaves no doubt, and is undecided between.
    """
    U = 2 * sigma
    low, high = limits
    if low <= off - U and off + U <= high:
        return "pass"
    if off + U < low or off - U > high:
        return "fail"
    return "undecided"


def read_tolerances(path: Path) -> tuple[Tolerance, ...]:
    """The rows of a table of tolerances (CSV).

    Raises InputError where no such file, FormatError naming the line.
    """
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint=_HINT) from None
    out = []
    for number, row in enumerate(_rows(text, path), start=1):
        words = [w.strip() for w in row]
        if not any(words) or words == _COLUMNS or words[0].startswith("#"):
            continue
        where = f"{path}, line {number}"
        if len(words) != len(_COLUMNS):
            raise FormatError(f"{where}: {len(words)} columns, not {len(_COLUMNS)}", hint=_HINT)
        out.append(_row(words[0], words[1], words[2], where))
    if not out:
        raise FormatError(f"{path}: no tolerance in it", hint=_HINT)
    return tuple(out)


def _rows(text: str, path: Path) -> list[list[str]]:
    try:
        return list(csv.reader(text.splitlines()))
    except csv.Error as e:
        raise FormatError(f"{path}: not a table ({e})", hint=_HINT) from None


def _row(feature: str, quantity: str, text: str, where: str) -> Tolerance:
    if feature == "*":
        numbers: tuple[int, ...] = ()
    elif re.fullmatch(r"[1-9]\d{0,3}(-[1-9]\d{0,3})?", feature):
        numbers = tuple(map(int, feature.split("-")))
    else:
        raise FormatError(f"{where}: {feature!r} is not a number, two of them or *", hint=_HINT)
    if quantity not in ("*", *QUANTITIES):
        known = ", ".join(QUANTITIES)
        raise FormatError(f"{where}: {quantity!r} is not one of {known} or *", hint=_HINT)
    made = Tolerance(numbers, quantity, text)
    try:
        made.limits(10.0)
    except InputError as e:
        raise FormatError(f"{where}: {e.message}", hint=e.hint) from None
    return made


def tolerance_of(
    rows: Sequence[Tolerance], features: Sequence[int], quantity: str
) -> Tolerance | None:
    """The row that counts for a quantity of features: the most particular one, of equals the last.

    None where there is none.
    """
    fitting = [(r.rank, k) for k, r in enumerate(rows) if r.fits(features, quantity)]
    return rows[max(fitting)[1]] if fitting else None

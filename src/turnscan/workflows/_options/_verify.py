"""What a user may choose about a verification."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


def _limit(text: str) -> tuple[str, float]:
    """``size=0.05``: a test, and its limit in mm. Raises ValueError."""
    name, equals, value = text.partition("=")
    try:
        limit = float(value)
    except ValueError:
        limit = math.nan
    if not math.isfinite(limit):
        what = "no number" if equals else "no = in it"
        raise ValueError(f"{text!r}: {what}; write size=0.05, in mm")
    return name.strip(), limit


@dataclass(frozen=True)
class VerifyOptions(Checked):
    """Which values a scanner must keep."""

    limits: tuple[str, ...] = option(
        (), "text",
        "Limit of a test value, such as size=0.05; may be repeated.  [default: the artefact's]",
        many=True, parse=_limit,
    )  # fmt: skip

    @property
    def by_test(self) -> dict[str, float]:
        """mm by the name of the test."""
        return dict(map(_limit, self.limits))

"""Numbers on the command line: a length, an angle or a time is finite, or it is refused."""

from __future__ import annotations

import math
from typing import Any

import click


class Finite(click.FloatRange):
    """A finite number within limits; NaN and infinity pass every comparison made later."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number, or refuse it naming the option."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number

    def _describe_range(self) -> str:
        """Limits for the help; none where there are none."""
        return "" if self.min is None and self.max is None else super()._describe_range()

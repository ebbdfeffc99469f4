"""The option that spaces profiles, for the verbs that reconstruct."""

from __future__ import annotations

import math

import click

from turnscan.points import Between


class BetweenType(click.ParamType[Between]):
    """``2deg`` is a table angle, ``1.5mm`` a length along the part's outermost circle."""

    name = "SPACING"

    def convert(
        self, value: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> Between:
        """Return the spacing, or refuse it naming the option."""
        text = value.strip().lower()
        unit = "deg" if text.endswith("deg") else "mm" if text.endswith("mm") else ""
        try:
            size = float(text.removesuffix(unit)) if unit else math.nan
        except ValueError:
            size = math.nan
        if not (size > 0 and math.isfinite(size)):
            self.fail(f"{value!r}: give an angle like 2deg or a length like 1.5mm.", param, ctx)
        return Between(math.radians(size), "rad") if unit == "deg" else Between(size, "mm")

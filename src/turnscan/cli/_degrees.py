"""Angles on the command line: decimals or fractions, exact."""

from __future__ import annotations

from fractions import Fraction

import click

_LONGEST_NUMBER = 40


class Degrees(click.ParamType[Fraction]):
    """Decimal or fraction, exact."""

    name = "degrees"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Fraction:
        """Return the number, or refuse it naming the option."""
        if isinstance(value, Fraction):
            return value
        try:
            text = str(value)
            if len(text) > _LONGEST_NUMBER or "e" in text.lower():
                raise ValueError
            return Fraction(text)
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is not a number of degrees, as 0.9 or 360/400", param, ctx)


class DegreesRange(click.ParamType[tuple[Fraction, Fraction]]):
    """Two of them with a colon between."""

    name = "range"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Fraction, Fraction]:
        """Return both ends, or refuse them naming the option."""
        if isinstance(value, tuple):
            return value
        a, colon, b = str(value).partition(":")
        if not colon:
            self.fail(f"{value!r} is not a range, as 0:180", param, ctx)
        one = Degrees()
        return one.convert(a, param, ctx), one.convert(b, param, ctx)

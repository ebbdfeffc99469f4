"""Angles that a person gives as text: decimals or fractions, exact."""

from __future__ import annotations

from fractions import Fraction

_LONGEST_NUMBER = 40


def exact_degrees(text: str) -> Fraction:
    """Degrees as ``0.9`` or ``360/400``. Raises ValueError."""
    try:
        if len(text) > _LONGEST_NUMBER or "e" in text.lower():
            raise ValueError
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        raise ValueError(f"{text!r} is not a number of degrees, as 0.9 or 360/400") from None


def degrees_range(text: str) -> tuple[Fraction, Fraction]:
    """Two angles with a colon between, as ``0:180``. Raises ValueError."""
    first, colon, last = text.partition(":")
    if not colon:
        raise ValueError(f"{text!r} is not a range, as 0:180")
    return exact_degrees(first), exact_degrees(last)

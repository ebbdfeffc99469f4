"""Where the table stands, in whole microsteps; degrees are exact fractions of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from turnscan.errors import InputError

MOST_TURNS = 10_000


@dataclass(frozen=True)
class Steps:
    """The ratio of a table: so many units (microsteps) make one turn.

    Every angle is rounded once, from zero, so nothing adds up over any number of moves.
    """

    per_turn: Fraction

    def __post_init__(self) -> None:
        if not 1 <= self.per_turn <= 10**9:
            raise InputError(f"{float(self.per_turn):g} steps per turn, expected 1 to 1e9")

    def unit_of(self, angle: float) -> int:
        """The unit nearest to an angle in rad. Raises InputError where there is none."""
        if not math.isfinite(angle) or abs(angle) > MOST_TURNS * 2 * math.pi:
            raise InputError(f"angle {angle} rad", hint=f"give at most ±{MOST_TURNS} turns")
        return round(Fraction(angle / (2 * math.pi)) * self.per_turn)

    def angle_of(self, unit: int) -> float:
        """rad."""
        return 2 * math.pi * float(Fraction(unit) / self.per_turn)

    def degrees_of(self, unit: int) -> Fraction:
        """Exact degrees."""
        return Fraction(unit) * 360 / self.per_turn


def decimal(value: Fraction, digits: int) -> str:
    """A fraction as a decimal, rounded once; never in scientific notation."""
    scaled = round(value * 10**digits)
    sign, scaled = ("-" if scaled < 0 else ""), abs(scaled)
    whole, rest = divmod(scaled, 10**digits)
    return f"{sign}{whole}.{rest:0{digits}d}" if digits else f"{sign}{whole}"


def travel_time(distance: float, speed: float, acceleration: float) -> float:
    """s for a move from rest to rest; distance, speed and acceleration in any one unit."""
    distance = abs(distance)
    if distance * acceleration <= speed * speed:
        return 2 * math.sqrt(distance / acceleration)
    return distance / speed + speed / acceleration

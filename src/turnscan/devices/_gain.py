"""Gain as a factor, whatever unit a GenICam camera counts it in."""

from __future__ import annotations

import math

from turnscan.errors import DeviceRefused


def gain_to_node(name: str, gain: float, unit: str, lowest: float) -> float:
    """The value of a camera's gain node for a gain factor.

    ``unit`` is what the node says: ``dB``, or nothing. Without a unit only the factor 1, the
    lowest value, has a meaning; others raise DeviceRefused.
    """
    if unit.strip().lower() == "db":
        return 20.0 * math.log10(gain)
    if gain != 1.0:
        raise DeviceRefused(
            f"{name}: gain {gain:g}; this camera's gain has no unit, so no factor can be set",
            hint="take gain 1 and set the exposure time",
        )
    return lowest


def gain_of_node(value: float, unit: str, lowest: float) -> float:
    """The gain factor of a node's value; NaN where it cannot be known."""
    if unit.strip().lower() == "db":
        return math.pow(10.0, value / 20.0)
    return 1.0 if value == lowest else math.nan

"""Measurements of an open scan: entries of its history, and what they came to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from turnscan import edit
from turnscan.errors import InputError

What = Literal["distance", "to_plane", "diameter", "angle", "area", "volume"]
Place = tuple[float, float, float]
Unit = Literal["mm", "mm²", "mm³", "°"]
_WHATS: dict[str, What] = {
    "measure_distance": "distance",
    "measure_to_plane": "to_plane",
    "measure_diameter": "diameter",
    "measure_section": "diameter",
    "measure_angle": "angle",
    "measure_corner": "angle",
    "measure_area": "area",
    "measure_volume": "volume",
}
_PLACES: dict[What, int] = {"distance": 2, "to_plane": 1, "angle": 3}
_UNITS: dict[str, Unit] = {"mm": "mm", "mm²": "mm²", "mm³": "mm³", "rad": "°"}


@dataclass(frozen=True)
class KeptMeasure:
    """A measurement that counts, angles in degrees."""

    edit: int
    """Number of the edit that it is."""
    what: What
    value: float
    unit: Unit
    uncertainty: float | None
    """k = 2; None where it is not known."""
    places: tuple[Place, ...]
    """mm."""
    text: str


def measure_of(what: What, places: Sequence[Place], region: edit.Region | None) -> edit.Edit:
    """The entry of the history for a measurement.

    Raises InputError where points or a region are wanted that are not there.
    """
    wanted = _PLACES.get(what, 0)
    if len(places) < wanted:
        raise InputError(
            f"{what}: {len(places)} of {wanted} points", hint="click the remaining points"
        )
    match what:
        case "distance":
            return edit.MeasureDistance(places[0], places[1])
        case "angle":
            return edit.MeasureCorner(places[0], places[1], places[2])
        case "to_plane" if region is not None:
            return edit.MeasureToPlane(places[0], region)
        case "diameter" if region is not None:
            return edit.MeasureDiameter(region)
        case "diameter" if places:
            return edit.MeasureSection((0.0, 0.0, 1.0), places[0][2], places[0])
        case "area":
            return edit.MeasureArea(region)
        case "volume":
            return edit.MeasureVolume()
    raise InputError(f"{what}: no region is selected", hint="select the faces first")


def measures_of(document: edit.Document) -> tuple[KeptMeasure, ...]:
    """What the measurements that count came to."""
    out = []
    for entry, found in document.measured:
        scale = math.degrees(1.0) if found.unit == "rad" else 1.0
        sigma = found.sigma * scale
        out.append(
            KeptMeasure(
                edit=entry.id,
                what=_WHATS[entry.edit.kind],
                value=found.value * scale,
                unit=_UNITS[found.unit],
                uncertainty=2.0 * sigma if math.isfinite(sigma) else None,
                places=tuple((float(x), float(y), float(z)) for x, y, z in found.places),
                text=found.text,
            )
        )
    return tuple(out)

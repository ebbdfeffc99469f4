"""Measurements: what a browser asks for as entries of the history, and what they came to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from turnscan import edit
from turnscan.app import _protocol as p
from turnscan.errors import InputError

What = Literal["distance", "to_plane", "diameter", "angle", "area", "volume"]
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
_UNITS: dict[str, Literal["mm", "mm²", "mm³", "°"]] = {
    "mm": "mm",
    "mm²": "mm²",
    "mm³": "mm³",
    "rad": "°",
}
_PREFIX = "edit-"


def measure_of(what: What, places: Sequence[p.Vector], region: edit.Region | None) -> edit.Edit:
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


def measures(document: edit.Document) -> list[p.Measure]:
    """What the measurements that count came to, with k = 2 and angles in degrees."""
    out = []
    for entry, found in document.measured:
        scale = math.degrees(1.0) if found.unit == "rad" else 1.0
        sigma = found.sigma * scale
        out.append(
            p.Measure(
                measure=f"{_PREFIX}{entry.id}",
                what=_WHATS[entry.edit.kind],
                value=found.value * scale,
                unit=_UNITS[found.unit],
                uncertainty=2.0 * sigma if math.isfinite(sigma) else None,
                places=[(float(x), float(y), float(z)) for x, y, z in found.places],
                text=found.text,
            )
        )
    return out


def entry_of(measure: str) -> int:
    """The number of the edit that a measurement is. Raises InputError for a name that is none."""
    number = measure.removeprefix(_PREFIX)
    if not (measure.startswith(_PREFIX) and number.isascii() and number.isdigit()):
        raise InputError("no such measurement")
    return int(number)

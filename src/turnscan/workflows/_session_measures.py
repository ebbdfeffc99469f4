"""Measurements of an open scan: entries of its history, and what they came to."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from turnscan import edit
from turnscan.errors import CalibrationError, InputError
from turnscan.shapes import Measured

What = Literal["distance", "to_plane", "diameter", "angle", "area", "volume"]
Verdict = Literal["pass", "fail", "undecided"]
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
    name: str = ""
    nominal: float | None = None
    lower: float | None = None
    """Limits of the deviation from the nominal value."""
    upper: float | None = None
    outdated: bool = False
    """Whether the surface was changed since."""

    @property
    def verdict(self) -> Verdict | None:
        """By ISO 14253-1: inside or outside by more than U (k = 2), else undecided.

        None without limits, and where the value is not of the surface as it is.
        """
        if self.nominal is None or self.lower is None or self.upper is None or self.outdated:
            return None
        off, u = self.value - self.nominal, self.uncertainty
        if u is None:
            return "undecided"
        if self.lower + u <= off <= self.upper - u:
            return "pass"
        return "fail" if off < self.lower - u or off > self.upper + u else "undecided"


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


def measures_of(
    document: edit.Document, retaken: Mapping[int, Measured] | None = None
) -> tuple[KeptMeasure, ...]:
    """What the measurements that count came to; ``retaken`` on the surface as it is, by number."""
    out = []
    said = {
        e.edit.measure: e.edit for e in document.history.enabled if isinstance(e.edit, edit.Specify)
    }
    for entry, then in document.measured:
        again = (retaken or {}).get(entry.id)
        found = again or then
        wanted = said.get(entry.id, edit.Specify(entry.id))
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
                name=wanted.name,
                nominal=wanted.nominal,
                lower=wanted.lower,
                upper=wanted.upper,
                outdated=again is None and document.outdated(entry.id),
            )
        )
    return tuple(out)


def retake(document: edit.Document, check: Callable[[], None]) -> dict[int, Measured]:
    """Measurements of a surface that was changed since, taken again; none that cannot be."""
    again = dict[int, Measured]()
    for entry, _ in document.measured:
        check()
        if document.outdated(entry.id):
            with contextlib.suppress(InputError, CalibrationError):
                again[entry.id] = document.retaken(entry)
    return again

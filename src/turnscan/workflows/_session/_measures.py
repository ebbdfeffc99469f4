"""Measurements of an open scan: entries of its history, and what they came to."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

from turnscan import edit
from turnscan.errors import CalibrationError, InputError
from turnscan.shapes import Measured
from turnscan.workflows._surface._report import ReportTable

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
    noise: float | None
    """Standard uncertainty from the points' noise; of a volume all of it. None where not known."""
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
    shared: float | None = None
    """Standard uncertainty from the calibration; None where it is not known."""
    complete: bool = True
    """Whether it was worked out what the calibration does."""
    doubt: str = ""
    """What speaks against it being of the same part as where it was made."""

    @property
    def uncertainty(self) -> float | None:
        """Expanded (k = 2), of all that is known; None where the noise is not."""
        return None if self.noise is None else 2.0 * math.hypot(self.noise, self.shared or 0.0)

    @property
    def verdict(self) -> Verdict | None:
        """By ISO 14253-1: inside or outside by more than U (k = 2), else undecided;
        and undecided where it may be of another part.

        None without limits, where the value is not of the surface as it is, and until its
        uncertainty is worked out.
        """
        if self.nominal is None or self.lower is None or self.upper is None:
            return None
        if self.outdated or not self.complete:
            return None
        off, u = self.value - self.nominal, self.uncertainty
        if u is None or self.doubt:
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


def named_table(measures: Sequence[KeptMeasure]) -> ReportTable | None:
    """The measurements as a table of a report; None where there are none."""
    if not measures:
        return None
    head = ["dimension", "value ± U (k = 2)", "", "nominal", "limits", "verdict", "how"]
    rows = []
    for m in measures:
        u = m.uncertainty
        limits = "" if m.lower is None or m.upper is None else f"{m.lower:+g} to {m.upper:+g}"
        value = f"{m.value:.4f}" if u is None else f"{m.value:.4f} ± {u:.2g}"
        nominal = "" if m.nominal is None else f"{m.nominal:g}"
        alone = m.what != "volume" and m.shared is None
        said = f"{m.text}; U of the noise alone" if alone else m.text
        if m.outdated:
            said = f"{m.text}; of an earlier surface"
        if m.doubt:
            said += f"; {m.doubt}"
        rows.append([m.name or m.what, value, m.unit, nominal, limits, m.verdict or "", said])
    values = [{**asdict(m), "uncertainty": m.uncertainty, "verdict": m.verdict} for m in measures]
    return ReportTable("Named dimensions", head, rows, "named", values)


@dataclass(frozen=True)
class Renewed:
    """What is known of measurements on the surface as it is, by the numbers of their edits."""

    retaken: Mapping[int, Measured] = field(default_factory=dict)
    """Those whose surface was changed after they were taken."""
    shared: Mapping[int, float | None] = field(default_factory=dict)
    """What the calibration leaves open."""


def measures_of(document: edit.Document, known: Renewed | None = None) -> tuple[KeptMeasure, ...]:
    """What the measurements that count came to, with what is known of them as they are now."""
    out = []
    renewed, doubts = known or Renewed(), document.doubts
    said = {
        e.edit.measure: e.edit for e in document.history.enabled if isinstance(e.edit, edit.Specify)
    }
    for entry, then in document.measured:
        again = renewed.retaken.get(entry.id)
        found = again or then
        wanted = said.get(entry.id, edit.Specify(entry.id))
        scale = math.degrees(1.0) if found.unit == "rad" else 1.0
        sigma = found.sigma * scale
        shared = renewed.shared.get(entry.id)
        out.append(
            KeptMeasure(
                edit=entry.id,
                what=_WHATS[entry.edit.kind],
                value=found.value * scale,
                unit=_UNITS[found.unit],
                noise=sigma if math.isfinite(sigma) else None,
                places=tuple((float(x), float(y), float(z)) for x, y, z in found.places),
                text=found.text,
                name=wanted.name,
                nominal=wanted.nominal,
                lower=wanted.lower,
                upper=wanted.upper,
                outdated=again is None and document.outdated(entry.id),
                shared=None if shared is None else shared * scale,
                complete=entry.id in renewed.shared,
                doubt=doubts.get(entry.id, ""),
            )
        )
    return tuple(out)


def renewed(document: edit.Document, known: Renewed | None, check: Callable[[], None]) -> Renewed:
    """Take measurements again of which the surface was changed since, none that cannot be; and
    work out what the calibration leaves open in each.

    ``known`` is what is known of this surface already.
    """
    before = known or Renewed()
    again, now = dict(before.retaken), []
    for entry, _ in document.measured:
        if entry.id in before.shared:
            continue
        check()
        old = document.outdated(entry.id)
        if old:
            with contextlib.suppress(InputError, CalibrationError):
                again[entry.id] = document.retaken(entry)
        if not old or entry.id in again:
            now.append(entry)
    # Of what cannot be taken any more nothing else is known.
    shared = {e.id: before.shared.get(e.id) for e, _ in document.measured}
    for number, sigma in document.shared_sigmas(now):
        check()
        shared[number] = sigma
    return Renewed(again, shared)

"""The features of a reference one by one: how they were measured, and whether they keep their
tolerances."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.drawings import with_sigma
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.remedy import Option
from turnscan.shapes import Deviation
from turnscan.shapes.primitives import Shape, ShapeSet, ShapeSize
from turnscan.workflows._inspection._tolerances import Tolerance, Verdict, tolerance_of, verdict
from turnscan.workflows._surface._nominal import Nominal

_MOSTLY = 0.5
"""Of a feature's measured points, or of a shape's: how many of them must be common to both."""
_CELL = 30
"""Points whose mean tells the profile at a place."""
_LEAST = 4 * _CELL
"""Points that a feature must have for a profile: one mean over all of it hides what it is like."""
_PLACES = 20_000
"""Places that are looked at, if a tenth of the points is no more."""
_PARALLEL = 3e-4
"""Radians by which features may be drawn askew (an STL is not exact) and have one distance."""
UNKNOWN = "compare.unmeasured"
_OWN: dict[str, tuple[str, ...]] = {
    "diameter": ("cylinder", "sphere", "torus"),
    "tube diameter": ("torus",),
    "cone angle": ("cone",),
    "profile": ("plane", "sphere", "cylinder", "cone", "torus"),
}
"""Sizes that each feature of a kind has by itself."""


@dataclass(frozen=True)
class Agreement:
    """How two surfaces agree within a tolerance."""

    tolerance: float
    """mm."""
    precision: float
    """Share of the measured vertices within the tolerance of the reference."""
    completeness: float
    """Share of the reference's area within the tolerance of the measured surface."""

    @property
    def f_score(self) -> float:
        """Harmonic mean of precision and completeness."""
        both = self.precision + self.completeness
        return 2 * self.precision * self.completeness / both if both > 0 else 0.0


@dataclass(frozen=True)
class Feature:
    """A feature of the reference and what was measured on it."""

    number: int
    """From 1, the largest first."""
    nominal: str
    """In words."""
    points: int
    mean: float
    """mm: of the deviations of its points, positive outside."""
    rms: float
    p95: float
    """mm: what 95 % of its points stay within."""


@dataclass(frozen=True)
class Check:
    """A size of features, or the profile of one, against its nominal value and its tolerance."""

    features: tuple[int, ...]
    """Numbers."""
    quantity: str
    nominal: float
    """mm, or degrees."""
    measured: float
    sigma: float
    """Standard uncertainty."""
    unit: str
    tolerance: str = ""
    """As the table has it; empty where it says nothing."""
    limits: tuple[float, float] | None = None
    """Of the deviation from nominal."""
    verdict: Verdict = ""

    @property
    def off(self) -> float:
        """Measured − nominal."""
        return self.measured - self.nominal

    def __str__(self) -> str:
        who = "-".join(map(str, self.features))
        sign = "°" if self.unit == "deg" else " mm"
        said = f"{who} {self.quantity} {with_sigma(self.measured, self.sigma)}{sign}"
        if self.quantity != "profile":
            said += f", nominal {self.nominal:.4f}{sign}, {self.off:+.4f}"
        return f"{said}: {self.tolerance} {self.verdict}" if self.verdict else said


def features_of(reference: Nominal, label: Ints, every: Deviation) -> tuple[Feature, ...]:
    """The features that have measured points; ``label`` (n,) is the feature of each point."""
    out = []
    for k, shape in enumerate(reference.shapes):
        d = every.distance[label == k]
        if len(d):
            rms, p95 = float(np.sqrt(np.mean(d**2))), float(np.quantile(np.abs(d), 0.95))
            words = nominal_in_words(shape)
            out.append(Feature(k + 1, words, len(d), float(d.mean()), rms, p95))
    return tuple(out)


def nominal_in_words(s: Shape) -> str:
    """What a feature is drawn as."""
    hole = "hollow " if s.hollow else ""
    if s.kind == "plane":
        return f"plane, {s.area:.1f} mm²"
    if s.kind == "cone":
        return f"{hole}cone of {2 * abs(np.rad2deg(s.second)):.3f}°"
    size = f"{hole}{s.kind} ⌀ {2 * s.radius:.4f} mm"
    return f"{size}, tube ⌀ {2 * s.second:.4f} mm" if s.kind == "torus" else size


def matched(reference: Nominal, label: Ints, found: ShapeSet, own: Ints) -> dict[int, int]:
    """Measured shape → feature, where they are of one kind and lie on each other.

    ``label`` and ``own`` (n,) are the feature and the shape of each measured point.
    """
    out: dict[int, int] = {}
    for k, s in enumerate(found.shapes):
        on = label[own == k]
        on = on[on >= 0]
        if not len(on):
            continue
        best = int(np.bincount(on).argmax())
        common = int((on == best).sum())
        feature = reference.shapes[best]
        if feature.kind != s.kind or feature.hollow != s.hollow:
            continue
        if common >= _MOSTLY * int((own == k).sum()) and best not in out.values():
            out[k] = best
    return out


def checks_of(
    reference: Nominal,
    sizes: Sequence[ShapeSize],
    match: dict[int, int],
    tolerances: Sequence[Tolerance],
) -> Iterator[Check]:
    """Each measured size whose features are known, against the nominal one.

    Raises InputError where the table names features and its tolerance is none for their size.
    """
    for s in sizes:
        own = [s.first] if s.second is None else [s.first, s.second]
        if not all(k in match for k in own):
            continue
        numbers = tuple(match[k] + 1 for k in own)
        shapes = [reference.shapes[match[k]] for k in own]
        nominal = _nominal(s.kind, shapes)
        if nominal is None:
            continue
        angle = s.kind in ("angle", "cone angle")
        scale, unit = (180 / np.pi, "deg") if angle else (1.0, "mm")
        made = Check(numbers, s.kind, nominal * scale, s.value * scale, s.sigma * scale, unit)
        yield _judged(made, tolerances)


def _judged(check: Check, tolerances: Sequence[Tolerance]) -> Check:
    row = tolerance_of(tolerances, check.features, check.quantity)
    if row is None:
        return check
    try:
        limits = row.limits(check.nominal)
    except InputError as e:
        if not row.features:
            return check
        who = "-".join(map(str, check.features))
        raise InputError(
            f"{who} {check.quantity}: {e.message}", hint=e.hint, option=Option("tolerance_table")
        ) from None
    said = verdict(check.off, check.sigma, limits)
    return Check(
        check.features, check.quantity, check.nominal, check.measured, check.sigma, check.unit,
        row.text, limits, said,
    )  # fmt: skip


def _nominal(kind: str, shapes: Sequence[Shape]) -> float | None:
    """The size as it is drawn, mm or radians; None for a distance of what is drawn askew, such as
    faces with a draft: it depends on where on them one measures."""
    a = shapes[0]
    match kind:
        case "diameter":
            return 2 * a.radius
        case "tube diameter":
            return 2 * a.second
        case "cone angle":
            return 2 * abs(a.second)
    b = shapes[1]
    away = b.point - a.point
    along = abs(float(a.axis @ b.axis)) if kind == "axis to plane" else _sine(a.axis, b.axis)
    if kind != "angle" and along > _PARALLEL:
        return None
    match kind:
        case "distance":
            return abs(float(away @ a.axis))
        case "axis to plane":
            plane = a if a.kind == "plane" else b
            return abs(float(away @ plane.axis))
        case "axis distance":
            return float(np.linalg.norm(away - (away @ a.axis) * a.axis))
    return float(np.arctan2(_sine(a.axis, b.axis), a.axis @ b.axis))


def _sine(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(np.cross(a, b)))


def profiles_of(
    reference: Nominal, label: Ints, points: Floats, every: Deviation,
    tolerances: Sequence[Tolerance], loose: Collection[int] = (),
) -> Iterator[Check]:  # fmt: skip
    """The profile of each feature that the table asks for: twice its largest deviation, as the
    means over places of some thirty points tell it, so that the noise of one point does not.
    Those that are ``loose``, by index (`adrift`), have none."""
    for k in range(len(reference.shapes)):
        if k in loose or tolerance_of(tolerances, [k + 1], "profile") is None:
            continue
        own = label == k
        if int(own.sum()) >= _LEAST:
            value, sigma = _profile(points[own], every.distance[own])
            yield _judged(Check((k + 1,), "profile", 0.0, value, sigma, "mm"), tolerances)


def _profile(points: Floats, off: Floats) -> tuple[float, float]:
    """Twice the largest mean deviation of a place, mm, and its standard uncertainty.

    The largest of m means of pure noise is about √(2 ln m) of their standard deviations: so much
    may be noise, and two standard uncertainties cover it beside two of those.
    """
    from scipy.spatial import KDTree

    places = points[:: min(10, 1 + len(points) // _PLACES)]
    near = np.asarray(KDTree(points).query(places, k=_CELL)[1])
    mean = off[near].mean(axis=1)
    worst = int(np.argmax(np.abs(mean)))
    spread = float(off[near[worst]].std(ddof=1) / np.sqrt(_CELL))
    chance = float(np.sqrt(2 * np.log(len(points) / _CELL)))
    return 2 * abs(float(mean[worst])), 2 * spread * (1 + chance / 2)


def _out_of_range(row: Tolerance, nominal: float) -> str:
    """Why a row that speaks of a size gives it no limits."""
    try:
        row.limits(nominal)
    except InputError as e:
        return f"no verdict, {e.message}"
    return "no verdict"


def unmet(
    reference: Nominal,
    checks: Sequence[Check],
    tolerances: Sequence[Tolerance],
    loose: Collection[int] = (),
) -> list[Finding]:
    """Rows of the table that nothing answers to, sizes that a row has no limits for, and features
    that have a tolerance and no size; why, of those that are ``loose``, by index (`adrift`)."""
    out = []
    for t in tolerances:
        if not any(t.fits(c.features, c.quantity) for c in checks):
            who = "-".join(map(str, t.features)) or "*"
            text = f"{who}, {t.quantity}, {t.text}: nothing that was measured answers to it"
            out.append(Finding(UNKNOWN, "warning", text))
    for c in checks:
        row = tolerance_of(tolerances, c.features, c.quantity)
        if row is not None and not c.verdict and c.nominal:  # coaxial features have no nominal size
            out.append(Finding(UNKNOWN, "warning", f"{c}: {_out_of_range(row, c.nominal)}"))
    known = {(c.features, c.quantity) for c in checks}
    for quantity, kinds in _OWN.items():
        lost = [
            number
            for number, s in enumerate(reference.shapes, start=1)
            if s.kind in kinds
            and tolerance_of(tolerances, [number], quantity) is not None
            and ((number,), quantity) not in known
            and not (quantity == "profile" and number - 1 in loose)
        ]
        if lost:
            who = ", ".join(map(str, lost))
            text = f"{quantity} of {who}: has a tolerance and could not be measured"
            remedy = "scan these features more densely, or leave them out of the table"
            out.append(Finding(UNKNOWN, "warning", text, remedy=remedy))
    asked = [k + 1 for k in sorted(loose) if tolerance_of(tolerances, [k + 1], "profile")]
    if asked:
        text = f"profile of {', '.join(map(str, asked))}: has a tolerance and no verdict, for it is"
        text += " chance where the alignment left them"
        out.append(Finding(UNKNOWN, "warning", text))
    return out


def overall(checks: Sequence[Check], findings: Sequence[Finding]) -> Verdict:
    """Fail where one tolerance fails, pass where all of them pass; empty where there is none.

    Where one could not be measured nothing is decided but a failure.
    """
    said = {c.verdict for c in checks if c.verdict}
    lost = any(f.code == UNKNOWN for f in findings)
    if not said and not lost:
        return ""
    return "fail" if "fail" in said else "undecided" if "undecided" in said or lost else "pass"


def check_figures(c: Check) -> dict[str, Any]:
    """A check, unrounded, by name."""
    return {
        "features": list(c.features),
        "quantity": c.quantity,
        "nominal": c.nominal,
        "measured": c.measured,
        "sigma": c.sigma,
        "off": c.off,
        "unit": c.unit,
        "tolerance": c.tolerance or None,
        "limits": None if c.limits is None else list(c.limits),
        "verdict": c.verdict or None,
    }

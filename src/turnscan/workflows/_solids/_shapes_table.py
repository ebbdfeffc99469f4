"""The dimension table of a part: sizes, forms and edges in rows, for a person or a spreadsheet."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.drawings import with_sigma
from turnscan.shapes.primitives import Edge, FormError, ShapeSet, ShapeSize
from turnscan.shapes.walls import Walls

_ANGLES = ("angle", "cone angle")
COVERAGE = 2.0
"""Factor from a standard to an expanded uncertainty: 95 % of cases."""


@dataclass(frozen=True)
class Dimension:
    """A row of the table."""

    feature: str
    """What it is a size of, by the numbers of the shapes."""
    quantity: str
    value: float
    sigma: float
    """Standard uncertainty."""
    unit: str
    rests_on: str
    """What was measured for it."""
    shapes: tuple[int, ...] = ()
    """Index of the shapes that it is of, where it is of some."""


def dimensions(
    found: ShapeSet,
    sizes: Sequence[ShapeSize],
    forms: Sequence[FormError],
    edges: Sequence[Edge],
    walls: Walls | None,
) -> list[Dimension]:
    """Sizes first, then walls, fillets and chamfers, then forms and orientations."""
    return [
        *_of_sizes(found, sizes),
        *_of_patterns(found),
        *(_of_walls(walls) if walls else ()),
        *_of_edges(edges),
        *_of_forms(found, forms),
    ]


def _of_patterns(found: ShapeSet) -> Iterator[Dimension]:
    for r in found.relations:
        feature = f"{r.kind} {', '.join(str(k + 1) for k in r.shapes)}"
        points = sum(found.shapes[k].count for k in r.shapes)
        rests = f"{len(r.shapes)} holes with {points} points, {r.off:.2g} mm off the pattern"
        for name, value, sigma in r.sizes:
            yield Dimension(feature, name, value, sigma, "mm", rests, r.shapes)


def _of_walls(w: Walls) -> Iterator[Dimension]:
    rests = f"{w.places} places with a measured far side, {w.share:.0%} of the measured surface"
    at = ", ".join(f"{x:.1f}" for x in w.where)
    least = (
        f"one place of these, at ({at}) mm; noise alone makes the thinnest {w.noise:.2g} mm less"
    )
    for name, value, sigma, said in (
        ("wall thickness, least", w.least, w.least_sigma, least),
        ("wall thickness, median", w.median, w.median_sigma, rests),
    ):
        yield Dimension("the whole part", name, value, sigma, "mm", said)


def _of_sizes(found: ShapeSet, sizes: Sequence[ShapeSize]) -> Iterator[Dimension]:
    for s in sizes:
        own = [s.first] if s.second is None else [s.first, s.second]
        scale, unit = (180 / np.pi, "deg") if s.kind in _ANGLES else (1.0, "mm")
        points = " and ".join(str(found.shapes[k].count) for k in own)
        rests = f"{points} points"
        value, sigma = s.value * scale, s.sigma * scale
        yield Dimension(_named(found, own), s.named(found), value, sigma, unit, rests, tuple(own))


def _of_forms(found: ShapeSet, forms: Sequence[FormError]) -> Iterator[Dimension]:
    for f in forms:
        what = f"axis of {f.side:.3g} mm" if not f.cells else f"{f.cells} cells of {f.side:.2g} mm"
        rests = (
            f"{what}; chance alone gives {f.noise:.2g} mm{'' if f.shown else ', so none is shown'}"
        )
        own = (f.shape,) if f.datum is None else (f.shape, f.datum)
        yield Dimension(_named(found, own), f.kind, f.value, f.sigma, "mm", rests, own)


def _of_edges(edges: Sequence[Edge]) -> Iterator[Dimension]:
    for e in edges:
        if e.form != "sharp":
            what = "fillet radius" if e.form == "fillet" else "chamfer leg"
            feature = f"edge {e.first + 1} to {e.second + 1}"
            rests = f"{e.points} points"
            yield Dimension(feature, what, e.size, e.sigma, "mm", rests, (e.first, e.second))


def _named(found: ShapeSet, own: Sequence[int]) -> str:
    shapes = ((k, found.shapes[k]) for k in own)
    return " to ".join(f"{'hollow ' if s.hollow else ''}{s.kind} {k + 1}" for k, s in shapes)


def finite(value: float) -> float | None:
    """A figure for a file; None where it is not known, for JSON has no NaN."""
    return float(value) if np.isfinite(value) else None


def dimensions_csv(rows: Sequence[Dimension]) -> str:
    """The table as CSV (RFC 4180), unrounded, with standard and expanded (k = 2) uncertainties;
    what is not known is left empty."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(
        ["feature", "quantity", "value", "unit", "standard uncertainty", "expanded uncertainty k=2",
         "rests on"]
    )  # fmt: skip
    for d in rows:
        writer.writerow(
            [d.feature, d.quantity, finite(d.value), d.unit, finite(d.sigma),
             finite(COVERAGE * d.sigma), d.rests_on]
        )  # fmt: skip
    return out.getvalue()


def form_in_words(f: FormError) -> str:
    """A form error in a line."""
    said = "" if f.shown else ": none shown"
    to = "" if f.datum is None else f" to {f.datum + 1}"
    over = f"over cells of {f.side:.2g} mm" if f.cells else f"of an axis of {f.side:.3g} mm"
    return (
        f"{f.shape + 1}{to}: {f.kind} {with_sigma(f.value, f.sigma)} mm {over}, "
        f"chance alone gives {f.noise:.2g} mm{said}"
    )


def walls_in_words(w: Walls) -> str:
    """The thickness of walls in a line."""
    at = ", ".join(f"{x:.1f}" for x in w.where)
    return (
        f"wall thickness: at least {with_sigma(w.least, w.least_sigma)} mm at ({at}) mm, median "
        f"{with_sigma(w.median, w.median_sigma)} mm, where both sides were measured ({w.share:.0%})"
    )

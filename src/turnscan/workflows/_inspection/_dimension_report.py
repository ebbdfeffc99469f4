"""The dimension report of a part: each feature with its picture, sizes, and what they rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.drawings import with_sigma
from turnscan.findings import Finding
from turnscan.mesh import vertex_normals
from turnscan.workflows._inspection._shapes import FoundShapes
from turnscan.workflows._pages import _document as doc
from turnscan.workflows._pages._colours import GREY
from turnscan.workflows._solids._shapes_table import COVERAGE, Dimension, dimensions_csv, finite
from turnscan.workflows._surface._report import ReportTable

_MARKED = ((213, 94, 0), (0, 114, 178))
"""Of the shapes of a feature: vermilion and blue, distinct for every common colour blindness."""
_MOST = 60
"""Features that have a picture; a part with more has them in the table alone."""
_SIZE = (360, 270)
_TILT = (0.15, 1.2)
"""Radians of elevation that features are looked at from."""
_HEAD = ("feature", "quantity", "value ± u", "", "U (k = 2)", "rests on")


def write_dimensions(
    found: FoundShapes,
    whole: Sequence[Dimension],
    figures: Mapping[str, Any],
    findings: Sequence[Finding],
    path: Path,
    named: ReportTable | None = None,
) -> None:
    """Write the report: .html or .pdf with pictures, .json, or the table as .csv.

    ``whole`` are sizes of the part as a whole, ``figures`` what else is known of it, and
    ``named`` dimensions that a person took (not in .csv). Raises ExportError where it cannot be
    written.
    """
    rows = [*whole, *found.dimensions]
    doc.write_report(
        path,
        f"Dimensions of {Path(found.name).name}",
        lambda: _blocks(found, rows, findings, named),
        lambda: dimensions_csv(rows),
        lambda: {
            **figures,
            **({} if named is None else {named.key: named.values}),
            "dimensions": [_figures(d) for d in rows],
        },
        findings,
    )


def dimension_table(rows: Sequence[Dimension]) -> ReportTable:
    """Every size with its uncertainty."""
    return ReportTable(
        "All dimensions", _HEAD, [_row(d) for d in rows], "dimensions", [_figures(d) for d in rows]
    )


def _figures(d: Dimension) -> dict[str, Any]:
    return {
        "feature": d.feature,
        "shapes": [k + 1 for k in d.shapes],
        "quantity": d.quantity,
        "value": finite(d.value),
        "unit": d.unit,
        "standard_uncertainty": finite(d.sigma),
        "expanded_uncertainty": finite(COVERAGE * d.sigma),
        "rests_on": d.rests_on,
    }


def _blocks(
    found: FoundShapes,
    rows: Sequence[Dimension],
    findings: Sequence[Finding],
    named: ReportTable | None,
) -> list[doc.Block]:
    f, every = found.found, dimension_table(rows)
    out: list[doc.Block] = [
        doc.Paragraph(
            f"{len(f.shapes)} shapes lie under {f.coverage:.1%} of the measured surface; the rest "
            "is freeform and has no sizes. u is the standard uncertainty: of the points' noise, of "
            "what neighbours share of it, and of the calibration where a scan was measured; U is "
            "the expanded one, 95 % of cases."
        ),
        doc.Picture(
            found.coloured().show(size=(640, 480)).pixels,
            "The part by shape; grey is freeform or not measured.",
        ),
    ]
    for table in (named, every):
        if table is not None:
            out += [doc.Heading(table.title), doc.Table(table.head, table.rows)]
    features = dict.fromkeys(d.shapes for d in rows if d.shapes)
    if not features:
        return [*out, doc.Heading("Findings"), doc.Findings(findings)]
    out.append(doc.Heading("Features"))
    normals = np.nan_to_num(vertex_normals(found.mesh))
    for number, shapes in enumerate(features):
        own = [d for d in rows if d.shapes == shapes]
        if number < _MOST:
            out.append(doc.Picture(_picture(found, shapes, normals), own[0].feature))
        out.append(doc.Table(_HEAD[1:], [_row(d)[1:] for d in own]))
    return [*out, doc.Heading("Findings"), doc.Findings(findings)]


def _row(d: Dimension) -> list[object]:
    u = f"{COVERAGE * d.sigma:.2g}" if np.isfinite(d.sigma) else "not known"
    return [d.feature, d.quantity, with_sigma(d.value, d.sigma), d.unit, u, d.rests_on]


def _picture(found: FoundShapes, shapes: Sequence[int], normals: Floats) -> Image:
    """The part in grey with the shapes of a feature marked, seen from where they look to."""
    label = found.found.label
    colour = np.full((len(label), 3), GREY, dtype=np.uint8)
    for k, shape in enumerate(shapes):
        colour[label == shape] = _MARKED[k % len(_MARKED)]
    to = normals[np.isin(label, shapes)].sum(axis=0)
    first = normals[label == shapes[0]].sum(axis=0)
    to = to if np.linalg.norm(to) > 0.2 * np.linalg.norm(first) else first  # opposite sides
    flat = float(np.hypot(to[0], to[1]))
    azimuth = float(np.arctan2(to[1], to[0])) + 0.4 if flat > 0 else 0.6
    elevation = float(np.clip(np.arctan2(to[2], max(flat, 1e-12)), *_TILT))
    shown = found.mesh.show(azimuth=azimuth, elevation=elevation, size=_SIZE, colour=colour)
    return shown.pixels

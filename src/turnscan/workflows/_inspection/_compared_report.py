"""The report of a comparison: a page with the map, a table for a spreadsheet, or figures."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any, Protocol

from turnscan.drawings import with_sigma
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.shapes import Deviation
from turnscan.workflows._inspection._compared_features import Agreement, Check, Feature
from turnscan.workflows._inspection._tolerances import Verdict
from turnscan.workflows._pages import _document as doc
from turnscan.workflows._solids._deviation_map import deviation_figure
from turnscan.workflows._solids._shapes_table import COVERAGE
from turnscan.workflows._surface._aligning import Placement
from turnscan.workflows._surface._report import ReportTable


class Compared(Protocol):
    """What a report tells of a comparison."""

    @property
    def mesh(self) -> Mesh: ...
    @property
    def every(self) -> Deviation: ...
    @property
    def deviation(self) -> Deviation: ...
    @property
    def agreements(self) -> tuple[Agreement, ...]: ...
    @property
    def findings(self) -> tuple[Finding, ...]: ...
    @property
    def placement(self) -> Placement: ...
    @property
    def names(self) -> tuple[str, str]: ...
    @property
    def features(self) -> tuple[Feature, ...]: ...
    @property
    def checks(self) -> tuple[Check, ...]: ...
    @property
    def verdict(self) -> Verdict: ...
    def figures(self) -> dict[str, Any]: ...


def write_report(found: Compared, path: Path, limit: float | None) -> None:
    """Write the report as its suffix says. Raises ExportError where that fails."""
    title = " against ".join(Path(name).name for name in found.names)
    doc.write_report(
        path,
        title,
        lambda: _blocks(found, limit),
        lambda: _csv(found),
        found.figures,
        found.findings,
    )


def _csv(found: Compared) -> str:
    """Every size with its nominal value, limits and verdict (RFC 4180), unrounded."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(
        ["features", "quantity", "nominal", "measured", "deviation", "unit", "standard uncertainty",
         f"expanded uncertainty k={COVERAGE:g}", "tolerance", "lower", "upper", "verdict"]
    )  # fmt: skip
    for c in found.checks:
        low, high = c.limits if c.limits is not None else ("", "")
        numbers = (c.nominal, c.measured, c.off)
        writer.writerow(
            ["-".join(map(str, c.features)), c.quantity, *(repr(float(x)) for x in numbers), c.unit,
             repr(float(c.sigma)), repr(float(COVERAGE * c.sigma)), c.tolerance, low, high,
             c.verdict]
        )  # fmt: skip
    return out.getvalue()


def compared_tables(found: Compared) -> list[ReportTable]:
    """How the surfaces agree, the features of the reference, and sizes with their verdicts."""
    figures = found.figures()
    out = [
        ReportTable(
            "Agreement",
            ["tolerance, mm", "precision", "completeness", "F-score"],
            [
                [f"{a.tolerance:g}", f"{a.precision:.2%}", f"{a.completeness:.2%}",
                 f"{a.f_score:.4f}"]
                for a in found.agreements
            ],
            "tolerances",
            figures["tolerances"],
        )
    ]  # fmt: skip
    if not found.features:
        return out
    features = ReportTable(
        "Features of the reference",
        ["", "drawn as", "points", "mean, mm", "rms, mm", "95 % within, mm"],
        [
            [f.number, f.nominal, f.points, f"{f.mean:+.4f}", f"{f.rms:.4f}", f"{f.p95:.4f}"]
            for f in found.features
        ],
        "features",
        figures["features"],
    )
    checks = ReportTable(
        "Sizes and profiles",
        ["feature", "quantity", "nominal", "measured ±", "off", "", "tolerance", "limits",
         "verdict"],
        [_row(c) for c in found.checks],
        "checks",
        figures["checks"],
    )  # fmt: skip
    return [*out, features, checks]


def _blocks(found: Compared, limit: float | None) -> list[doc.Block]:
    d = found.deviation
    measured, reference = (Path(name).name for name in found.names)
    agreement, *of_features = compared_tables(found)
    parts: list[doc.Block] = [
        doc.Paragraph(f"{measured} against {reference}: {found.placement.text}."),
        *([doc.Paragraph(f"Tolerances: {found.verdict}.")] if found.verdict else []),
        doc.Picture(
            deviation_figure(found.mesh, found.every, limit),
            "Deviation of the measured surface from the reference, outside positive.",
        ),
        doc.Table(
            ["vertices", "mean, mm", "rms, mm", "95 % within, mm", "worst, mm"],
            [
                [len(d.distance), f"{d.mean:+.4f}", f"{d.rms:.4f}", f"{d.quantile(0.95):.4f}",
                 f"{d.quantile(1.0):.4f}"]
            ],
        ),
        doc.Table(agreement.head, agreement.rows),
    ]  # fmt: skip
    for table in of_features:
        parts.append(doc.Heading(table.title))
        if table.key == "checks":
            parts.append(
                doc.Paragraph(
                    "± is one standard uncertainty. A tolerance is kept (pass) or not (fail) where "
                    "two standard uncertainties leave no doubt (ISO 14253-1), else it is undecided."
                )
            )
        parts.append(doc.Table(table.head, table.rows))
    return [*parts, doc.Heading("Findings"), doc.Findings(found.findings)]


def _row(c: Check) -> list[object]:
    profile = c.quantity == "profile"
    limits = ""
    if c.limits is not None:
        low, high = c.limits
        limits = f"at most {high:.4g}" if profile else f"{low:+.4g} to {high:+.4g}"
    return [
        "-".join(map(str, c.features)), c.quantity, "" if profile else f"{c.nominal:.4f}",
        with_sigma(c.measured, c.sigma), "" if profile else f"{c.off:+.4f}", c.unit, c.tolerance,
        limits, c.verdict,
    ]  # fmt: skip

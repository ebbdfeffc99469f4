"""The report of a verification: values, verdicts, trend; as lines, as HTML, as a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from turnscan.shapes.verification import TestValue
from turnscan.workflows._calibration._verify import Trend, Verification
from turnscan.workflows._pages import _html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = 2
_ABOUT = (
    "Values as defined in turnscan.shapes.verification, mm; U is the expanded uncertainty (k = 2). "
    "The value alone decides against its limit; “barely” where the limit lies within U. "
    "This is no statement of conformity to a standard."
)
_RULE = (
    "Control charts of all runs with this artefact and this rig: each value with its noise (k = 2)."
    " Alarm (red): a self-starting cumulative sum of the values against the mean of all before "
    "them, allowance 0.5 and limit 5 standard deviations, or one value beyond 4 of them."
)


def verification_lines(v: Verification) -> Iterator[str]:
    """The result for a terminal."""
    for scan in v.scans:
        yield f"{scan.source}: {v.artefact.kind} {v.artefact.name}"
        yield from (f"  {_line(value)}" for value in scan.values)
    yield from (_line(value) for value in v.repeated)
    yield from map(str, v.findings)
    yield "passed" if v.passed else "not passed"


def verification_html(v: Verification) -> str:
    """The report as one HTML page."""
    parts = [
        _html.paragraph(
            f"{'Passed' if v.passed else 'Not passed'}: {v.artefact.kind} {v.artefact.name}, "
            f"{_date(v.time):%Y-%m-%d %H:%M} UTC. "
            + (f"Artefact measured: {v.artefact.measured}." if v.artefact.measured else "")
        ),
        _html.heading("Findings"),
        _html.findings(v.findings),
        _html.heading("Test values"),
        _html.paragraph(_ABOUT),
    ]
    for scan in v.scans:
        parts += [_html.paragraph(scan.source.name), _table(scan.values)]
    if v.repeated:
        parts += [_html.heading("Repeatability"), _table(v.repeated)]
    if v.trends:
        parts += [_html.heading("Trend"), _html.picture(trend_figure(v.trends), _RULE)]
    return _html.page("Verification of a scanner", parts)


def trend_picture(v: Verification) -> bytes:
    """The trend as PNG."""
    return _html.png(trend_figure(v.trends))


def trend_figure(trends: Sequence[Trend]) -> Figure:
    """Each test value over the runs, with its limit, its noise and where the alarm sounds."""
    from matplotlib.figure import Figure

    rows = max(math.ceil(len(trends) / _COLUMNS), 1)
    figure = Figure(figsize=(10, 1.2 + 2.0 * rows), layout="constrained")
    boxes = figure.subplots(rows, _COLUMNS, squeeze=False, sharex=True).ravel()
    for box in boxes[len(trends) :]:
        box.set_axis_off()
    for box, t in zip(boxes, trends, strict=False):
        number = range(1, len(t.values) + 1)
        wide = [2000 * n for n in t.noise]
        box.errorbar(number, [1000 * x for x in t.values], wide, fmt="o-", ms=4, lw=1, capsize=2)
        bad = [(k, 1000 * x) for k, x, a in zip(number, t.values, t.drift.alarm, strict=True) if a]
        if bad:
            box.plot(*zip(*bad, strict=True), "s", color="tab:red", ms=7, label="drift alarm")
        if t.limit is not None:
            low = [-1000 * t.limit] if min(t.values) < 0 else []
            for k, edge in enumerate([1000 * t.limit, *low]):
                label = "limit" if k == 0 else None
                box.axhline(edge, color="tab:orange", lw=1, ls="--", label=label)
        box.axhline(0, color="0.7", lw=0.8)
        box.set_title(t.name, fontsize=10)
        box.tick_params(labelbottom=True)
        box.set_ylabel("µm")
        box.set_xlim(0.5, len(t.values) + 0.5)
        box.xaxis.get_major_locator().set_params(integer=True)
        if bad or t.limit is not None:
            box.legend(fontsize=8)
        first, last = _date(t.times[0]), _date(t.times[-1])
        box.set_xlabel(f"scan, {first:%Y-%m-%d} to {last:%Y-%m-%d}")
    return figure


def _table(values: Sequence[TestValue]) -> str:
    head = ("test", "of", "value", "U", "noise", "calibration", "artefact", "limit", "verdict")
    return _html.table((*head, "points", "left out"), [_row(v) for v in values])


def _row(v: TestValue) -> tuple[object, ...]:
    parts = (v.noise, v.calibration, v.artefact)
    return (
        v.test, v.where, f"{v.value:+.4f}", f"{v.expanded:.4f}", *map(_figure, parts),
        _figure(v.limit), v.verdict, v.points, f"{v.left_out:.0%}",
    )  # fmt: skip


def _figure(x: float | None) -> str:
    return "–" if x is None or math.isnan(x) else f"{x:.4f}"


def _line(v: TestValue) -> str:
    limit = "" if v.limit is None else f", limit {v.limit:g} mm: {v.verdict}"
    return f"{v.name}: {v.value:+.4f} ± {v.expanded:.4f} mm{limit}"


def _date(time: float) -> datetime:
    return datetime.fromtimestamp(time, UTC)

"""The table of a batch: SQLite to ask, CSV to open, HTML to look at."""

from __future__ import annotations

import csv
import html
import io
import sqlite3
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from turnscan.errors import ExportError
from turnscan.workflows._batch._task import THUMBNAIL, Outcome
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._pages._html import heading, page, paragraph

SQLITE, CSV, HTML = "batch.sqlite", "batch.csv", "index.html"
_FIGURES = ("points", "faces", "area_mm2", "volume_mm3", "volume_sigma_mm3")
"""Figures of the surface with a column of their own, where it has them."""
_HEAD = (
    "source", "state", "problem", "folder", "seconds", *_FIGURES, "p95_mm", "rms_mm", "warnings",
)  # fmt: skip


def row_of(outcome: Outcome) -> dict[str, Any]:
    """One row of the table; None where something is not known."""
    figures, deviation = outcome.figures, outcome.comparison
    severe = [f for f in outcome.findings if f["severity"] != "note"]
    return {
        "source": _readable(outcome.source),
        "state": outcome.state,
        "problem": _readable(outcome.problem),
        "folder": _readable(outcome.folder),
        "seconds": outcome.seconds,
        **{name: figures.get(name) for name in _FIGURES},
        "p95_mm": deviation.get("p95_mm"),
        "rms_mm": deviation.get("rms_mm"),
        "warnings": ", ".join(dict.fromkeys(f["code"] for f in severe)),
    }


def _readable(text: str) -> str:
    """A text that can be stored: a file's name may hold bytes that are no letters."""
    return text.encode(errors="replace").decode()


def write_tables(folder: Path, outcomes: Sequence[Outcome]) -> None:
    """Write the three tables of all outcomes. Raises ExportError."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _HEAD, lineterminator="\n")
    writer.writeheader()
    writer.writerows(map(row_of, outcomes))
    write_atomically(folder / CSV, text.getvalue().encode())
    write_atomically(folder / HTML, _page(outcomes).encode())
    try:
        _write_sqlite(folder / SQLITE, outcomes)
    except sqlite3.Error as e:
        raise ExportError(
            f"{folder / SQLITE}: {e}", hint="remove the file if it is damaged, and repeat"
        ) from e


def _write_sqlite(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Every run adds a row for each scan, so that the history of a scan can be asked for."""
    now = time.time()
    columns = ", ".join(_HEAD)
    with closing(sqlite3.connect(path, timeout=30.0)) as db, db:
        db.execute(f"CREATE TABLE IF NOT EXISTS results (run REAL, {columns}, outcome TEXT)")
        marks = ", ".join("?" * (len(_HEAD) + 2))
        db.executemany(
            f"INSERT INTO results VALUES ({marks})",  # noqa: S608 (question marks only)
            ((now, *_cells(outcome), outcome.to_json()) for outcome in outcomes),
        )


def _cells(outcome: Outcome) -> list[object]:
    """A row's values in the order of the columns."""
    row = row_of(outcome)
    return [row[name] for name in _HEAD]


def _page(outcomes: Sequence[Outcome]) -> str:
    states = list[str]()
    rows = list[str]()
    for outcome in outcomes:  # each is unpacked once
        states.append(outcome.state)
        rows.append(_row(outcome, row_of(outcome)))
    said = ", ".join(
        f"{states.count(state)} {word}"
        for state, word in (
            ("done", "done"), ("pass", "passed"), ("fail", "failed"), ("error", "without a result"),
        )
        if state in states
    )  # fmt: skip
    head = ("", "scan", "state", "faces", "volume mm³", "p95 mm", "warnings", "s")
    cells = "\n".join(rows)
    titles = "".join(f"<th>{name}</th>" for name in head)
    table = f"<table>\n<thead><tr>{titles}</tr></thead>\n<tbody>\n{cells}\n</tbody>\n</table>"
    return page("Batch", [paragraph(f"{len(outcomes)} scans: {said}."), heading("Scans"), table])


def _row(outcome: Outcome, row: dict[str, Any]) -> str:
    name = html.escape(row["source"].replace("\\", "/").rsplit("/", 1)[-1])
    folder = _address(outcome.folder)
    picture = f'<img src="{folder}/{THUMBNAIL}" width="160" loading="lazy" alt="{name}">'
    files = " ".join(
        f'<a href="{folder}/{_address(file)}">{html.escape(Path(file).suffix)}</a>'
        for file in outcome.files
        if file != THUMBNAIL
    )
    mark = ' class="error"' if outcome.state in ("fail", "error") else ""
    cells = (
        picture if THUMBNAIL in outcome.files else "",
        f"{name}<br>{files}",
        f"<span{mark}>{outcome.state}</span> {html.escape(row['problem'])}",
        _number(row["faces"], 0),
        _number(row["volume_mm3"], 0),
        _number(row["p95_mm"], 3),
        html.escape(row["warnings"]),
        _number(outcome.seconds, 1),
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _address(name: str) -> str:
    """A name as a part of an address."""
    return quote(name, errors="surrogateescape")


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"

"""A report as blocks, written as one HTML page or as a PDF on A4."""

from __future__ import annotations

import io
import json
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from turnscan.arrays import Image
from turnscan.findings import Finding, record
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._pages import _html as html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT, _MARGIN = 8.27, 11.69, 0.75
"""Inches: A4 upright."""
_LINE = 0.16
"""Inches between lines of text."""
_LETTER = 0.068
"""Inches: mean width of a letter of the text."""
_HEAD = 0.3
_PICTURE = 3.4
"""Inches: height of a picture at the most."""


@dataclass(frozen=True)
class Heading:
    """The heading of what follows."""

    text: str


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows of plain text below the names of their columns."""

    head: Sequence[str]
    rows: Sequence[Sequence[object]]


@dataclass(frozen=True, eq=False)
class Picture:
    """An array (H, W, 3) uint8, or a figure of matplotlib, with its caption."""

    image: Image | Figure
    caption: str


@dataclass(frozen=True)
class Findings:
    """Findings, the worst first."""

    found: Sequence[Finding] = field(default_factory=tuple)


Block: TypeAlias = Heading | Paragraph | Table | Picture | Findings


def as_html(title: str, blocks: Iterable[Block]) -> str:
    """One page that loads nothing."""
    return html.page(title, map(_html, blocks))


def _html(block: Block) -> str:
    match block:
        case Heading(text):
            return html.heading(text)
        case Paragraph(text):
            return html.paragraph(text)
        case Table(head, rows):
            return html.table(head, rows)
        case Picture():
            return html.picture(block.image, block.caption)
        case Findings(found):
            return html.findings(found)


def write_report(
    path: Path,
    title: str,
    blocks: Callable[[], Iterable[Block]],
    table: Callable[[], str],
    body: Callable[[], Mapping[str, object]],
    findings: Iterable[Finding],
) -> None:
    """Write a report as its suffix says: ``table`` as .csv, ``body`` with the findings as .json,
    or ``blocks`` as .pdf or a page. Raises ExportError where that fails."""
    match path.suffix.lower():
        case ".csv":
            data = table().encode()
        case ".json":
            whole = {**body(), "findings": [record(f) for f in findings]}
            data = json.dumps(whole, indent=1, ensure_ascii=False).encode()
        case ".pdf":
            data = as_pdf(title, blocks())
        case _:
            data = as_html(title, blocks()).encode()
    write_atomically(path, data)


def as_pdf(title: str, blocks: Iterable[Block]) -> bytes:
    """Pages of A4; texts stay texts. The same blocks give the same bytes."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    out = io.BytesIO()
    about = {"Title": title, "Creator": "turnscan", "CreationDate": None}
    with rc_context({"pdf.fonttype": 42, "font.family": "DejaVu Sans"}):
        sheets = _Sheets()
        sheets.text(title, 13, bold=True)
        for block in blocks:
            _draw(sheets, block)
        with PdfPages(out, metadata=about) as pdf:
            for page in sheets.pages:
                pdf.savefig(page)
    return out.getvalue()


class _Sheets:
    """Pages that fill from the top."""

    def __init__(self) -> None:
        self.pages: list[Figure] = []
        self.y = 0.0
        """Inches left above the lower margin."""

    def room(self, inches: float) -> None:
        """Begin a page where so much has no room on this one."""
        from matplotlib.figure import Figure

        if self.y < inches:
            self.pages.append(Figure(figsize=(_WIDTH, _HEIGHT)))
            self.y = _HEIGHT - 2 * _MARGIN

    def text(self, words: str, size: float = 8, x: float = 0.0, bold: bool = False) -> None:
        """A line of text, ``x`` inches from the margin."""
        self.room(2 * _LINE)
        self.y -= max(_LINE, size / 50)
        self._put(words, size, x, bold)

    def row(self, cells: Sequence[tuple[float, str]], bold: bool = False) -> None:
        """Texts beside each other, each at its x."""
        self.room(2 * _LINE)
        self.y -= _LINE
        for x, words in cells:
            self._put(words, 7, x, bold)

    def _put(self, words: str, size: float, x: float, bold: bool) -> None:
        weight = "bold" if bold else "normal"
        self.pages[-1].text(
            (_MARGIN + x) / _WIDTH, (_MARGIN + self.y) / _HEIGHT, words, fontsize=size,
            fontweight=weight, parse_math=False,
        )  # fmt: skip

    def picture(self, picture: Picture) -> None:
        """A picture over its caption."""
        pixels = html.pixels(picture.image)
        wide = _WIDTH - 2 * _MARGIN
        high = min(_PICTURE, wide * pixels.shape[0] / pixels.shape[1])
        wide = min(wide, high * pixels.shape[1] / pixels.shape[0])
        self.room(high + 3 * _LINE)
        self.y -= high
        axes = self.pages[-1].add_axes(
            (_MARGIN / _WIDTH, (_MARGIN + self.y) / _HEIGHT, wide / _WIDTH, high / _HEIGHT)
        )
        axes.imshow(pixels)
        axes.set_axis_off()
        for line in _wrapped(picture.caption, 8):
            self.text(line)
        self.y -= _LINE


def _draw(sheets: _Sheets, block: Block) -> None:
    match block:
        case Heading(text):
            sheets.room(6 * _LINE)
            sheets.y -= _HEAD - _LINE
            sheets.text(text, 10, bold=True)
        case Paragraph(text):
            for line in _wrapped(text, 8):
                sheets.text(line)
        case Table(head, rows):
            _table(sheets, head, rows)
        case Picture():
            sheets.picture(block)
        case Findings(found):
            for line in _of_findings(found):
                sheets.text(line)


def _of_findings(found: Sequence[Finding]) -> Iterator[str]:
    if not found:
        yield "No findings."
    order = {"error": 0, "warning": 1, "note": 2}
    for f in sorted(found, key=lambda f: order[f.severity]):
        remedy = f" → {f.remedy}" if f.remedy else ""
        yield from _wrapped(f"{f.severity} {f.code}: {f.message}{remedy}", 8)


def _wrapped(text: str, size: float) -> list[str]:
    return textwrap.wrap(text, int((_WIDTH - 2 * _MARGIN) / (_LETTER * size / 8))) or [""]


def _table(sheets: _Sheets, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Columns as wide as their texts ask for; where that is too much, long texts are wrapped."""
    cells = [[str(c) for c in row] for row in rows]
    letter = _LETTER * 7 / 8
    most = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
    room = int((_WIDTH - 2 * _MARGIN) / letter)
    wide = [min(m, 14) + 2 for m in most]
    spare = max(room - sum(wide), 0)
    for k, m in sorted(enumerate(most), key=lambda o: o[1]):
        more = min(max(m + 2 - wide[k], 0), spare)
        wide[k], spare = wide[k] + more, spare - more
    at = [sum(wide[:k]) * letter for k in range(len(wide))]
    for k, row in enumerate([list(head), *cells]):
        lines = [textwrap.wrap(c, max(w - 2, 4)) or [""] for c, w in zip(row, wide, strict=True)]
        deep = max(map(len, lines))
        sheets.room((deep + 1) * _LINE)
        for n in range(deep):
            some = [(x, words[n]) for x, words in zip(at, lines, strict=True) if n < len(words)]
            sheets.row(some, bold=k == 0)
    sheets.y -= _LINE / 2

"""A section on a sheet of paper: scale, dimensions, scale bar and title, in mm from top left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._dimensions import Label, Marks
from turnscan.drawings._relief import (
    marks_of,
    relief_in_words,
    relief_picture,
    relief_range,
    relief_scale,
)
from turnscan.shapes import Arc, FittedSection, Line, Piece, Spline
from turnscan.shapes.views import Relief

WIDTH, HEIGHT = 297.0, 210.0
"""A4, landscape."""
LETTERS = 2.5
"""mm: height of the letters of the dimensions."""
_MARGIN, _FOOT, _ROOM = 10.0, 24.0, 16.0
_SCALES = (100, 50, 20, 10, 5, 2, 1, 1 / 2, 1 / 5, 1 / 10, 1 / 20, 1 / 50, 1 / 100, 1 / 1000)

Pen = Literal["measured", "fitted", "filled", "dimensions", "frame"]
PENS: dict[Pen, tuple[str, float]] = {
    "measured": ("#9aa4b0", 0.13),
    "fitted": ("#101418", 0.35),
    "filled": ("#d9730d", 0.25),
    "dimensions": ("#1f5fa8", 0.13),
    "frame": ("#101418", 0.25),
}
"""Colour and width in mm."""


@dataclass(frozen=True)
class Stroke:
    """A polyline on the sheet."""

    points: Floats
    """(n, 2) mm."""
    pen: Pen
    closed: bool = False


@dataclass(frozen=True)
class Curve:
    """A fitted piece on the sheet, where y runs down."""

    piece: Piece
    pen: Pen


@dataclass(frozen=True)
class Text:
    """A text whose middle, or whose left end, stands at a place; angle clockwise."""

    at: Floats
    text: str
    height: float
    angle: float = 0.0
    middle: bool = False
    pen: Pen = "frame"


Item: TypeAlias = "Map | Stroke | Curve | Text"


@dataclass(frozen=True)
class Map:
    """A picture on the sheet, between its upper left and its lower right corner."""

    png: bytes
    box: Floats
    """(2, 2) mm."""


@dataclass(frozen=True)
class Sheet:
    """One page."""

    name: str
    items: tuple[Item, ...]
    fills: tuple[Floats, ...]
    """(3, 2) mm each: arrowheads."""


def sheets(sections: Sequence[FittedSection], title: str) -> list[Sheet]:
    """One sheet for each section, in the largest usual scale in which it has room."""
    return [
        _sheet(s, title, f"sheet {k + 1} of {len(sections)}" if len(sections) > 1 else "")
        for k, s in enumerate(sections)
    ]


def _sheet(section: FittedSection, title: str, number: str) -> Sheet:
    box = section.extent
    room = np.array([WIDTH - 2 * _MARGIN, HEIGHT - 2 * _MARGIN - _FOOT]) - 2 * _ROOM
    size = np.maximum(box[1] - box[0], 1e-9)
    scale = next((s for s in _SCALES if (size * s <= room).all()), float((room / size).min()))
    middle = np.array([WIDTH / 2, (HEIGHT - _FOOT) / 2])
    flip = np.array([1.0, -1.0])
    shift = middle - flip * scale * box.mean(axis=0)

    def place(points: Floats) -> Floats:
        return np.asarray(points * flip * scale + shift)

    items: list[Item] = []
    if section.relief is not None:
        items += _map(section.relief, place)
    for chain in section.chains:
        drawn: Pen = "measured" if section.relief is None else "frame"
        pens: tuple[tuple[bool, Pen], ...] = ((False, drawn), (True, "filled"))
        for filled, pen in pens:
            for run in chain.runs(filled):
                items.append(Stroke(place(chain.points[run]), pen))
    for outline in section.fitted:
        for piece in outline.pieces:
            pen = "filled" if isinstance(piece, Line) and piece.link else "fitted"
            items.append(Curve(_placed(piece, scale, shift), pen))
    marks = marks_of(section, LETTERS / scale)
    items += [Stroke(place(s), "dimensions") for s in marks.strokes]
    items += [_label(t, place(t.at)) for t in marks.labels]
    items += _foot(section, title, number, scale, marks)
    return Sheet(section.cut.name, tuple(items), tuple(place(a) for a in marks.arrows))


def _map(relief: Relief, place: Callable[[Floats], Floats]) -> list[Item]:
    """The map of the radius, and what its colours mean."""
    (x0, y0), (x1, y1) = relief.box
    low, high = relief_range(relief)
    top = HEIGHT - _MARGIN - _FOOT + 4
    bar = np.array([[WIDTH / 2 - 30, top - 5.0], [WIDTH / 2 + 30, top - 2.0]])
    return [
        Map(relief_picture(relief), place(np.array([[x0, y1], [x1, y0]]))),
        Map(relief_scale(relief), bar),
        Text(bar[0] + [-32.0, 2.6], f"r = {low:.3f} mm", LETTERS, pen="dimensions"),
        Text(bar[0] + [62.0, 2.6], f"{high:.3f} mm", LETTERS, pen="dimensions"),
    ]


def _label(label: Label, at: Floats) -> Text:
    return Text(at, label.text, LETTERS, -label.angle, True, "dimensions")


def _placed(piece: Piece, scale: float, shift: Floats) -> Piece:
    """A piece in mm of the sheet, where y runs down."""
    flip = np.array([scale, -scale])
    if isinstance(piece, Line):
        return replace(piece, start=piece.start * flip + shift, end=piece.end * flip + shift)
    if isinstance(piece, Arc):
        return replace(
            piece, centre=piece.centre * flip + shift, radius=piece.radius * scale,
            begin=-piece.begin, sweep=-piece.sweep,
        )  # fmt: skip
    assert isinstance(piece, Spline)
    return replace(piece, control=piece.control * flip + shift)


def _foot(
    section: FittedSection, title: str, number: str, scale: float, marks: Marks
) -> list[Item]:
    top, left, right = HEIGHT - _MARGIN - _FOOT + 4, _MARGIN, WIDTH - _MARGIN
    frame = np.array([[left, _MARGIN], [right, _MARGIN], [right, HEIGHT - _MARGIN],
                      [left, HEIGHT - _MARGIN]])  # fmt: skip
    ratio = f"{scale:g} : 1" if scale >= 1 else f"1 : {1 / scale:.4g}"
    items: list[Item] = [
        Stroke(frame, "frame", True),
        Stroke(np.array([[left, top], [right, top]]), "frame"),
        Text(np.array([left + 4, top + 7]), f"{title}, {_called(section)}", 4.0),
        Text(np.array([left + 4, top + 12.5]), _words(section), 2.3),
        Text(np.array([left + 4, top + 17]), _left_out(section, marks), 2.3),
        Text(np.array([right - 62, top + 7]), f"scale {ratio}   {number}", 3.0),
    ]
    long = 50.0 / scale
    unit = 10.0 ** np.floor(np.log10(long))
    bar = float(next(k for k in (5, 2, 1) if k * unit <= long) * unit)
    y, x = top + 13.0, right - 62
    ends = x + np.array([0.0, bar * scale])
    items.append(Stroke(np.array([[ends[0], y - 1.5], [ends[0], y], [ends[1], y],
                                  [ends[1], y - 1.5]]), "frame"))  # fmt: skip
    items.append(Text(np.array([x, y + 4]), f"{bar:g} mm", 2.3))
    return items


def _called(section: FittedSection) -> str:
    name = section.cut.name
    return f"section {name}" if section.cut.view == "section" else name


def _words(section: FittedSection) -> str:
    if section.relief is not None:
        return f"seen from outside; {relief_in_words(section.relief)}"
    text = "mm; ± standard uncertainty (k = 1) from the noise of the points"
    if section.cut.view == "silhouette":
        text = "mm; outermost points; ± standard uncertainty (k = 1)"
    if not section.fitted:
        return f"{text}; nothing fitted"
    outline = max(section.fitted, key=lambda o: sum(p.length for p in o.pieces))
    kinds = found(section)
    return f"{text}; tolerance {outline.tolerance:.3g}, noise {outline.noise:.2g}; {kinds}"


def found(section: FittedSection) -> str:
    """How many lines, arcs, circles and splines were fitted, or what a map shows, in words."""
    if section.relief is not None:
        return relief_in_words(section.relief)
    every = counts(section).items()
    return ", ".join(f"{n} {kind if n > 1 else kind[:-1]}" for kind, n in every if n)


def counts(section: FittedSection) -> dict[str, int]:
    """How many lines, arcs, circles and splines were fitted."""
    pieces = [p for o in section.fitted for p in o.pieces]
    arcs = [p for p in pieces if isinstance(p, Arc)]
    return {
        "lines": sum(isinstance(p, Line) and not p.link for p in pieces),
        "arcs": sum(not p.full for p in arcs),
        "circles": sum(p.full for p in arcs),
        "splines": sum(isinstance(p, Spline) for p in pieces),
    }


def _left_out(section: FittedSection, marks: Marks) -> str:
    if marks.dimensions or not marks.notes:
        text = "grey: measured, black: fitted, orange: filled, not measured"
    else:
        text = "lines of equal radius as measured, orange: filled, not measured"
    text = f"{text}; {marks.left_out} more sizes in the JSON report" if marks.left_out else text
    return "; ".join(filter(None, [text, section.unstated]))

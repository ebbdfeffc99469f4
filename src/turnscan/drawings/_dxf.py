"""Sections as DXF: polylines, LINE, ARC, CIRCLE and SPLINE on layers of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._dimensions import Marks, dimensions
from turnscan.formats._dxf_frame import new_document, text_of
from turnscan.formats._options import DxfVersion
from turnscan.formats._text import decimals_for
from turnscan.shapes import Arc, Chain, FittedSection, Line, Piece

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

MEASURED, FITTED, FILLED, DIMENSIONS = (
    f"TURNSCAN_SECTION_{word}_MM" for word in ("MEASURED", "FITTED", "FILLED", "DIMENSIONS")
)
_COLOURS = {MEASURED: 8, FITTED: 7, FILLED: 30, DIMENSIONS: 5}
_CODES = {"⌀": "%%c", "±": "%%p", "°": "%%d"}
_LETTERS = 1.0 / 40
"""Height of the letters as a part of the longest side of the largest section."""
_STEP = 0.1
"""Of the tolerance: how far chords may lie from a spline where the format has none."""


def placements(sections: Sequence[FittedSection]) -> list[Floats]:
    """(2,) mm for each section: where its origin stands in a drawing that holds them all.

    One alone stands where it is; several side by side, their letters between them.
    """
    if len(sections) == 1:
        return [np.zeros(2)]
    gap = 20 * letters(sections)
    at, x = [], 0.0
    for s in sections:
        at.append(np.array([x - s.box[0, 0], 0.0]))
        x += float(s.box[1, 0] - s.box[0, 0]) + gap
    return at


def letters(sections: Sequence[FittedSection]) -> float:
    """mm: height of the letters of a drawing in the scale 1 : 1."""
    return max(float(np.ptp(s.box, axis=0).max()) for s in sections) * _LETTERS


def write_section_dxf(
    sections: Sequence[FittedSection], version: DxfVersion, about: Mapping[str, object]
) -> bytes:
    """Return a DXF file of sections side by side, mm, the same for the same sections.

    Layers: what was measured as polylines; lines, arcs and splines fitted to it; the filled faces,
    and links between pieces that do not meet; dimensions. R12 has no SPLINE: there a spline is a
    polyline. Raises ExportError where a coordinate is beyond what can be written.
    """
    height = letters(sections)
    places = placements(sections)
    margin = 6 * height
    corners = [s.box + at for s, at in zip(sections, places, strict=True)]
    low = np.min([c[0] for c in corners], axis=0) - margin
    high = np.max([c[1] for c in corners], axis=0) + margin
    bounds = np.column_stack([np.stack([low, high]), np.zeros(2)])
    decimals_for(bounds)
    document, notes = new_document(version, _COLOURS, bounds, about)
    body = _Body(document.modelspace(), version)
    for section, at in zip(sections, places, strict=True):
        body.place = at
        for chain in section.chains:
            body.chain(chain)
        for outline in section.fitted:
            for piece in outline.pieces:
                body.piece(piece, outline.tolerance)
        body.marks(dimensions(section, height))
        left = section.box[0] - np.array([0.0, 7.5 * height])
        body.text(section.cut.name, left, height * 1.2, 0.0, middle=False)
    return text_of(document, notes).encode("utf-8" if version != "R12" else "cp1252", "replace")


class _Body:
    """Adds entities, moved by ``place``."""

    def __init__(self, space: Modelspace, version: DxfVersion) -> None:
        self._space = space
        self._modern = version != "R12"
        self.place = np.zeros(2)

    def chain(self, chain: Chain) -> None:
        for filled, layer in ((False, MEASURED), (True, FILLED)):
            for run in chain.runs(filled):
                whole = len(run) > 2 and run[0] == run[-1]
                self.polyline(chain.points[run[:-1] if whole else run], layer, whole)

    def polyline(self, points: Floats, layer: str, closed: bool) -> None:
        rows = [tuple(map(float, p + self.place)) for p in points]
        add = self._space.add_lwpolyline if self._modern else self._space.add_polyline2d
        add(rows, close=closed, dxfattribs={"layer": layer})

    def piece(self, piece: Piece, tolerance: float) -> None:
        layer = {"layer": FITTED}
        if isinstance(piece, Line):
            layer = {"layer": FILLED} if piece.link else layer
            self._space.add_line(self._at(piece.start), self._at(piece.end), dxfattribs=layer)
        elif isinstance(piece, Arc):
            centre = self._at(piece.centre)
            if piece.full:
                self._space.add_circle(centre, piece.radius, dxfattribs=layer)
                return
            first, last = np.rad2deg(np.sort([piece.begin, piece.begin + piece.sweep])) % 360
            radius = piece.radius
            self._space.add_arc(centre, radius, float(first), float(last), dxfattribs=layer)
        elif self._modern:
            spline = self._space.add_spline(degree=3, dxfattribs=layer)
            spline.control_points = [self._at(p) for p in piece.control]
            spline.knots = [float(k) for k in piece.knots]
        else:
            self.polyline(piece.sampled(_STEP * tolerance), FITTED, False)

    def marks(self, marks: Marks) -> None:
        layer = {"layer": DIMENSIONS}
        for stroke in marks.strokes:
            for a, b in pairwise(stroke):
                self._space.add_line(self._at(a), self._at(b), dxfattribs=layer)
        for arrow in marks.arrows:
            self._space.add_solid([self._at(p) for p in arrow], dxfattribs=layer)
        for label in marks.labels:
            self.text(label.text, label.at, marks.height, label.angle, middle=True)

    def text(self, text: str, at: Floats, height: float, angle: float, middle: bool) -> None:
        from ezdxf.enums import TextEntityAlignment as Align

        for letter, code in _CODES.items():
            text = text.replace(letter, code)
        attributes = {"layer": DIMENSIONS, "height": height, "rotation": float(np.rad2deg(angle))}
        made = self._space.add_text(text, dxfattribs=attributes)
        made.set_placement(self._at(at), align=Align.MIDDLE_CENTER if middle else Align.LEFT)

    def _at(self, point: Floats) -> tuple[float, float, float]:
        x, y = point + self.place
        return float(x), float(y), 0.0

"""Sections as DXF: polylines, LINE, ARC, CIRCLE and SPLINE on layers of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._dimensions import Dimension, Marks
from turnscan.drawings._relief import marks_of
from turnscan.formats._dxf_frame import new_document, text_of
from turnscan.formats._options import DxfVersion
from turnscan.formats._text import decimals_for
from turnscan.shapes import Arc, Chain, FittedSection, Line, Piece

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.graphicsfactory import CreatorInterface as GraphicsFactory

MEASURED, FITTED, FILLED, DIMENSIONS = (
    f"TURNSCAN_SECTION_{word}_MM" for word in ("MEASURED", "FITTED", "FILLED", "DIMENSIONS")
)
_COLOURS = {MEASURED: 8, FITTED: 7, FILLED: 30, DIMENSIONS: 5}
_ON_DIMENSIONS = {"layer": DIMENSIONS}
STYLE = "TURNSCAN"
"""Name of the style of the dimensions."""
_TYPES = {"linear": 1, "diameter": 3, "radius": 4}
_OWN_BLOCK, _TEXT_PLACED = 32, 128
"""Group 70 of a DIMENSION: its kind, that its block is its own, that its text stands as placed."""
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
        low, high = s.extent[:, 0]
        at.append(np.array([x - low, 0.0]))
        x += float(high - low) + gap
    return at


def letters(sections: Sequence[FittedSection]) -> float:
    """mm: height of the letters of a drawing in the scale 1 : 1."""
    return max(float(np.ptp(s.box, axis=0).max()) for s in sections) * _LETTERS


def write_section_dxf(
    sections: Sequence[FittedSection], version: DxfVersion, about: Mapping[str, object]
) -> bytes:
    """Return a DXF file of sections side by side, mm, the same for the same sections.

    Layers: what was measured as polylines; lines, arcs and splines fitted to it; the filled faces,
    and links between pieces that do not meet; dimensions. R2010 has them as DIMENSION entities,
    each with its block; R12 as lines and texts. R12 has no SPLINE: there a spline is a polyline.
    Lines of equal radius of an unrolled surface lie at that height.
    Raises ExportError where a coordinate is beyond what can be written.
    """
    height = letters(sections)
    places = placements(sections)
    margin = 6 * height
    corners = [s.extent + at for s, at in zip(sections, places, strict=True)]
    low = np.min([c[0] for c in corners], axis=0) - margin
    high = np.max([c[1] for c in corners], axis=0) + margin
    bounds = np.column_stack([np.stack([low, high]), np.zeros(2)])
    decimals_for(bounds)
    document, notes = new_document(version, _COLOURS, bounds, about)
    if version != "R12":
        _style(document, height)
    body = _Body(document, version)
    for section, at in zip(sections, places, strict=True):
        body.place = at
        for k, chain in enumerate(section.chains):
            body.chain(chain, 0.0 if section.relief is None else float(section.relief.levels[k]))
        for outline in section.fitted:
            for piece in outline.pieces:
                body.piece(piece, outline.tolerance)
        body.marks(marks_of(section, height))
        left = section.extent[0] - np.array([0.0, 7.5 * height])
        body.text(section.cut.name, left, height * 1.2)
    return text_of(document, notes).encode("utf-8" if version != "R12" else "cp1252", "replace")


class _Body:
    """Adds entities, moved by ``place``."""

    def __init__(self, document: Drawing, version: DxfVersion) -> None:
        self._space = document.modelspace()
        self._blocks = document.blocks
        self._modern = version != "R12"
        self.place = np.zeros(2)

    def chain(self, chain: Chain, level: float) -> None:
        for filled, layer in ((False, MEASURED), (True, FILLED)):
            for run in chain.runs(filled):
                whole = len(run) > 2 and run[0] == run[-1]
                self.polyline(chain.points[run[:-1] if whole else run], layer, whole, level)

    def polyline(self, points: Floats, layer: str, closed: bool, level: float = 0.0) -> None:
        """A polyline at the height ``level`` over the drawing."""
        rows = [tuple(map(float, p + self.place)) for p in points]
        attributes: dict[str, object] = {"layer": layer}
        if self._modern:
            attributes |= {"elevation": level} if level else {}
            self._space.add_lwpolyline(rows, close=closed, dxfattribs=attributes)
            return
        attributes |= {"elevation": (0.0, 0.0, level)} if level else {}
        self._space.add_polyline2d(rows, close=closed, dxfattribs=attributes)

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
        """DIMENSION entities with a block each that draws them; in R12 what they draw, alone."""
        for stroke in marks.loose:
            self._stroke(self._space, stroke)
        for note in marks.notes:
            self._put(self._space, note.text, note.at, marks.height, note.angle, middle=True)
        for one in marks.dimensions:
            if self._modern:
                self._dimension(one, marks.height)
            else:
                self._picture(self._space, one, marks.height)

    def _picture(self, space: GraphicsFactory, one: Dimension, height: float) -> None:
        for stroke in one.strokes:
            self._stroke(space, stroke)
        for arrow in one.arrows:
            space.add_solid([self._at(p) for p in arrow], dxfattribs=_ON_DIMENSIONS)
        label = one.label
        self._put(space, label.text, label.at, height, label.angle, middle=True)

    def _stroke(self, space: GraphicsFactory, stroke: Floats) -> None:
        for a, b in pairwise(stroke):
            space.add_line(self._at(a), self._at(b), dxfattribs=_ON_DIMENSIONS)

    def _dimension(self, one: Dimension, height: float) -> None:
        block = self._blocks.new_anonymous_block("D")
        self._picture(block, one, height)
        first, last = self._at(one.places[0]), self._at(one.places[1])
        attributes: dict[str, object] = {
            **_ON_DIMENSIONS, "geometry": block.name, "dimstyle": STYLE,
            "text": _coded(one.label.text), "text_midpoint": self._at(one.label.at),
            "dimtype": _TYPES[one.kind] | _OWN_BLOCK | _TEXT_PLACED,
            "actual_measurement": one.value,
        }  # fmt: skip
        if one.kind == "linear":
            on = self._at(one.places[2])
            attributes |= {"defpoint": on, "defpoint2": first, "defpoint3": last}
        else:
            attributes |= {"defpoint": first, "defpoint4": last}
        self._space.new_entity("DIMENSION", attributes)

    def text(self, text: str, at: Floats, height: float) -> None:
        """A text that begins at a place."""
        self._put(self._space, text, at, height, 0.0, middle=False)

    def _put(
        self, space: GraphicsFactory, text: str, at: Floats, height: float, angle: float,
        middle: bool,
    ) -> None:  # fmt: skip
        from ezdxf.enums import TextEntityAlignment as Align

        attributes = {**_ON_DIMENSIONS, "height": height, "rotation": float(np.rad2deg(angle))}
        made = space.add_text(_coded(text), dxfattribs=attributes)
        made.set_placement(self._at(at), align=Align.MIDDLE_CENTER if middle else Align.LEFT)

    def _at(self, point: Floats) -> tuple[float, float, float]:
        x, y = point + self.place
        return float(x), float(y), 0.0


def _coded(text: str) -> str:
    """A text as DXF has it: ⌀, ± and ° are codes."""
    for letter, code in _CODES.items():
        text = text.replace(letter, code)
    return text


def _style(document: Drawing, height: float) -> None:
    """The style of the dimensions, for a program that draws them itself."""
    style = document.dimstyles.new(STYLE)
    style.dxf.dimtxt = style.dxf.dimasz = height
    style.dxf.dimexo, style.dxf.dimexe, style.dxf.dimgap = 0.4 * height, 0.5 * height, 0.4 * height
    style.dxf.dimtad, style.dxf.dimdec, style.dxf.dimtxsty = 1, 4, "Standard"

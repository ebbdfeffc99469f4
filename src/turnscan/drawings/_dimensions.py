"""Dimensions of a section: what each measures, its strokes, arrowheads and text, in drawing mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes import Arc, FittedSection, Line, Outline, Size

_MOST_LENGTHS = 16
"""Of outlines with more lines than this the lengths are left to the report."""
_MOST_DISTANCES = 4
_UPRIGHT = 0.05
"""Radians: texts that run up are read from the right, also if they lean back this much."""
_AXIS = 0.9998
"""Cosine from which a distance is along the width or height."""
_SLIM = 0.82
"""Width of a letter per height."""
_CLEAR = 1.4
"""Heights of a letter from a dimension line to the middle of a text that is wider than the line."""


@dataclass(frozen=True)
class Label:
    """A text, its middle at a place."""

    at: Floats
    """(2,) mm."""
    text: str
    """With ⌀, ±, ° as they are."""
    angle: float
    """Radians from the drawing's x; never upside down."""


@dataclass(frozen=True)
class Dimension:
    """One dimension as CAD knows it, and what is drawn for it."""

    kind: Literal["linear", "radius", "diameter"]
    places: Floats
    """Linear: (3, 2) mm, the two places it goes between and one on the dimension line; radius: (2,
    2), the centre and a place on the arc; diameter: (2, 2), opposite places."""
    value: float
    """mm, unrounded."""
    label: Label
    strokes: tuple[Floats, ...]
    """(n, 2) mm each."""
    arrows: tuple[Floats, ...]
    """(3, 2) mm each: vertices of filled triangles, the tip first."""


@dataclass
class Marks:
    """What dimensions draw; ``height`` mm is that of their letters."""

    height: float
    dimensions: list[Dimension] = field(default_factory=list)
    loose: list[Floats] = field(default_factory=list)
    """(n, 2) mm each: strokes that belong to no dimension."""
    notes: list[Label] = field(default_factory=list)
    """Texts that belong to no dimension."""
    left_out: int = 0
    """Sizes for which there was no room."""
    _taken: list[tuple[Floats, float]] = field(default_factory=list)

    @property
    def strokes(self) -> list[Floats]:
        """(n, 2) mm each: all strokes."""
        return [*self.loose, *(s for d in self.dimensions for s in d.strokes)]

    @property
    def arrows(self) -> list[Floats]:
        """(3, 2) mm each: all arrowheads."""
        return [a for d in self.dimensions for a in d.arrows]

    @property
    def labels(self) -> list[Label]:
        """All texts."""
        return [*self.notes, *(d.label for d in self.dimensions)]

    def label(self, at: Floats, text: str, angle: float, must: bool = False) -> Label | None:
        """A text where none stands yet; ``must`` puts it anyway."""
        angle = (angle + np.pi / 2 - _UPRIGHT) % np.pi - np.pi / 2 + _UPRIGHT
        half = len(text) * _SLIM * self.height / 2
        along = np.array([np.cos(angle), np.sin(angle)])
        spots = at + np.linspace(-half, half, max(len(text), 2))[:, None] * along
        for spot, r in self._taken:
            if (np.linalg.norm(spots - spot, axis=1) < r + 0.8 * self.height).any() and not must:
                return None
        self._taken += [(s, 0.7 * self.height) for s in spots]
        return Label(at, text, float(angle))

    def note(self, at: Floats, text: str, angle: float) -> bool:
        """Put a text that belongs to no dimension, where none stands yet."""
        label = self.label(at, text, angle)
        self.notes += [label] if label else []
        return label is not None

    def keep_off(self, points: Floats) -> None:
        """Let no text stand on these points (n, 2)."""
        self._taken += [(p, 0.0) for p in points]

    def arrow(self, tip: Floats, direction: Floats) -> Floats:
        """(3, 2) mm: an arrowhead at ``tip`` that points in a direction (unit)."""
        back = tip - 1.1 * self.height * direction
        side = 0.18 * self.height * np.array([-direction[1], direction[0]])
        return np.stack([tip, back + side, back - side])


def with_sigma(value: float, sigma: float) -> str:
    """A figure in mm or degrees with its standard uncertainty, to that one's second digit."""
    if not (np.isfinite(sigma) and sigma > 0):
        return f"{value:.3f}"
    places = int(np.clip(1 - np.floor(np.log10(sigma)), 0, 4))
    least = max(sigma, 10.0**-places)
    return f"{value:.{places}f} ±{least:.{places}f}"


def dimensions(section: FittedSection, height: float) -> Marks:
    """Width and height, diameters, radii, distances of parallel lines, lengths where there is room.

    ``height`` mm of the letters, in the drawing's own scale.
    """
    marks = Marks(height)
    for chain in section.chains:
        marks.keep_off(_spread(chain.points, 0.8 * height))
    box, sigma = section.box, section.size_sigma
    width, tall = box[1] - box[0]
    low, gap = box[0], 3.2 * height
    only = section.fitted[0].pieces[0] if len(section.fitted) == 1 else None
    if isinstance(only, Arc) and only.full:
        _round(marks, only)
        return marks
    across = np.stack([low, low + [width, 0]])
    if section.cut.half:
        _centre_line(marks, box)
    if section.cut.turned:
        wide = "⌀" + with_sigma(2 * width, 2 * sigma[0])
        _between(marks, across, np.array([0.0, -gap]), wide, _mirrored(across[1]))
    else:
        _between(marks, across, np.array([0.0, -gap]), with_sigma(width, sigma[0]))
    upright = np.stack([low + [0, tall], low])
    _between(marks, upright, np.array([-gap, 0.0]), with_sigma(tall, sigma[1]))
    for outline in sorted(section.fitted, key=lambda o: -sum(p.length for p in o.pieces)):
        _distances(marks, outline, (width, tall))
    for outline in section.fitted:
        for piece in outline.pieces:
            if isinstance(piece, Arc):
                _round(marks, piece)
    if section.cut.turned:
        for outline in section.fitted:
            _diameters(marks, outline)
    for outline in section.fitted:
        _lengths(marks, outline, (width, tall))
    return marks


def _spread(points: Floats, step: float) -> Floats:
    """Points of a polyline no nearer to each other than ``step``, and some on its long ways."""
    a, b = points[:-1], points[1:]
    many = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / step), 1).astype(int)
    rows = [p + (q - p) * np.linspace(0, 1, n, endpoint=False)[:, None]
            for p, q, n in zip(a, b, many, strict=True)]  # fmt: skip
    every = np.concatenate([*rows, points[-1:]])
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(every, axis=0), axis=1))]
    _, first = np.unique((at / step).astype(int), return_index=True)
    return np.asarray(every[first])


def _mirrored(at: Floats) -> Floats:
    """(2, 2) mm: a place of a turned part on the other side of the axis, and itself."""
    return np.stack([at * [-1.0, 1.0], at])


def _between(
    marks: Marks, ends: Floats, away: Floats, text: str, measured: Floats | None = None
) -> None:
    """A dimension line between two ends (2, 2), moved ``away``, with extension lines and a text.

    ``measured`` (2, 2) mm is what it goes between, where only a part of that is drawn.
    """
    h = marks.height
    out = away / np.linalg.norm(away)
    strokes = [np.stack([p + 0.4 * h * out, p + away + 0.5 * h * out]) for p in ends]
    p, q = ends + away
    along = (q - p) / max(float(np.linalg.norm(q - p)), 1e-300)
    inside = float(np.linalg.norm(q - p)) > 3 * h
    if inside:
        strokes.append(np.stack([p, q]))
    else:
        strokes += [np.stack([p - 3 * h * along, p]), np.stack([q, q + 3 * h * along])]
    marks.keep_off(_spread(np.stack([p, q]), marks.height))
    arrows = (
        marks.arrow(p, -along if inside else along), marks.arrow(q, along if inside else -along)
    )  # fmt: skip
    wide = len(text) * _SLIM * h > float(np.linalg.norm(q - p)) - h
    at = (p + q) / 2 + (_CLEAR if wide else 0.9) * h * out  # it would stand on the extension lines
    label = marks.label(at, text, np.arctan2(along[1], along[0]), must=True)
    assert label is not None
    _linear(marks, ends if measured is None else measured, q, label, strokes, arrows)


def _linear(
    marks: Marks, ends: Floats, on: Floats, label: Label, strokes: Sequence[Floats],
    arrows: Sequence[Floats] = (),
) -> None:  # fmt: skip
    """Add a dimension between two ends (2, 2), its line through ``on``."""
    value = float(np.linalg.norm(ends[1] - ends[0]))
    places = np.stack([*ends, on])
    marks.dimensions.append(
        Dimension("linear", places, value, label, tuple(strokes), tuple(arrows))
    )


def _distances(marks: Marks, outline: Outline, overall: tuple[float, float]) -> None:
    drawn = 0
    for size in sorted(outline.sizes, key=lambda s: -s.value):
        if size.kind != "distance" or size.value < 6 * marks.height or drawn >= _MOST_DISTANCES:
            continue
        along = (size.places[1] - size.places[0]) / max(size.value, 1e-300)
        axis = np.abs(along).max() > _AXIS
        if axis and any(abs(size.value - x) < max(4 * size.sigma, 1e-6 * x) for x in overall):
            continue
        if _distance(marks, size, along):
            drawn += 1
        else:
            marks.left_out += 1


def _distance(marks: Marks, size: Size, along: Floats) -> bool:
    a, b = size.places
    side = np.array([-along[1], along[0]])
    for share in (0.32, 0.68, 0.5, 0.2, 0.8):
        at = a + share * (b - a) + 0.9 * marks.height * side
        text = with_sigma(size.value, size.sigma)
        if label := marks.label(at, text, np.arctan2(along[1], along[0])):
            arrows = (marks.arrow(a, -along), marks.arrow(b, along))
            _linear(marks, size.places, b, label, [np.stack([a, b])], arrows)
            return True
    return False


def _round(marks: Marks, arc: Arc) -> None:
    h = marks.height
    text = with_sigma(arc.radius, arc.radius_sigma)
    turns = [0.5, 0.3, 0.7]
    if arc.full:
        text = "⌀" + with_sigma(2 * arc.radius, 2 * arc.radius_sigma)
        turns = [0.125, 0.375, 0.625, 0.875]
    else:
        text = "R" + text
        if arc.length < 0.3 * h:
            marks.left_out += 1
            return
    half = len(text) * _SLIM * h / 2
    for turn in turns:
        angle = arc.begin + turn * arc.sweep if not arc.full else 2 * np.pi * turn
        out = np.array([np.cos(angle), np.sin(angle)])
        on = arc.centre + arc.radius * out
        for way, far in ((1.0, 2.2), (-1.0, 2.2), (1.0, 5.0), (1.0, 8.0)):
            elbow = on + way * far * h * out
            side = 1.0 if way * out[0] >= 0 else -1.0
            at = elbow + np.array([side * (half + 0.8 * h), 0.0])
            if label := marks.label(at, text, 0.0):
                leader = np.stack([on, elbow, elbow + [side * 0.6 * h, 0.0]])
                marks.dimensions.append(_round_dimension(arc, on, label, leader,
                                                         marks.arrow(on, -way * out)))  # fmt: skip
                return
    marks.left_out += 1


def _round_dimension(
    arc: Arc, on: Floats, label: Label, leader: Floats, arrow: Floats
) -> Dimension:
    first, value = (2 * arc.centre - on, 2 * arc.radius) if arc.full else (arc.centre, arc.radius)
    kind: Literal["radius", "diameter"] = "diameter" if arc.full else "radius"
    return Dimension(kind, np.stack([first, on]), value, label, (leader,), (arrow,))


def _centre_line(marks: Marks, box: Floats) -> None:
    """The axis from which a half-plane goes, dash and dot, a little longer than the part."""
    h = marks.height
    y, end = float(box[0, 1]) - 1.5 * h, float(box[1, 1]) + 1.5 * h
    long = True
    while y < end:
        until = min(y + (4.0 if long else 0.4) * h, end)
        marks.loose.append(np.array([[0.0, y], [0.0, until]]))
        y, long = until + 0.6 * h, not long


def _diameters(marks: Marks, outline: Outline) -> None:
    """The diameter of each straight piece along the axis, on a line from it."""
    h = marks.height
    for line in outline.pieces:
        if not isinstance(line, Line) or line.link or line.length < 2 * h:
            continue
        along = (line.end - line.start) / max(line.length, 1e-300)
        if abs(along[1]) < _AXIS:
            continue
        radius = float(line.start[0] + line.end[0]) / 2
        text = "⌀" + with_sigma(2 * radius, 2 * line.sigma)
        half = len(text) * _SLIM * h / 2
        side = -1.0 if radius > 2 * half + 3 * h else 1.0
        for share in (0.5, 0.3, 0.7, 0.15, 0.85):
            on = line.start + share * (line.end - line.start)
            if label := marks.label(on + [side * (half + 3.0 * h), 0.0], text, 0.0):
                leader = np.stack([on, on + [side * 2.6 * h, 0.0]])
                marks.keep_off(_spread(leader, h))
                arrow = marks.arrow(on, np.array([-side, 0.0]))
                _linear(marks, _mirrored(np.array([radius, on[1]])), on, label, [leader], [arrow])
                break
        else:
            marks.left_out += 1


def _lengths(marks: Marks, outline: Outline, overall: tuple[float, float]) -> None:
    lines = [p for p in outline.pieces if isinstance(p, Line) and not p.link]
    for line in lines:
        if not np.isfinite(line.length_sigma):
            continue  # it ends where the measuring did, or runs into a curve
        text = with_sigma(line.length, line.length_sigma)
        known = [s.value for s in outline.sizes if s.kind == "distance"] + list(overall)
        if any(abs(line.length - x) < 1e-4 * x for x in known):
            continue
        roomy = line.length > len(text) * _SLIM * marks.height * 0.9
        along = (line.end - line.start) / max(line.length, 1e-300)
        out = np.array([along[1], -along[0]])
        middle, angle = (line.start + line.end) / 2, np.arctan2(along[1], along[0])
        places = [middle + way * 1.3 * marks.height * out for way in (1.0, -1.0)]
        places = places if roomy and len(lines) <= _MOST_LENGTHS else []
        tries = (label for at in places if (label := marks.label(at, text, angle)))
        if label := next(tries, None):
            _linear(marks, np.stack([line.start, line.end]), line.end, label, [])
        else:
            marks.left_out += 1

"""Sheets to print: targets to scale, and drawings of the artefacts with what is to be measured."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate import Charuco, aruco_dictionary
from turnscan.errors import InputError
from turnscan.shapes.verification import seat_height

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INCH = 25.4
_EDGE = 8.0
"""mm of the paper that a printer cannot reach."""
_RULER = 100.0
_BAND = 16.0
"""mm beside a target, for ruler and text."""
_SCALE = 7.0
"""mm of a dial's rim, for its degrees."""
_APART, _MOST_MARKERS, _FEWEST_MARKERS = 1.8, 12, 4
"""Sides of a marker from one to the next on a dial, and how many of them it has."""


@dataclass(frozen=True)
class Drawing:
    """A sheet of paper, and what is drawn on it in mm from its lower left corner."""

    size: tuple[float, float]
    """mm"""
    draw: Callable[[Axes], None]


def drawn(drawing: Drawing, form: Literal["pdf", "svg", "png"]) -> bytes:
    """The bytes of the sheet, to scale; the same each time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    width, height = drawing.size
    with mpl.rc_context({"svg.hashsalt": "turnscan", "pdf.fonttype": 42}):
        figure = Figure(figsize=(width / _INCH, height / _INCH))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(0, width)
        axes.set_ylim(0, height)
        axes.set_axis_off()
        drawing.draw(axes)
        out = io.BytesIO()
        undated: dict[str, Any] = {
            "pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None},
        }[form]  # fmt: skip
        figure.savefig(out, format=form, dpi=300, metadata=undated)
    return out.getvalue()


def target_sheet(board: Charuco, spec: str, paper: tuple[float, float]) -> Drawing:
    """A ChArUco board to scale, with a ruler along two sides, on paper (mm) upright or lying.

    Raises InputError where it does not fit.
    """
    w, h = board.columns * board.square, board.rows * board.square
    need = (max(w, _RULER) + _BAND + 2 * _EDGE, max(h, _RULER) + _BAND + 2 * _EDGE)
    fits = [p for p in (paper, paper[::-1]) if need[0] <= p[0] and need[1] <= p[1]]
    if not fits:
        raise InputError(
            f"a board of {w:g} × {h:g} mm with its rulers needs {need[0]:.0f} × {need[1]:.0f} mm "
            f"of paper, this has {paper[0]:g} × {paper[1]:g}",
            hint="take smaller squares, fewer of them, or larger paper",
        )
    width, height = fits[0]
    left = (width - need[0]) / 2 + _EDGE + _BAND
    low = (height - need[1]) / 2 + _EDGE + _BAND

    def draw(axes: Axes) -> None:
        for x, y, sx, sy in _black(board):
            _box(axes, left + x, low + y, sx, sy)
        _ruler(axes, left, low - 4.0, (1, 0))
        _ruler(axes, left - 4.0, low, (0, 1))
        axes.text(
            left + _RULER + 4, low - 5.0,
            f"turnscan {spec}\nPrint at 100 %. Both rulers must measure 100.0 mm;\n"
            "where they do not, correct the square: its size × what they measure / 100.",
            fontsize=6, va="top",
        )  # fmt: skip

    return Drawing((width, height), draw)


def _black(board: Charuco) -> list[tuple[float, float, float, float]]:
    """x, y, width, height mm of black rectangles, from the board's lower left corner, y up."""
    import cv2

    dictionary = aruco_dictionary(board.dictionary)
    made = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.square, board.marker, dictionary
    )
    s, top = board.square, board.rows * board.square
    corners = [np.asarray(c)[0, :2] for c in made.getObjPoints()]
    whites = {(int(x // s), int(y // s)) for x, y in corners}
    every = ((i, j) for j in range(board.rows) for i in range(board.columns))
    boxes = [(i * s, top - (j + 1) * s, s, s) for i, j in every if (i, j) not in whites]
    for (x, y), number in zip(corners, np.asarray(made.getIds()).ravel(), strict=True):
        marks = _marker(dictionary, int(number), board.marker)
        boxes += [(x + a, top - y - board.marker + b, w, h) for a, b, w, h in marks]
    return boxes


def _marker(dictionary: Any, number: int, side: float) -> list[tuple[float, float, float, float]]:
    """x, y, width, height mm of a marker's black rectangles, from its lower left corner, y up."""
    import cv2

    cells = int(dictionary.markerSize) + 2
    cell = side / cells
    bits = np.asarray(cv2.aruco.generateImageMarker(dictionary, number, cells))
    return [
        (a * cell, side - (row + 1) * cell, (b - a) * cell, cell)
        for row, line in enumerate(bits)
        for a, b in _runs(line == 0)
    ]


def dial_sheet(
    dictionary: str, side: float, diameter: float | None, paper: tuple[float, float]
) -> Drawing:
    """A disc for the platter: markers near its rim, whose turn pictures show, and degrees to read.

    ``side`` mm is that of the markers of ``dictionary``, ``diameter`` mm that of the disc; None
    takes what the paper (mm) holds. Degrees grow against the clock, as table angles do.

    Raises InputError where the disc does not fit the paper, or too few markers the disc.
    """
    most = min(paper) - 2 * _EDGE
    size = most if diameter is None else diameter
    if size > most:
        raise InputError(
            f"a dial of {size:g} mm needs {size + 2 * _EDGE:g} mm of paper, "
            f"this has {min(paper):g}",
            hint="take a smaller dial, or larger paper",
        )
    known = aruco_dictionary(dictionary)
    out = size / 2 - _SCALE - 0.9 * side  # the middle of a marker, its inner white beside it
    around = int(2 * np.pi * out / (_APART * side)) if out > 0 else 0
    count = min(around, _MOST_MARKERS, len(known.bytesList))
    if count < _FEWEST_MARKERS or out < 1.5 * side:
        raise InputError(
            f"a dial of {size:g} mm has no room for {_FEWEST_MARKERS} markers of {side:g} mm",
            hint="take smaller markers, or a larger dial",
        )
    x, y = paper[0] / 2, paper[1] - _EDGE - size / 2

    def draw(axes: Axes) -> None:
        from matplotlib.patches import Circle, PathPatch
        from matplotlib.path import Path
        from matplotlib.transforms import Affine2D

        for k in range(count):
            at = Affine2D().translate(out - side / 2, -side / 2).rotate(2 * np.pi * k / count)
            cells = [
                Path.unit_rectangle().transformed(Affine2D().scale(w, h).translate(a, b))
                for a, b, w, h in _marker(known, k, side)
            ]
            # One path: no hair lines between cells that lie askew.
            whole = Path.make_compound_path(*cells).transformed(at.translate(x, y))
            axes.add_patch(PathPatch(whole, facecolor="black", edgecolor="none"))
        axes.add_patch(Circle((x, y), size / 2, fill=False, lw=0.3))
        _degrees(axes, (x, y), size / 2)
        for way in ((4.0, 0.0), (0.0, 4.0)):
            _line(axes, np.array([x, y]) - way, np.array([x, y]) + way, lw=0.3)
        axes.text(
            _EDGE + 4, y - size / 2 - 14,
            f"turnscan dial, {count} markers {dictionary}:{side:g}\n"
            "Print at 100 %, cut out, glue it flat onto the platter about the axis. The sizes need "
            "not be right.",
            fontsize=6, va="top",
        )  # fmt: skip
        _ruler(axes, x - _RULER / 2, y - size / 2 - 3.0, (1, 0))

    return Drawing(paper, draw)


def _degrees(axes: Axes, centre: tuple[float, float], radius: float) -> None:
    """Degrees round the rim, inwards from it."""
    for degree in range(360):
        turn = np.radians(degree)
        way = np.array([np.cos(turn), np.sin(turn)])
        size = 3.5 if degree % 10 == 0 else 2.5 if degree % 5 == 0 else 1.5
        _line(axes, centre + radius * way, centre + (radius - size) * way, lw=0.3)
        if degree % 10 == 0:
            a, b = centre + (radius - 5.2) * way
            axes.text(
                a, b, str(degree), fontsize=5, ha="center", va="center", rotation=degree - 90,
                rotation_mode="anchor",
            )  # fmt: skip


def _runs(black: Any) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], black.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _box(axes: Axes, x: float, y: float, width: float, height: float) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(Rectangle((x, y), width, height, facecolor="black", edgecolor="none"))


def _ruler(axes: Axes, x: float, y: float, way: tuple[int, int]) -> None:
    """100 mm from (x, y) to the right or up, its ticks pointing away from the target."""
    along, out = np.array(way, float), -np.array(way[::-1], float)
    start = np.array([x, y])
    _line(axes, start, start + _RULER * along)
    for mm in range(int(_RULER) + 1):
        at = start + mm * along
        size = 4.0 if mm % 10 == 0 else 3.0 if mm % 5 == 0 else 2.0
        _line(axes, at, at + size * out)
        if mm % 10 == 0:
            a, b = at + 6.0 * out
            axes.text(a, b, str(mm), fontsize=6, ha="center", va="center")


def bar_drawing(name: str, diameter: float, distance: float, paper: tuple[float, float]) -> Drawing:
    """The ball bar with the dimensions that are to be measured; scaled down where it is large."""
    r, up = diameter / 2, seat_height(diameter)
    width, height = paper
    tall = distance + r + up
    scale = min(1.0, (height - 130) / tall, (width - 90) / (2 * diameter))
    x, foot = width / 2 - 15, 105.0
    low, high = foot + scale * up, foot + scale * (up + distance)

    def draw(axes: Axes) -> None:
        from matplotlib.patches import Circle

        R = scale * r
        _stand(axes, x, foot, R)
        for side in (-0.3, 0.3):
            away = np.sqrt(R * R - (side * R) ** 2)
            _line(axes, (x + side * R, low + away), (x + side * R, high - away))
        for z in (low, high):
            axes.add_patch(Circle((x, z), R, fill=False, lw=1))
            _line(axes, (x - R - 4, z), (x + R + 4, z), "-.", 0.4)
        _line(axes, (x, foot - 4), (x, high + R + 4), "-.", 0.4)
        _size(axes, (x + R + 12, low), (x + R + 12, high), f"C  distance, {distance:g}")
        _size(axes, (x - R - 12, low - R), (x - R - 12, high + R), f"L = {distance + diameter:g}")
        for letter, which, z in (("A", "lower", low), ("B", "upper", high)):
            at = (x + 0.87 * R, z + 0.5 * R)
            text = f"{letter}  {which} ball, ⌀ {diameter:g}"
            _arrow(axes, at, (x + R + 20, z + R), text)
        _title(axes, height, f"Ball bar {name}", scale)
        _form(
            axes, width,
            [("A", f"diameter of the lower ball, {diameter:g} mm, mean of several directions"),
             ("B", f"diameter of the upper ball, {diameter:g} mm, mean of several directions"),
             ("L", f"length over both balls, {distance + diameter:g} mm"),
             ("C", f"distance of the centres, {distance:g} mm: C = L − (A + B)/2")],
        )  # fmt: skip

    return Drawing(paper, draw)


def block_drawing(name: str, heights: Sequence[float], paper: tuple[float, float]) -> Drawing:
    """The step block seen from above, its dimensions to be measured; scaled where it is large."""
    x = [0.0, *heights]
    width, height = paper
    scale = min(1.5, (width - 80) / (20.0 * len(x)), (height - 190) / (x[-1] + 15.0))
    w, left, base = scale * 20.0, (width - scale * 20.0 * len(x)) / 2, 150.0

    def draw(axes: Axes) -> None:
        outline = [(left, base - 15 * scale)]
        for k, h in enumerate(x):
            outline += [(left + k * w, base + h * scale), (left + (k + 1) * w, base + h * scale)]
        outline += [(left + len(x) * w, base - 15 * scale), outline[0]]
        for a, b in pairwise(outline):
            _line(axes, a, b, lw=1.0)
        _line(axes, (left, base), (left + len(x) * w + 6, base), "-.", 0.4)
        for k, h in enumerate(x):
            middle = left + (k + 0.5) * w
            axes.text(middle, base + h * scale + 2, f"level {k + 1}", fontsize=7, ha="center")
            if k:
                _size(axes, (middle, base), (middle, base + h * scale), f"H{k + 1}  {h:g}")
        axes.text(left, base - 15 * scale - 6, "seen from above; 60 mm tall", fontsize=8)
        _title(axes, height, f"Step block {name}", scale)
        _form(
            axes, width,
            [(f"H{k + 2}", f"height of level {k + 2} above level 1, {h:g} mm, in the middle "
              "of its face") for k, h in enumerate(heights)],
        )  # fmt: skip

    return Drawing(paper, draw)


def _stand(axes: Axes, x: float, foot: float, radius: float) -> None:
    """The table, and the ring on it that the ball sits in, cut open."""
    from matplotlib.patches import Rectangle

    _line(axes, (x - 45, foot), (x + 45, foot), lw=1.5)
    for left in (-1.3, 0.6):
        box = Rectangle((x + left * radius, foot), 0.7 * radius, 0.3 * radius)
        box.set(facecolor="0.85", edgecolor="black", lw=0.6, hatch="////")
        axes.add_patch(box)
    axes.text(x + 1.3 * radius + 3, foot + 2, "stand", fontsize=8)


def _title(axes: Axes, height: float, text: str, scale: float) -> None:
    axes.text(20, height - 22, text, fontsize=14)
    shown = "1 : 1" if scale == 1 else f"{scale:.2f} : 1"
    axes.text(20, height - 29, f"All lengths in mm. Scale {shown}.", fontsize=8)


def _form(axes: Axes, width: float, rows: Sequence[tuple[str, str]]) -> None:
    """What is to be measured once, with room for the answers, at the foot of the sheet."""
    step = 9.0
    top = 20.0 + step * (len(rows) + 1)
    axes.text(20, top + 3, "To be measured once, at the temperature of the scanner, then written "
              "into the .toml file:", fontsize=8)  # fmt: skip
    for k, (letter, what) in enumerate(rows):
        y = top - step * (k + 0.8)
        axes.text(20, y, letter, fontsize=10, fontweight="bold")
        axes.text(30, y, what, fontsize=8)
        axes.text(width - 62, y, "______________ ± ________", fontsize=8)
    axes.text(20, 14, "who, when, with what: " + "_" * 60 + "   °C ________", fontsize=8)


def _size(axes: Axes, a: tuple[float, float], b: tuple[float, float], text: str) -> None:
    """A dimension line from a to b, upright, with its text beside it."""
    axes.annotate("", a, b, arrowprops={"arrowstyle": "<->", "lw": 0.6, "shrinkA": 0, "shrinkB": 0})
    x, y = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
    if abs(b[1] - a[1]) < 20:
        axes.text(x + 1.5, y, text, fontsize=8, va="center")
    else:
        axes.text(x - 1, y, text, fontsize=8, rotation=90, ha="right", va="center")


def _arrow(axes: Axes, at: tuple[float, float], off: tuple[float, float], text: str) -> None:
    axes.annotate(
        text, at, off, fontsize=8, va="center", arrowprops={"arrowstyle": "->", "lw": 0.6}
    )


def _line(axes: Axes, a: Any, b: Any, style: str = "-", lw: float = 0.5) -> None:
    p: Floats = np.array([a, b], dtype=np.float64)
    axes.plot(p[:, 0], p[:, 1], style, color="black", lw=lw, solid_capstyle="butt")

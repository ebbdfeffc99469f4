"""Sections as SVG and PDF drawings."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings._sheet import HEIGHT, PENS, WIDTH, Curve, Map, Sheet, Stroke, Text, sheets
from turnscan.formats._text import about_lines
from turnscan.shapes import Arc, FittedSection, Line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FONT = "Liberation Sans, Arial, Helvetica, sans-serif"
_POINTS = 72.0 / 25.4
_LETTER = 0.72
"""Height of a capital as a part of the font's size."""
_FINE = 0.005
"""mm on paper: how far chords may lie from an arc in the PDF."""


def write_section_svg(
    sections: Sequence[FittedSection], title: str, about: Mapping[str, object]
) -> bytes:
    """Return an SVG of A4 sheets below each other, mm; arcs are arcs. The same input gives the same
    bytes.

    Texts stay texts. Colours and widths as in `_sheet.PENS`.
    """
    pages = sheets(sections, title)
    tall = HEIGHT * len(pages)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH:g}mm" height="{tall:g}mm" '
        f'viewBox="0 0 {WIDTH:g} {tall:g}" font-family="{_FONT}">'
    )
    notes = "".join(f"<!-- {line.replace('--', '- -')} -->\n" for line in about_lines(about))
    body = [
        f'<g id="sheet-{k + 1}" transform="translate(0 {k * HEIGHT:g})">'
        f"<title>{escape(page.name)}</title>\n{_page(page)}</g>\n"
        for k, page in enumerate(pages)
    ]
    white = f'<rect width="{WIDTH:g}" height="{tall:g}" fill="#ffffff"/>\n'
    return f"{head}\n{notes}{white}{''.join(body)}</svg>\n".encode()


def _page(page: Sheet) -> str:
    rows = []
    for item in page.items:
        if isinstance(item, Text | Map):
            rows.append(_text(item) if isinstance(item, Text) else _map(item))
            continue
        colour, width = PENS[item.pen]
        path = _stroke(item) if isinstance(item, Stroke) else _curve(item)
        style = f'fill="none" stroke="{colour}" stroke-width="{width:g}" stroke-linejoin="round"'
        rows.append(f'<path class="{item.pen}" {style} d="{path}"/>')
    colour = PENS["dimensions"][0]
    rows += [f'<path fill="{colour}" d="{_path(a)}Z"/>' for a in page.fills]
    return "\n".join(rows) + "\n"


def _map(item: Map) -> str:
    (x, y), (width, height) = item.box[0], item.box[1] - item.box[0]
    data = base64.b64encode(item.png).decode("ascii")
    return (
        f'<image x="{x:.4f}" y="{y:.4f}" width="{width:.4f}" height="{height:.4f}" '
        f'preserveAspectRatio="none" href="data:image/png;base64,{data}"/>'
    )


def _xy(point: Floats) -> str:
    return f"{point[0]:.4f},{point[1]:.4f}"


def _path(points: Floats) -> str:
    return "M" + "L".join(map(_xy, points))


def _stroke(stroke: Stroke) -> str:
    return _path(stroke.points) + ("Z" if stroke.closed else "")


def _curve(curve: Curve) -> str:
    piece = curve.piece
    if isinstance(piece, Arc):
        # A full circle has no direction between equal ends, so it goes in two halves.
        turns = piece.begin + piece.sweep * np.linspace(0, 1, 3 if piece.full else 2)
        on = piece.centre + piece.radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        large = int(abs(piece.sweep) > np.pi and not piece.full)
        r = f"{piece.radius:.4f}"
        way = int(piece.sweep > 0)
        return f"M{_xy(on[0])}" + "".join(f"A{r},{r} 0 {large} {way} {_xy(p)}" for p in on[1:])
    if isinstance(piece, Line):
        return _path(np.stack([piece.start, piece.end]))
    return _path(piece.sampled(_FINE))


def _text(text: Text) -> str:
    x, y = text.at
    size = text.height / _LETTER
    turn = f' transform="rotate({np.rad2deg(text.angle):.3f} {_xy(text.at)})"' if text.angle else ""
    anchor = ' text-anchor="middle"' if text.middle else ""
    down = text.height / 2 if text.middle else 0.0
    return (
        f'<text x="{x:.3f}" y="{y + down:.3f}" font-size="{size:.3f}" '
        f'fill="{PENS[text.pen][0]}"{anchor}{turn}>{escape(text.text)}</text>'
    )


def write_section_pdf(sections: Sequence[FittedSection], title: str) -> bytes:
    """Return a PDF with an A4 sheet for each section, in true scale."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    out = io.BytesIO()
    about = {"Title": title, "Creator": "turnscan", "CreationDate": None}
    with rc_context({"pdf.fonttype": 42}), PdfPages(out, metadata=about) as pdf:
        for page in sheets(sections, title):
            pdf.savefig(_figure(page))
    return out.getvalue()


def draw_section(section: FittedSection, title: str) -> Figure:
    """The sheet of one section as a figure of matplotlib, A4, for pictures."""
    return _figure(sheets([section], title)[0])


def _figure(page: Sheet) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    _draw(axes, page)
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(HEIGHT, 0)
    return figure


def _draw(axes: object, page: Sheet) -> None:
    from matplotlib.axes import Axes
    from PIL import Image

    assert isinstance(axes, Axes)
    for item in page.items:
        if isinstance(item, Map):
            (left, top), (right, bottom) = item.box
            pixels = np.asarray(Image.open(io.BytesIO(item.png)))
            edges = (left, right, bottom, top)
            axes.imshow(pixels, extent=edges, aspect="auto", interpolation="nearest")
            continue
        colour, width = PENS[item.pen]
        if isinstance(item, Text):
            axes.text(
                float(item.at[0]), float(item.at[1]), item.text, color=colour,
                ha="center" if item.middle else "left", rotation_mode="anchor",
                va="center" if item.middle else "baseline",
                fontsize=item.height / _LETTER * _POINTS, rotation=-float(np.rad2deg(item.angle)),
            )  # fmt: skip
            continue
        points = item.points if isinstance(item, Stroke) else item.piece.sampled(_FINE)
        if isinstance(item, Stroke) and item.closed:
            points = np.vstack([points, points[:1]])
        axes.plot(*points.T, color=colour, linewidth=width * _POINTS, solid_joinstyle="round")
    for arrow in page.fills:
        axes.fill(*arrow.T, color=PENS["dimensions"][0], linewidth=0)

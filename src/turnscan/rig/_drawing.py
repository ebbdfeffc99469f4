"""A rig drawn as seen from above and from the side, for a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats

_SIZE = 150.0
_COLOURS = ("#c22", "#27a", "#282", "#a5a")
_STYLE = 'font-family="sans-serif" font-size="9" fill="none" stroke-width="1.2"'


class Beam(NamedTuple):
    """A laser as it is drawn; all in the table frame, mm."""

    name: str
    source: Floats
    """(3,) where its light comes from."""
    centre: Floats
    """(3,) a point in the middle of its sheet."""


def views(eye: Floats, ahead: Floats, beams: Sequence[Beam]) -> str:
    """SVG: from above (x to the right, y up), and from the side of the camera (distance, height).

    ``eye`` (3,) mm is where the camera stands, ``ahead`` (3,) the direction it looks in.
    """
    reach = 1.1 * max(float(np.abs(p).max()) for p in (eye, *(b.source for b in beams)))
    scale = 0.5 * _SIZE / max(reach, 1.0)
    foot = 0.2 * reach * scale
    centre = (0.5 * _SIZE, 0.5 * _SIZE)
    parts = [_frame("from above", 0.0), _frame("from the side", _SIZE + 10)]
    parts.append(f'<circle cx="{centre[0]}" cy="{centre[1]}" r="{foot:.1f}" stroke="#999"/>')
    side = eye[:2] / max(float(np.hypot(*eye[:2])), 1e-9)
    end = eye + 1.15 * float(np.linalg.norm(eye)) * ahead

    def above(p: Floats) -> tuple[float, float]:
        return centre[0] + scale * float(p[0]), centre[1] - scale * float(p[1])

    def aside(p: Floats) -> tuple[float, float]:
        x = _SIZE + 10 + centre[0] + scale * float(p[:2] @ side)
        return x, centre[1] - scale * float(p[2])

    for view in (above, aside):
        parts.append(_line(view(eye), view(end), "#555"))
        parts.append(_dot(view(eye), "#555", "camera"))
        for k, beam in enumerate(beams):
            colour = _COLOURS[k % len(_COLOURS)]
            far = beam.source + 1.3 * (beam.centre - beam.source)
            parts.append(_line(view(beam.source), view(far), colour))
            parts.append(_dot(view(beam.source), colour, beam.name, 11.0))
    axis = _SIZE + 10 + centre[0]
    parts.append(f'<path d="M{axis} 12V{_SIZE - 4}" stroke="#999" stroke-dasharray="4 3"/>')
    parts.append(f'<path d="M{axis - foot:.1f} {centre[1]}h{2 * foot:.1f}" stroke="#999"/>')
    wide = 2 * _SIZE + 10
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:g}" height="{_SIZE:g}" '
        f'viewBox="0 0 {wide:g} {_SIZE:g}" {_STYLE}>{"".join(parts)}</svg>'
    )


def _frame(title: str, left: float) -> str:
    return f'<text x="{left + 2:g}" y="9" fill="#777">{title}</text>'


def _line(a: tuple[float, float], b: tuple[float, float], colour: str) -> str:
    return f'<path d="M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" stroke="{colour}"/>'


def _dot(at: tuple[float, float], colour: str, name: str, drop: float = -4.0) -> str:
    x, y = at
    end = ' text-anchor="end"' if x % (_SIZE + 10) > 0.7 * _SIZE else ""
    left = -5.0 if end else 5.0
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>'
        f'<text x="{x + left:.1f}" y="{y + drop:.1f}" fill="{colour}"{end}>{escape(name)}</text>'
    )

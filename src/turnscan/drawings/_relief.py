"""The unrolled surface in a drawing: angles, heights, levels, and the map of its radius."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.drawings._dimensions import Marks, dimensions
from turnscan.shapes import Chain, FittedSection
from turnscan.shapes.views import Relief

_ANGLE = 45
"""Degrees between two marks."""
_HEIGHTS = 6
_TICK = 0.6
_MAP, _LIGHT = "YlGnBu", 0.6
"""Its lighter part, on which lines and texts can be read."""


def marks_of(section: FittedSection, height: float) -> Marks:
    """The dimensions of a section, or the angles, heights and radii of an unrolled surface.

    ``height`` mm of the letters, in the drawing's own scale.
    """
    if section.relief is None:
        return dimensions(section, height)
    marks = Marks(height)
    _axes(marks, section.relief, section.chains)
    return marks


def _axes(marks: Marks, relief: Relief, chains: Sequence[Chain]) -> None:
    """A frame with angles in degrees below and heights at the left, and the radius on the lines."""
    (x0, y0), (x1, y1) = relief.box
    h = marks.height
    marks.loose.append(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]))
    for degrees in range(-180, 181, _ANGLE):
        x = relief.radius * np.deg2rad(degrees)
        marks.loose.append(np.array([[x, y0], [x, y0 - _TICK * h]]))
        marks.note(np.array([x, y0 - 1.8 * h]), f"{degrees}°", 0.0)
    for z in _round_places(float(y0), float(y1)):
        marks.loose.append(np.array([[x0 - _TICK * h, z], [x0, z]]))
        text = f"{z:g}"
        marks.note(np.array([x0 - (1.4 + 0.41 * len(text)) * h, z]), text, 0.0)
    named = set[float]()
    for chain, level in sorted(zip(chains, relief.levels, strict=True), key=lambda c: -c[0].length):
        if level not in named and _name(marks, chain, float(level)):
            named.add(level)


def _round_places(low: float, high: float) -> list[float]:
    least = (high - low) / _HEIGHTS
    unit = 10.0 ** np.floor(np.log10(max(least, 1e-9)))
    step = float(next(k for k in (1, 2, 5, 10) if k * unit >= least) * unit)
    return [float(step * k) for k in range(int(np.ceil(low / step)), int(high // step) + 1)]


def _name(marks: Marks, chain: Chain, level: float) -> bool:
    """Put the radius beside the middle of a line, where there is room."""
    if chain.length < 12 * marks.height:
        return False
    for share in (0.5, 0.3, 0.7, 0.15, 0.85):
        k = int(share * (len(chain.points) - 1))
        at = chain.points[k] + [0.0, 0.9 * marks.height]
        if marks.note(at, f"r {level:g}", 0.0):
            return True
    return False


def relief_picture(relief: Relief) -> bytes:
    """The map as a PNG, the highest row first, transparent where there is no surface."""
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(_colours(relief.r[::-1], relief), "RGBA").save(out, "PNG", optimize=True)
    return out.getvalue()


def relief_scale(relief: Relief) -> bytes:
    """The colours from the least radius, at the left, to the largest, as a PNG."""
    from PIL import Image

    low, high = relief_range(relief)
    out = io.BytesIO()
    row = np.linspace(low, high, 128)[None]
    Image.fromarray(_colours(row, relief), "RGBA").save(out, "PNG", optimize=True)
    return out.getvalue()


def _colours(r: Floats, relief: Relief) -> npt.NDArray[np.uint8]:
    import matplotlib as mpl

    low, high = relief_range(relief)
    share = np.clip((r - low) / max(high - low, 1e-300), 0.0, 1.0)
    colours = (
        np.asarray(mpl.colormaps[_MAP](_LIGHT * np.nan_to_num(share)) * 255)
        .round()
        .astype(np.uint8)
    )
    colours[..., 3] = np.where(np.isfinite(r), 255, 0)
    return colours


def relief_range(relief: Relief) -> tuple[float, float]:
    """The radii between which the colours lie, mm: all but the outermost half percent."""
    r = relief.r[np.isfinite(relief.r)]
    if not len(r):
        return relief.radius, relief.radius
    low, high = np.percentile(r, [0.5, 99.5])
    return float(low), float(high)


def relief_in_words(relief: Relief) -> str:
    """What the drawing shows, in a line."""
    low, high = relief_range(relief)
    known = f"noise {relief.noise:.2g} mm" if np.isfinite(relief.noise) else "noise not known"
    lines = (
        f"{len(np.unique(relief.levels))} levels, every {relief.step:g} mm"
        if len(relief.levels)
        else "no line of equal radius stands out of the noise"
    )
    return (
        f"radius {low:.3f} to {high:.3f} mm, {known}; {lines}; x = {relief.radius:.3f} mm · angle"
    )

"""What a report tells about the surface: coverage, noise, holes and causes, before and after.

Angles count as in the object's frame, counter-clockwise seen from above from the zero mark.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from turnscan.arrays import Floats, Image, Ints
from turnscan.mesh import Mesh
from turnscan.pipeline import Reconstruction
from turnscan.points import RangeGrid
from turnscan.shapes import area
from turnscan.surface.holes import CAUSE_WORDS, Hole, closings
from turnscan.workflows._solids._deviation_map import VIEWS
from turnscan.workflows._surface._quality_map import has_sigmas, quality_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ANGLES, _HEIGHTS = 120, 60
"""Cells of the maps, at most."""
_ROWS = 40
"""Holes in the table of the HTML page; the JSON file has all."""
_MEASURED, _FILLED = (122.0, 158.0, 196.0), (204.0, 121.0, 167.0)
"""Distinct with every common colour blindness (Okabe & Ito)."""


@dataclass(frozen=True)
class Maps:
    """What was measured over angle and height."""

    angle: Floats
    """(a + 1,) rad: limits of the cells."""
    height: Floats
    """(h + 1,) mm."""
    lasers: Ints
    """(h, a) how many lasers measured points in a cell."""
    sigma: Floats
    """(h, a) mm: median sigma of a cell's points; NaN where there is none or none is known."""


def maps(grids: Sequence[RangeGrid]) -> Maps:
    """Coverage and noise of the grids' points over angle about the axis and height."""
    X = np.concatenate([np.zeros((0, 3)), *(g.points[g.found] for g in grids)])
    names = sorted({g.laser for g in grids})
    laser = np.concatenate(
        [np.zeros(0), *(np.full(int(g.found.sum()), names.index(g.laser)) for g in grids)]
    )
    sigma = np.concatenate([np.zeros(0), *(g.sigma[g.found] for g in grids)])
    steps = max((len(g.steps) for g in grids), default=1)
    # Cells of whole steps, so that none is empty for falling between two profiles.
    angle = np.linspace(0, 2 * np.pi, max(1, min(_ANGLES, steps)) + 1)
    low, high = (float(X[:, 2].min()), float(X[:, 2].max())) if len(X) else (0.0, 1.0)
    height = np.linspace(low, max(high, low + 1e-3), _HEIGHTS + 1)
    around, z = np.arctan2(X[:, 1], X[:, 0]) % (2 * np.pi), X[:, 2]
    shape = (len(height) - 1, len(angle) - 1)
    count = np.zeros(shape, dtype=np.int32)
    for k in range(len(names)):
        part = laser == k
        count += np.histogram2d(z[part], around[part], (height, angle))[0] > 0
    known = ~np.isnan(sigma)
    if not known.any():
        return Maps(angle, height, count, np.full(shape, np.nan))
    row, column = _cell(z[known], height), _cell(around[known], angle)
    middle = _medians(row * shape[1] + column, sigma[known], shape[0] * shape[1])
    return Maps(angle, height, count, middle.reshape(shape))


def _cell(x: Floats, limits: Floats) -> Ints:
    """(n,) the cell of each number; the last one has its upper limit, too."""
    return np.minimum(np.searchsorted(limits, x, side="right") - 1, len(limits) - 2)


def _medians(cell: Ints, values: Floats, cells: int) -> Floats:
    """(cells,) the median of the values in each cell; NaN where there is none."""
    from scipy.ndimage import median  # one sort of all; scipy.stats asks for each cell

    there = np.unique(cell)
    middle = np.full(cells, np.nan)
    middle[there] = median(values, cell, there)
    return middle


def surface_figures(done: Reconstruction) -> dict[str, Any]:
    """The numbers of the surface report, for the JSON file."""
    return _figures(done, maps(done.grids))


def _figures(done: Reconstruction, m: Maps) -> dict[str, Any]:
    before = _before(done)
    measured, missing = area(before).value, sum(h.area for h in done.holes)
    return {
        "surface": {
            "measured_mm2": measured,
            "missing_mm2": missing,
            "measured_share": measured / max(measured + missing, 1e-300),
            "after_faces": len(done.mesh.faces),
            "after_not_measured_faces": 0
            if done.mesh.measured is None
            else int((~done.mesh.measured).sum()),
        },
        "holes": [
            {
                "number": k + 1,
                "cause": h.cause,
                "also": h.also,
                "filled": how,
                "centre_mm": h.centre.tolist(),
                "angle_deg": _angle_deg(h),
                "size_mm": h.size,
                "perimeter_mm": h.perimeter,
                "area_mm2": h.area,
                "sides": len(h.loop),
            }
            for k, (h, how) in enumerate(zip(done.holes, _filled(done), strict=True))
        ],
        "light_assumed": _assumed(done),
        "maps": {
            "angle_deg": np.rad2deg(m.angle).tolist(),
            "height_mm": m.height.tolist(),
            "lasers": m.lasers.tolist(),
            "sigma_mm": [[None if np.isnan(v) else float(v) for v in row] for row in m.sigma],
        },
    }


def holes_line(done: Reconstruction) -> list[str]:
    """How many holes there are and why, in one line; none without a hole."""
    if not done.holes:
        return []
    known = Counter(h.cause for h in done.holes if h.cause is not None)
    why = ", ".join(f"{n} {CAUSE_WORDS[cause]}" for cause, n in known.most_common())
    return [f"holes: {len(done.holes)}" + (f" ({why})" if why else "")]


def light_line(done: Reconstruction) -> list[str]:
    """That the place of a laser's light was assumed for the causes; none where it is known."""
    names = _assumed(done)
    if not names or not done.holes:
        return []
    whose = ("laser " if len(names) == 1 else "lasers ") + ", ".join(names)
    return [
        f"causes: the light source position of {whose} is unknown; it was assumed to be at the "
        "height and distance from the axis of the camera"
    ]


def _assumed(done: Reconstruction) -> list[str]:
    """Names of the lasers whose rig does not say where the light comes from."""
    unsaid = [s.grid.laser for s in done.sought if s.rig.sheet(s.grid.laser).source is None]
    return list(dict.fromkeys(unsaid))


def surface_parts(done: Reconstruction) -> list[str]:
    """The surface's part of the HTML page."""
    from turnscan.workflows._pages import _html as html

    m = maps(done.grids)
    figures = _figures(done, m)
    s = figures["surface"]
    share = f"{s['measured_mm2']:.0f} mm² measured, {s['missing_mm2']:.0f} mm² in holes: "
    parts = [html.heading("Coverage"), html.paragraph(f"{share}{s['measured_share']:.1%} measured")]
    caption = "Number of measuring lasers over angle and height; white: none; numbers: the holes"
    parts.append(html.picture(_coverage(m, done.holes), caption))
    if np.isfinite(m.sigma).any():
        caption = "Standard uncertainty of a point, mm: the median of each cell; white: no point"
        parts.append(html.picture(_sigma(m), caption))
    parts.append(html.heading("Holes"))
    parts += [html.paragraph(line) for line in holes_line(done) or ["No holes."]]
    if done.holes:
        parts.append(_table(figures["holes"], done.holes))
        parts += [html.paragraph(line) for line in light_line(done)]
    if len(done.holes) > _ROWS:
        text = f"The {_ROWS} longest of {len(done.holes)}; a .json report has all."
        parts.append(html.paragraph(text))
    parts.append(html.heading("Surface"))
    before = _before(done)
    for azimuth in VIEWS:
        at = f"from {np.rad2deg(azimuth):.0f}°"
        parts.append(html.picture(_picture(before, azimuth), f"as measured, {at}"))
        if done.mesh is not before:
            text = f"after, {at}; pink: not measured"
            parts.append(html.picture(_picture(done.mesh, azimuth), text))
    if has_sigmas(before):
        parts.append(html.heading("Quality"))
        text = "Standard uncertainty of the points as measured, mm, and the holes by their causes"
        parts.append(html.picture(quality_figure(before, done.holes), text))
    return parts


def _table(rows: Sequence[dict[str, Any]], holes: Sequence[Hole]) -> str:
    from turnscan.workflows._pages import _html as html

    head = ["hole", "cause", "filled", "angle", "x, y, z mm", "size mm", "border mm", "area mm²"]
    shown = [
        [
            r["number"],
            h.reason,
            r["filled"],
            f"{r['angle_deg']:.0f}°",
            ", ".join(f"{x:.1f}" for x in r["centre_mm"]),
            f"{r['size_mm']:.2f}",
            f"{r['perimeter_mm']:.2f}",
            f"{r['area_mm2']:.2f}",
        ]
        for r, h in list(zip(rows, holes, strict=True))[:_ROWS]
    ]
    return html.table(head, shown)


def _before(done: Reconstruction) -> Mesh:
    return done.mesh if done.opened is None else done.opened


def _filled(done: Reconstruction) -> list[str]:
    return closings(_before(done), done.holes, done.caps, done.mesh)


def _angle_deg(hole: Hole) -> float:
    return float(np.rad2deg(np.arctan2(hole.centre[1], hole.centre[0])) % 360)


def _figure(m: Maps) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    axes.set_xlabel("angle, degrees")
    axes.set_ylabel("height, mm")
    axes.set_xlim(0, 360)
    axes.set_ylim(m.height[0], m.height[-1])
    return figure, axes


def _coverage(m: Maps, holes: Sequence[Hole]) -> Figure:
    import matplotlib as mpl

    figure, axes = _figure(m)
    most = max(1, int(m.lasers.max(initial=1)))
    shades = mpl.colormaps["Blues"](np.linspace(0, 0.75, most + 1))
    shades[0] = 1.0
    colours = mpl.colors.ListedColormap(list(shades))
    drawn = axes.pcolormesh(
        np.rad2deg(m.angle), m.height, m.lasers, cmap=colours, vmin=-0.5, vmax=most + 0.5
    )
    figure.colorbar(drawn, ax=axes, ticks=range(most + 1), label="lasers")
    for k, hole in list(enumerate(holes))[:_ROWS]:
        z = float(np.clip(hole.centre[2], m.height[0], m.height[-1]))
        axes.text(
            _angle_deg(hole), z, str(k + 1), ha="center", va="center", fontsize=8, color="black",
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "black", "lw": 0.6},
        )  # fmt: skip
    return figure


def _sigma(m: Maps) -> Figure:
    figure, axes = _figure(m)
    top = float(np.nanquantile(m.sigma, 0.98))
    drawn = axes.pcolormesh(
        np.rad2deg(m.angle), m.height, m.sigma, cmap="cividis", vmin=0.0, vmax=top
    )
    figure.colorbar(drawn, ax=axes, label="sigma, mm", extend="max")
    return figure


def _picture(mesh: Mesh, azimuth: float) -> Image:
    if mesh.measured is None or mesh.measured.all():
        return mesh.show(azimuth=azimuth).pixels
    corners = np.arange(3 * len(mesh.faces), dtype=np.int32)
    own = Mesh(mesh.triangles.reshape(-1, 3), corners.reshape(-1, 3))
    paint = np.where(mesh.measured[:, None], _MEASURED, _FILLED)
    return own.show(azimuth=azimuth, colour=np.repeat(paint, 3, axis=0)).pixels

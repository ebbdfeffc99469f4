"""How well a surface is known, as a map: sigma of each point in colours, holes by their causes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.drawings import Colour
from turnscan.mesh import Mesh
from turnscan.surface.clean import smooth
from turnscan.surface.holes import CAUSE_WORDS, Hole
from turnscan.workflows._pages._colours import CAUSE_COLOURS, GREY
from turnscan.workflows._solids._deviation_map import VIEWS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIGMA = "cividis"
"""Matplotlib's map of sigma, from good (dark blue) to poor (yellow), as in the browser."""
PARTS = 5
"""Equal parts of the vertices, from the least sigma to the largest, whose errors are compared."""
_REGION, _THINNED = 96, 8
"""Points that a region has, and of how many of a mesh one stands for the others."""
_BEYOND = 0.02
"""Share of the vertices beyond either end of the scale; they have its last colour."""
_LEAST = 1.4
"""Times the median sigma to which the scale goes at least, and down to its part of it: what is all
alike has one colour."""
_ROUNDS = 5
"""Of smoothing, of what is drawn alone: the shades of noise would hide the colours."""


def quality_figure(mesh: Mesh, holes: Sequence[Hole], error: Floats | None = None) -> Figure:
    """An open mesh in the colours of its regions' `sigmas`, its holes in those of their causes.

    It is shown from above and, turned over, from below. The scale is in mm, equal steps of
    colour for equal factors; vertices without a sigma are grey. ``error`` (v,) mm is how far each
    vertex lies from the truth, where one knows it: then a chart shows whether the map tells good
    from poor (`errors_by_sigma`), else how many vertices have which sigma.

    Raises InputError as `sigmas`.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    sigma = sigmas(mesh)
    low, high = _ends(sigma)
    norm = mpl.colors.LogNorm(low, high, clip=True)
    drawn = smooth(mesh, np.ones(len(mesh.vertices)), _ROUNDS)
    painted, colour = _with_lids(drawn, holes, _shades(sigma, norm(np.nan_to_num(sigma, nan=low))))
    figure = Figure(figsize=(11, 4.3), layout="constrained")
    left, right, chart = figure.subplots(1, 3, width_ratios=[1, 1, 0.8])
    over = Mesh(painted.vertices * (1.0, -1.0, -1.0), painted.faces)  # half a turn about x
    for axes, view, azimuth in zip((left, right), (painted, over), VIEWS, strict=True):
        axes.imshow(view.show(azimuth=azimuth, size=(480, 420), colour=colour).pixels)
        axes.set_axis_off()
    bar = figure.colorbar(
        mpl.cm.ScalarMappable(norm, SIGMA), ax=[left, right], fraction=0.03, extend="both",
        ticks=np.geomspace(low, high, 5), format="%.3g", label="sigma of the points, mm",
    )  # fmt: skip
    bar.minorticks_off()
    _legend(figure, holes)
    if error is None:
        chart.hist(np.clip(sigma, low, high), np.linspace(low, high, 61), color="#4a7fb0")
        chart.set_xlabel("sigma, mm (ends: beyond)")
        chart.set_ylabel("vertices")
    else:
        _bars(chart, errors_by_sigma(sigma, error))
    return figure


def sigmas(mesh: Mesh) -> Floats:
    """(v,) mm: sigma of the region about each vertex, NaN where the vertex has none.

    It is the rms of some `_REGION` points nearest to it: the sigma of one picture's points follows
    their scatter, which chance makes larger or smaller by a tenth though all are alike.

    Raises InputError where none of them has one.
    """
    from turnscan.errors import InputError

    if not has_sigmas(mesh):
        raise InputError(
            "no vertex of the mesh has a sigma, so there is no map of them",
            hint="take a mesh that was reconstructed from pictures",
        )
    from scipy.spatial import cKDTree

    assert mesh.provenance is not None
    sigma = np.array(mesh.provenance.sigma)
    known = np.flatnonzero(np.isfinite(sigma))
    few = known[:: max(1, min(_THINNED, len(known) // _REGION))]
    near = min(_REGION // _THINNED, len(few))
    _, beside = cKDTree(mesh.vertices[few]).query(mesh.vertices[known], near)
    sigma[known] = np.sqrt(np.mean(sigma[few][beside.reshape(len(known), near)] ** 2, axis=1))
    return sigma


def has_sigmas(mesh: Mesh) -> bool:
    """Whether any vertex has a sigma."""
    return mesh.provenance is not None and bool(np.isfinite(mesh.provenance.sigma).any())


def errors_by_sigma(sigma: Floats, error: Floats) -> Floats:
    """(`PARTS`, 2) mm: rms of sigma and rms of the error (v,), for equal parts of the vertices.

    The vertices with the least sigma (v,) are the first part. Those without one count nowhere.
    """
    known = np.flatnonzero(np.isfinite(sigma))
    parts = np.array_split(known[np.argsort(sigma[known], kind="stable")], PARTS)
    return np.array([[_rms(sigma[p]), _rms(error[p])] for p in parts])


def quality_line(sigma: Floats, error: Floats) -> str:
    """In words how far the best and the worst part of the vertices are off."""
    rms = errors_by_sigma(sigma, error)
    return (
        f"quality map: the {1 / PARTS:.0%} of the points in the regions of least sigma "
        f"({rms[0, 0]:.4f} mm rms) are {rms[0, 1]:.4f} mm rms off the true shape, "
        f"those of largest ({rms[-1, 0]:.4f} mm) {rms[-1, 1]:.4f} mm"
    )


def _rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(x * x))) if len(x) else float("nan")


def _ends(sigma: Floats) -> tuple[float, float]:
    """mm: where the scale of sigma (v,) begins and ends."""
    low, middle, high = np.nanquantile(sigma, [_BEYOND, 0.5, 1.0 - _BEYOND])
    middle = max(float(middle), 1e-6)
    return max(min(float(low), middle / _LEAST), 1e-7), max(float(high), middle * _LEAST)


def _shades(sigma: Floats, share: npt.ArrayLike) -> Floats:
    """(v, 3) colours 0 to 255 of vertices at this ``share`` (v,) of the scale; grey where sigma
    (v,) is NaN."""
    import matplotlib as mpl

    shade = mpl.colormaps[SIGMA](np.asarray(share))[:, :3] * 255
    return np.asarray(np.where(np.isfinite(sigma)[:, None], shade, GREY), dtype=np.float64)


def _with_lids(mesh: Mesh, holes: Sequence[Hole], colour: Floats) -> tuple[Mesh, Floats]:
    """The mesh with a lid over each hole, a fan from its middle, and the colours (v, 3) of both."""
    vertices, faces, shades = [mesh.vertices], [mesh.faces], [colour]
    count = len(mesh.vertices)
    for hole in holes:
        border = mesh.vertices[hole.loop]
        m = len(border)
        rim = np.arange(count, count + m, dtype=np.int32)
        # A border runs in the winding of its faces, its lid against it.
        fan = np.stack([np.roll(rim, -1), rim, np.full(m, count + m, dtype=np.int32)], axis=1)
        vertices += [border, hole.centre[None]]
        faces.append(fan)
        shades.append(np.tile(np.array(_colour(hole), dtype=np.float64), (m + 1, 1)))
        count += m + 1
    return Mesh(np.concatenate(vertices), np.concatenate(faces)), np.concatenate(shades)


def _colour(hole: Hole) -> Colour:
    return CAUSE_COLOURS[hole.cause or "unknown"]


def _legend(figure: Figure, holes: Sequence[Hole]) -> None:
    """The causes that occur, below the views."""
    from matplotlib.patches import Patch

    found = {h.cause or "unknown" for h in holes}
    some = [
        Patch(facecolor=(r / 255, g / 255, b / 255), edgecolor="black", label=CAUSE_WORDS[cause])
        for cause, (r, g, b) in CAUSE_COLOURS.items()
        if cause in found
    ]
    if some:
        figure.legend(
            handles=some, title="holes", loc="outside lower left", ncols=3, fontsize=9,
            title_fontsize=9, frameon=False, alignment="left",
        )  # fmt: skip


def _bars(chart: Axes, rms: Floats) -> None:
    """The rms errors of the parts beside what their sigmas say."""
    at = np.arange(1, PARTS + 1)
    chart.bar(at, rms[:, 1], color="#4a7fb0", label="error, rms")
    chart.plot(at, rms[:, 0], "o-", color="#d55e00", label="sigma, rms")
    chart.set_xlabel(f"points in {PARTS} equal parts, least sigma first")
    chart.set_ylabel("mm")
    chart.legend(fontsize=9)

"""Deviations from a reference as a colour map and a histogram."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes import Deviation
from turnscan.workflows._pages._colours import DEVIATION, deviation_shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VIEWS = (0.6, 0.6 + np.pi)
"""rad: azimuths from which reports show a part."""


def deviation_figure(mesh: Mesh, found: Deviation, limit: float | None = None) -> Figure:
    """Two views of a mesh coloured by the deviation of its vertices, and their histogram.

    ``limit`` (mm) is the deviation at the map's ends; by default what 95 % stay within, rounded up
    to one figure.
    """
    figure = distance_figure(mesh, found.distance, _top(found, limit), "deviation")
    rms = np.sqrt(np.mean(found.distance**2))
    figure.axes[2].set_title(f"rms {rms:.4f} mm", fontsize=10)
    return figure


def distance_figure(mesh: Mesh, distance: Floats, top: float, what: str) -> Figure:
    """Two views of a mesh coloured by ``distance`` (n,) mm of its vertices, and the histogram.

    The scale goes from -``top`` to ``top``; ``what`` is its name; NaN is grey.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    colour = deviation_shades(distance, top)
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right, chart = figure.subplots(1, 3, width_ratios=[1, 1, 0.8])
    for axes, azimuth in zip((left, right), VIEWS, strict=True):
        axes.imshow(mesh.show(azimuth=azimuth, size=(480, 420), colour=colour).pixels)
        axes.set_axis_off()
    _histogram(chart, distance[np.isfinite(distance)], top, what)
    shades = mpl.cm.ScalarMappable(mpl.colors.Normalize(-top, top), DEVIATION)
    figure.colorbar(shades, ax=[left, right], fraction=0.03, label="mm, positive outside")
    return figure


def deviation_colours(found: Deviation, limit: float | None = None) -> npt.NDArray[np.uint8]:
    """(n, 3) the colour of each point's deviation, on the scale of `deviation_figure`."""
    return np.asarray(deviation_shades(found.distance, _top(found, limit)))


def _top(found: Deviation, limit: float | None) -> float:
    return limit or _round_up(found.quantile(0.95))


def _histogram(chart: Axes, distance: Floats, top: float, what: str) -> None:
    chart.hist(np.clip(distance, -top, top), bins=61, range=(-top, top), color="#4a7fb0")
    chart.set_xlabel(f"{what}, mm (ends: beyond)")
    chart.set_ylabel("vertices")


def _round_up(value: float) -> float:
    if not value > 0:
        return 1e-3
    step = 10.0 ** np.floor(np.log10(value))
    return float(np.ceil(value / step) * step)

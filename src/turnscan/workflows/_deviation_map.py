"""Deviation from a reference as a colour map and a histogram."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes import Deviation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAP = "RdYlBu_r"  # distinct with every common colour blindness


def deviation_figure(mesh: Mesh, found: Deviation, limit: float | None = None) -> Figure:
    """Two views of a mesh coloured by the deviation of its vertices, and their histogram.

    ``limit`` (mm) is the deviation at the map's ends; by default what 95 % stay within, rounded up
    to one figure.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    top = _top(found, limit)
    colour = deviation_colours(found, limit)
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right, chart = figure.subplots(1, 3, width_ratios=[1, 1, 0.8])
    for axes, azimuth in ((left, 0.6), (right, 0.6 + np.pi)):
        axes.imshow(mesh.show(azimuth=azimuth, size=(480, 420), colour=colour).pixels)
        axes.set_axis_off()
    _histogram(chart, found.distance, top)
    shades = mpl.cm.ScalarMappable(mpl.colors.Normalize(-top, top), _MAP)
    figure.colorbar(shades, ax=[left, right], fraction=0.03, label="mm, positive outside")
    return figure


def deviation_colours(found: Deviation, limit: float | None = None) -> npt.NDArray[np.uint8]:
    """(n, 3) the colour of each point's deviation, on the scale of `deviation_figure`."""
    import matplotlib as mpl

    share = np.clip(found.distance / _top(found, limit), -1, 1) * 0.5 + 0.5
    return np.asarray(np.round(mpl.colormaps[_MAP](share)[:, :3] * 255), dtype=np.uint8)


def _top(found: Deviation, limit: float | None) -> float:
    return limit or _round_up(found.quantile(0.95))


def _histogram(chart: object, distance: Floats, top: float) -> None:
    from matplotlib.axes import Axes

    assert isinstance(chart, Axes)
    chart.hist(np.clip(distance, -top, top), bins=61, range=(-top, top), color="#4a7fb0")
    chart.set_xlabel("deviation, mm (ends: beyond)")
    chart.set_ylabel("vertices")
    chart.set_title(f"rms {np.sqrt(np.mean(distance**2)):.4f} mm", fontsize=10)


def _round_up(value: float) -> float:
    if not value > 0:
        return 1e-3
    step = 10.0 ** np.floor(np.log10(value))
    return float(np.ceil(value / step) * step)

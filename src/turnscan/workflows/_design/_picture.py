"""The picture of a design: working volume, resolution, and what limits it where."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.rig import Design

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LASER, _CAMERA, _VOLUME = "#d62728", "#1f4e79", "#444444"
_COLOURS = "viridis_r"
_SHADES = 25


def draw(designs: Sequence[Design]) -> bytes:
    """PNG of the first design: from above, in the laser sheet, over R, and over R and θ."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    d = designs[0]
    levels = _levels(d.delta_r(np.linspace(0, d.r_max, 200)))
    figure = Figure(figsize=(12, 9.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    _from_above(axes[0, 0], d, levels)
    _in_the_sheet(axes[0, 1], d, levels)
    _over_radius(axes[1, 0], d)
    _over_angle(axes[1, 1], d, [x.theta for x in designs])
    figure.suptitle(
        f"θ = {math.degrees(d.theta):g}°, L = {d.distance:g} mm, f = {d.focal:g} mm, "
        f"{d.columns}×{d.rows} pixels, step {math.degrees(d.step):g}°"
    )
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=90, metadata={"Software": "turnscan"})
    return out.getvalue()


def _levels(worth: Floats) -> Floats:
    """Steps of equal ratio over the values there are."""
    low, high = np.nanmin(worth), np.nanmax(worth)
    return np.geomspace(low * 0.999, high * 1.001, _SHADES)


def _shade(ax: Axes, x: Floats, y: Floats, worth: Floats, levels: Floats, bar: bool = True) -> None:
    """Colour the plane by ΔR per pixel, with a bar in plain numbers."""
    masked = np.ma.masked_invalid(worth)
    shades = ax.contourf(x, y, masked, levels, norm="log", cmap=_COLOURS, extend="max")
    if bar:
        scale = ax.figure.colorbar(
            shades, ax=ax, label="ΔR per pixel, mm", pad=0.01, format="%.2g", ticks=levels[::4]
        )
        scale.ax.minorticks_off()


def _from_above(ax: Axes, d: Design, levels: Floats) -> None:
    """Camera, its field, the laser's line, the axis, and the disc that a full turn measures."""
    R = np.linspace(0, d.r_max, 120)
    around = np.linspace(0, 2 * np.pi, 181)
    X, Y = np.outer(R, np.cos(around)), np.outer(R, np.sin(around))
    worth = np.repeat(d.delta_r(R)[:, None], len(around), axis=1)
    _shade(ax, X, Y, worth, levels, bar=False)
    ax.plot(X[-1], Y[-1], color=_VOLUME, lw=1.2)
    reach = 1.25 * (d.distance + d.r_max)
    for edge in (-1, 0, 1):
        ray = d.pan + edge * d.gamma_max
        ends = [d.distance, d.distance - reach * math.cos(ray)], [0.0, reach * math.sin(ray)]
        ax.plot(*ends, color=_CAMERA, lw=1.0, ls="--" if edge == 0 else "-")
    s = np.array([-1.1, 1.35]) * d.r_max
    ax.plot(
        s * np.cos(d.theta) - d.offset * np.sin(d.theta),
        s * np.sin(d.theta) + d.offset * np.cos(d.theta),
        color=_LASER,
        lw=1.6,
    )
    tip = 1.35 * d.r_max * math.cos(d.theta), 1.35 * d.r_max * math.sin(d.theta)
    ax.annotate("laser", tip, (4, 4), textcoords="offset points", color=_LASER)
    ax.plot(d.distance, 0, marker="s", color=_CAMERA, ms=9)
    ax.annotate(
        "camera", (d.distance, 0), (0, 9), textcoords="offset points", color=_CAMERA, ha="right"
    )
    ax.plot(0, 0, "+", color="black", ms=12, mew=1.6)
    ax.annotate("rotation axis", (0, 0), (6, -14), textcoords="offset points")
    ax.annotate(
        f"R_max {d.r_max:.0f} mm",
        (0, -d.r_max),
        (0, -14),
        textcoords="offset points",
        ha="center",
        color=_VOLUME,
    )
    span = 1.45 * d.r_max
    ax.set(
        title="From above: what a full turn measures",
        xlabel="mm",
        ylabel="mm",
        xlim=(-span, max(d.distance * 1.06, span)),
        ylim=(-span, span),
        aspect="equal",
    )


def _in_the_sheet(ax: Axes, d: Design, levels: Floats) -> None:
    """The part of the laser sheet that the picture shows, with the working cylinder in it."""
    behind = d.r_min if math.isfinite(d.r_min) else -d.r_max
    R = np.linspace(max(behind, -d.r_max), d.r_max, 200)
    half = np.asarray(d.visible_height(R)) / 2
    rows = np.linspace(-1, 1, 3)[:, None]
    worth = np.broadcast_to(d.delta_r(R), (3, len(R)))
    _shade(ax, np.broadcast_to(R, worth.shape), rows * half, worth, levels)
    ax.plot(R, half, color=_CAMERA, lw=1.0, label="edge of the picture")
    ax.plot(R, -half, color=_CAMERA, lw=1.0)
    ax.plot([0, 0], [-half.max(), half.max()], color="black", ls="-.", lw=1.2)
    ax.annotate(
        "rotation axis", (0, -half.max()), (0, -12), textcoords="offset points", ha="center"
    )
    box = d.r_max, d.h_max / 2
    ax.plot(
        [0, box[0], box[0], 0],
        [box[1], box[1], -box[1], -box[1]],
        color=_VOLUME,
        lw=1.6,
        label=f"working cylinder: R_max {d.r_max:.0f} mm, H_max {d.h_max:.0f} mm",
    )
    near = d.depth_of_field / math.cos(d.theta)
    sharp = np.clip([-near, near], R[0], R[-1])
    for i, r in enumerate(sharp):
        ax.axvline(
            r, color="white", lw=1.4, ls=":", label=f"in focus ± {near:.0f} mm" if i else None
        )
    ax.set(
        title="In the laser sheet: height seen at each R",
        xlabel="R along the sheet, mm (negative: behind the axis)",
        ylabel="z from the camera's plane, mm",
    )
    ax.set_ylim(-1.7 * half.max(), 1.08 * half.max())
    ax.legend(loc="lower left", fontsize=8, facecolor="#cccccc")


def _over_radius(ax: Axes, d: Design) -> None:
    """What one point's error is made of, at every radius, and which part is the largest."""
    R = np.linspace(d.r_max / 200, d.r_max, 200)
    per_pixel = d.delta_r(R)
    parts = {
        "whole pixels, ΔR/√12": per_pixel / math.sqrt(12),
        f"speckle, contrast {d.speckle_contrast:g}": per_pixel * d.speckle_noise(),
        "camera noise (Cramér-Rao)": per_pixel * d.camera_noise,
        "step error, 5 % (along the turn)": d.step_error(R),
        "circle between profiles (bulge)": d.sagitta(R),
    }
    for (label, value), style in zip(parts.items(), (":", "-", "-", "--", "--"), strict=True):
        if np.any(value > 0):
            ax.plot(R, value, style, label=label)
    ax.plot(R, per_pixel, color="black", lw=1.0, label="ΔR per pixel")
    ax.set(
        title="Error of one point, and what limits it",
        xlabel="R, mm",
        ylabel="mm",
        yscale="log",
        xlim=(0, d.r_max),
    )
    ax.grid(alpha=0.3, which="both")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(fontsize=8)


def _over_angle(ax: Axes, d: Design, asked: Sequence[float]) -> None:
    """ΔR per pixel over R and θ: what another angle of triangulation would give."""
    thetas = np.radians(np.linspace(5, 75, 71))
    table, edge = [], []
    R = np.linspace(0, 1.6 * d.r_max, 161)
    for theta in thetas:
        try:
            other = replace(d, theta=float(theta))
        except InputError:
            table.append(np.full(len(R), np.nan))
            edge.append(np.nan)
            continue
        table.append(np.where(other.r_max >= R, other.delta_r(R), np.nan))
        edge.append(other.r_max)
    worth = np.array(table)
    _shade(ax, np.degrees(thetas), R, worth.T, _levels(worth))
    ax.plot(np.degrees(thetas), edge, color=_VOLUME, lw=1.4, label="R_max")
    for i, theta in enumerate(asked):
        label = "this design" if i == 0 else None
        ax.axvline(math.degrees(theta), color=_LASER, lw=1.6 if i == 0 else 0.8, label=label)
    ax.set(
        title="Other angles: finer when θ grows, but more shadow",
        xlabel="θ, °",
        ylabel="R, mm",
        ylim=(0, R[-1]),
    )
    ax.legend(fontsize=8, loc="upper right")

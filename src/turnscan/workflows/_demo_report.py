"""The demo's report: what the camera saw, what became of it, how far it is from the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.pipeline import Reconstruction
from turnscan.points import RangeGrid
from turnscan.shapes import Deviation
from turnscan.simulate import Simulated
from turnscan.stripes import Stripe
from turnscan.workflows._pages import _html as html
from turnscan.workflows._solids._deviation_map import deviation_figure
from turnscan.workflows._surface._quality_map import PARTS, quality_figure
from turnscan.workflows._surface._report import summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEW = 0.6
"""rad: where the mesh is seen from."""


@dataclass(frozen=True)
class DemoFrame:
    """One camera picture and the stripe found in it."""

    laser: str
    step: int
    picture: Image
    stripe: Stripe


@dataclass(frozen=True)
class DemoPictures:
    """What the page shows and the folder holds, as PNG files: a figure takes a second to draw."""

    stripes: tuple[bytes, ...]
    """One of each frame."""
    grids: tuple[bytes, ...]
    mesh: bytes
    quality: bytes
    deviation: bytes

    def files(self) -> dict[str, bytes]:
        """Those that get a file of their own, by its name."""
        return {
            "stripe": self.stripes[0],
            "grid": self.grids[0],
            "mesh": self.mesh,
            "quality": self.quality,
            "deviation": self.deviation,
        }


def demo_pictures(
    done: Reconstruction, found: Deviation, frames: Sequence[DemoFrame]
) -> DemoPictures:
    """All pictures of a demo but the camera's own and those of the repaired mesh."""
    return DemoPictures(
        stripes=tuple(html.png(_frame_figure(f)) for f in frames),
        grids=tuple(html.png(_grid_figure(g)) for g in done.grids),
        mesh=html.png(done.mesh.show(azimuth=_VIEW).pixels),
        quality=html.png(quality_figure(done.mesh, done.holes, found.distance)),
        deviation=html.png(deviation_figure(done.mesh, found)),
    )


def demo_report(
    devices: Simulated,
    done: Reconstruction,
    repaired: Mesh,
    closing: Sequence[Finding],
    found: Deviation,
    quality: str,
    pictures: DemoPictures,
    frames: Sequence[DemoFrame],
    times: Sequence[tuple[str, float]],
) -> str:
    """The whole page as HTML text."""
    bench = devices.world.bench
    part = bench.scene.bodies[0].part.name
    parts = [
        html.paragraph(
            f"A simulated scan of the part “{part}” with the rig “{devices.spec.rig}”, seed "
            f"{devices.spec.seed}. The pictures hold speckle, photon and read noise, shadows and "
            "defocus. The reconstruction uses the true rig of the simulator, so the deviations "
            "below contain no error of a calibration."
        ),
        html.table(["quantity", "value"], _rows(devices, found)),
        html.heading("Camera picture"),
        *(
            html.picture(p, _frame_caption(f))
            for p, f in zip(pictures.stripes, frames, strict=True)
        ),
        html.heading("Range grid"),
        *(
            html.picture(p, _grid_caption(g))
            for p, g in zip(pictures.grids, done.grids, strict=True)
        ),
        html.heading("Surface"),
        html.picture(pictures.mesh, _seen_from(_VIEW)),
        html.picture(done.mesh.show(azimuth=_VIEW + math.pi).pixels, _seen_from(_VIEW + math.pi)),
        html.picture(
            repaired.show(azimuth=_VIEW, elevation=0.9).pixels,
            "Repaired. Surface that was never lit is interpolated here, for instance the inside "
            "of a vessel.",
        ),
        html.heading("Quality"),
        html.picture(
            pictures.quality,
            "What the surface says of itself: the standard uncertainty of its points, and why "
            f"there are holes. Does it tell good from poor? The points in {PARTS} equal parts, "
            "from the least sigma to the largest: how far they are off in truth, which only a "
            "simulation knows, and what their sigma says.",
        ),
        html.paragraph(quality),
        html.heading("Deviation from the true shape"),
        html.picture(
            pictures.deviation,
            "Each measured vertex against the true surface; nothing was fitted or aligned.",
        ),
        html.heading("Findings"),
        html.findings([*done.findings, *closing]),
        html.heading("Time"),
        html.table(["work", "s"], [(what, f"{s:.1f}") for what, s in times]),
    ]
    parts += [html.paragraph(line) for line in summary(done, bench.rig)]
    return html.page(f"turnscan demo: {part}", parts)


def _seen_from(azimuth: float) -> str:
    return f"As measured, from {math.degrees(azimuth):.0f}°."


def _rows(devices: Simulated, found: Deviation) -> list[tuple[str, str]]:
    bench = devices.world.bench
    camera = bench.rig.camera
    beam = bench.beams[0]
    return [
        ("camera", f"{camera.width} × {camera.height} pixels, f/{bench.lens.f_number:g}"),
        ("lasers", ", ".join(f"{b.name} {b.wavelength * 1e6:.0f} nm" for b in bench.beams)),
        ("thickness of the sheet (1/e²)", f"{2 * beam.waist:.2f} mm at its waist"),
        ("speckle grain λN′", f"{bench.grain[1]:.2f} pixel widths"),
        ("table positions", f"{devices.steps}"),
        ("mean deviation", f"{found.mean:+.4f} mm"),
        ("rms deviation", f"{found.rms:.4f} mm"),
        ("95 % of the points within", f"{found.quantile(0.95):.4f} mm"),
    ]


def _frame_figure(frame: DemoFrame) -> Figure:
    """A camera picture with the stripe found in it, whole and a piece of it enlarged."""
    from matplotlib.figure import Figure

    picture = frame.picture.astype(np.float64)
    grey = picture if picture.ndim == 2 else picture.max(axis=2)
    top = max(float(np.quantile(grey, 0.9995)), 1.0)
    figure = Figure(figsize=(11, 5), layout="constrained")
    whole, near = figure.subplots(1, 2, width_ratios=[1.3, 1])
    place = frame.stripe.pixels[frame.stripe.found]
    for axes in (whole, near):
        axes.imshow((grey / top).clip(0, 1) ** 0.6, cmap="gray", interpolation="nearest")
        axes.plot(place[:, 0], place[:, 1], ".", color="#ff5a36", markersize=1.5)
    if len(place):
        u, v = place[len(place) // 2]
        near.set_xlim(u - 24, u + 24)
        near.set_ylim(v + 24, v - 24)
        near.lines[0].set_markersize(5)
    whole.set_title(f"laser {frame.laser}, step {frame.step}", fontsize=10)
    near.set_title("48 × 48 pixels of it", fontsize=10)
    return figure


def _frame_caption(frame: DemoFrame) -> str:
    return (
        f"Picture with laser {frame.laser} lit, brightened; dots: the stripe found in "
        f"{int(frame.stripe.found.sum())} of {len(frame.stripe.position)} rows."
    )


def _grid_figure(grid: RangeGrid) -> Figure:
    """The distance from the axis, one column per table position."""
    from matplotlib.figure import Figure

    radius: Floats = np.hypot(grid.points[..., 0], grid.points[..., 1])
    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    shown = axes.imshow(radius.T, aspect="auto", cmap="viridis", interpolation="nearest")
    axes.set_xlabel("step")
    axes.set_ylabel("image row")
    rows = np.flatnonzero(grid.found.any(axis=0))
    if len(rows):
        axes.set_ylim(rows[-1] + 5, rows[0] - 5)
    figure.colorbar(shown, label="distance from the axis, mm")
    return figure


def _grid_caption(grid: RangeGrid) -> str:
    return (
        f"Laser {grid.laser}: one column per table position, one line per image row; white where "
        "nothing was measured."
    )

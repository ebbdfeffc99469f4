"""``turnscan demo``: scan a simulated part, and write it as DXF, STL, PLY and a report."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from turnscan.arrays import Image
from turnscan.cli._demo_report import DemoFrame, demo_report, frame_figure, grid_figure
from turnscan.cli._progress import progress, progress_bar
from turnscan.devices import burning
from turnscan.errors import InputError
from turnscan.formats import ExportOptions
from turnscan.pipeline import Reconstruction, reconstruct
from turnscan.rig import rig_to_json
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import Deviation, deviation
from turnscan.simulate import Simulated, Wish, simulated
from turnscan.surface.holes import Caps, close
from turnscan.workflows import _html as html
from turnscan.workflows import save, write_atomically
from turnscan.workflows._deviation_map import deviation_figure
from turnscan.workflows._png import write_png
from turnscan.workflows._render import render
from turnscan.workflows._report import about, summary
from turnscan.workflows._simulated import plan_of, scan_into_file, truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass
class _Clock:
    """How long each part of the work took."""

    at: float
    lines: list[tuple[str, float]]

    def lap(self, what: str) -> None:
        """Note the time since the last lap, under this name."""
        now = time.perf_counter()
        self.lines.append((what, now - self.at))
        click.echo(f"{what}: {now - self.at:.1f} s")
        self.at = now


@click.command("demo")
@click.option(
    "-o",
    "--output",
    default="demo-output",
    show_default=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Output folder; files of an earlier demo are replaced.",
)
@click.option("--scene", default="cup", show_default=True, help="Simulated part, or mesh file.")
@click.option(
    "--rig", default="paper", show_default=True, help="Simulated rig: paper, modern or ciclop."
)
@click.option("--steps", type=int, help="Number of table positions per turn.  [default: the rig's]")
@click.option("--seed", type=int, default=7, show_default=True, help="Seed of speckle and noise.")
def verb(output: Path, scene: str, rig: str, steps: int | None, seed: int) -> None:
    """The main job from end to end, without hardware.

    A simulated rig photographs the part, the scan file is reconstructed like any other, and the
    result is compared with the true shape, which only a simulation knows.
    """
    clock = _Clock(time.perf_counter(), [])
    devices = simulated(Wish(scene=scene, rig=rig, steps=steps, seed=seed))
    name = devices.world.bench.scene.bodies[0].part.name
    _make(output)
    plan = plan_of(devices)
    clock.lap("preparing")
    path = output / f"{name}.turnscan"
    with progress_bar() as bar:
        scan_into_file(devices, plan, path, "sparse", bar.subrange(0, 1, "scanning"))
    clock.lap(f"scanning {plan.steps} steps × {', '.join(plan.lasers)}")
    settings = Settings()
    with Scan.open(path) as scan, progress("reconstructing", len(scan)) as tick:
        done = reconstruct(scan, None, settings, tick)
        frames = [_frame(scan, devices, laser) for laser in plan.lasers]
    if not len(done.mesh.faces):
        raise InputError(f"{path}: nothing was measured", hint="take another scene or rig")
    mended, closing = close(done.mesh, Caps())
    clock.lap("reconstructing")
    options = ExportOptions(about=about(path, devices.world.bench.rig, settings))
    results = {output / f"{name}.{suffix}": mended for suffix in ("dxf", "stl", "ply")}
    save(dict.fromkeys(results, mended), options)
    write_atomically(output / "rig.json", rig_to_json(devices.world.bench.rig).encode())
    write_png(output / "frame.png", frames[0].picture)
    clock.lap("writing DXF, STL and PLY, each read back")
    found = deviation(done.mesh.vertices, truth(devices))
    text = demo_report(devices, done, mended, closing, found, frames, clock.lines)
    write_atomically(output / "report.html", text.encode())
    pictures: dict[str, Image | Figure] = {
        "stripe": frame_figure(frames[0]),
        "grid": grid_figure(done.grids[0]),
        "mesh": render(done.mesh, azimuth=0.6),
        "deviation": deviation_figure(done.mesh, found),
    }
    for picture, image in pictures.items():
        write_atomically(output / f"{picture}.png", html.png(image))
    clock.lap("comparing with the true shape, report")
    _tell(output, done, found, devices)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"{folder}: {e.strerror}", hint="name another folder with -o") from None


def _frame(scan: Scan, devices: Simulated, laser: str) -> DemoFrame:
    """The camera's picture of a frame a fifth of a turn on, and the stripe found in it."""
    from turnscan.stripes import detect

    step = scan.steps(laser)[len(scan.steps(laser)) // 5]
    frame = scan.frame(step, laser)
    stripe = detect(frame.lit, frame.dark)
    devices.turntable.move_to(frame.commanded, 1.0)
    with burning(devices.lasers, frozenset({laser})):
        picture = devices.camera.grab(5.0)
    return DemoFrame(laser, step, picture, stripe)


def _tell(output: Path, done: Reconstruction, found: Deviation, devices: Simulated) -> None:
    for line in summary(done, devices.world.bench.rig):
        click.echo(line)
    click.echo(
        "deviation from the true shape, measured with the true rig: "
        f"mean {found.mean:+.3f} mm, rms {found.rms:.3f} mm, "
        f"95 % within {found.quantile(0.95):.3f} mm, worst {np.abs(found.distance).max():.3f} mm"
    )
    for path in sorted(output.iterdir()):
        if path.is_file():
            click.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB")

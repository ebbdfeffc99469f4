"""Demo: scan a part with a simulated rig, and write it as DXF, STL, PLY and a report."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.devices import burning
from turnscan.errors import InputError
from turnscan.formats import ExportOptions
from turnscan.pipeline import reconstruct
from turnscan.progress import Progress, no_progress
from turnscan.rig import rig_to_json
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import Deviation, deviation
from turnscan.simulate import Simulated, SimulationSpec, simulated
from turnscan.surface.holes import ClosingOptions, close
from turnscan.workflows._demo_report import DemoFrame, demo_pictures, demo_report
from turnscan.workflows._files._writing import write_atomically
from turnscan.workflows._options._demo import DemoOptions
from turnscan.workflows._pages._png import write_png
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file, truth
from turnscan.workflows._surface._quality_map import quality_line, sigmas
from turnscan.workflows._surface._report import about, summary
from turnscan.workflows._surface._saving import save


@dataclass(frozen=True)
class Demonstration:
    """What a demo has written, and how near the truth it came."""

    folder: Path
    files: tuple[Path, ...]
    summary: tuple[str, ...]
    """The surface in words, one line each."""
    deviation: Deviation
    """Of each measured vertex from the true surface; nothing was fitted or aligned."""
    sigma: Floats
    """(v,) mm: what the surface says of each vertex by itself."""
    seconds: tuple[tuple[str, float], ...]
    """How long each part of the work took."""

    def lines(self) -> list[str]:
        """The same in words."""
        d = self.deviation
        return [
            *(f"{what}: {seconds:.1f} s" for what, seconds in self.seconds),
            *self.summary,
            "deviation from the true shape, measured with the true rig: "
            f"mean {d.mean:+.3f} mm, rms {d.rms:.3f} mm, 95 % within {d.quantile(0.95):.3f} mm, "
            f"worst {np.abs(d.distance).max():.3f} mm",
            quality_line(self.sigma, d.distance),
            *(f"{path}: {path.stat().st_size / 1e6:.2f} MB" for path in self.files),
        ]


class _Clock:
    """How long each part of the work took."""

    def __init__(self) -> None:
        self._at = time.perf_counter()
        self.laps: list[tuple[str, float]] = []

    def lap(self, what: str) -> None:
        """Note the time since the last lap, under this name."""
        now = time.perf_counter()
        self.laps.append((what, now - self._at))
        self._at = now


def demo(
    output: str | Path = "demo-output",
    options: DemoOptions | None = None,
    progress: Progress = no_progress,
) -> Demonstration:
    """Do the main job from end to end, without hardware.

    A simulated rig photographs the part, the scan file is reconstructed like any other, and the
    result is compared with the true shape, which only a simulation knows.

    Parameters
    ----------
    output
        Folder to write to; files of an earlier demo in it are replaced.
    options
        The part and the rig; None takes a cup and the paper's rig.
    progress
        Told how far it is; it may cancel.

    Returns
    -------
    Demonstration
        The files, and how near the truth the surface came.

    Raises
    ------
    InputError
        Where the folder cannot be made, or nothing was measured.
    ExportError
        Where a file cannot be written.
    """
    clock, output = _Clock(), Path(output)
    o = options or DemoOptions()
    devices = simulated(SimulationSpec(scene=o.scene, rig=o.rig, steps=o.steps, seed=o.seed))
    rig = devices.world.bench.rig
    name = devices.world.bench.scene.bodies[0].part.name
    _make(output)
    plan = plan_of(devices)
    clock.lap("preparing")
    path = output / f"{name}.turnscan"
    scan_into_file(devices, plan, path, "sparse", progress.subrange(0, 0.6, "scanning"))
    clock.lap(f"scanning {plan.steps} steps × {', '.join(plan.lasers)}")
    settings = Settings()
    with Scan.open(path) as scan:
        tick = progress.subrange(0.6, 0.8, "reconstructing").counter(len(scan))
        done = reconstruct(scan, None, settings, tick)
        frames = [_frame(scan, devices, laser) for laser in plan.lasers]
    if not len(done.mesh.faces):
        raise InputError(f"{path}: nothing was measured", hint="take another scene or rig")
    closed, closing = close(done.mesh, ClosingOptions())
    clock.lap("reconstructing")
    progress(0.8, "writing DXF, STL and PLY")
    results = {output / f"{name}.{suffix}": closed for suffix in ("dxf", "stl", "ply")}
    save(results, ExportOptions(about=about(path, rig, settings)))
    write_atomically(output / "rig.json", rig_to_json(rig).encode())
    write_png(output / "frame.png", frames[0].picture)
    clock.lap("writing DXF, STL and PLY, each read back")
    progress(0.9, "comparing with the true shape")
    found = deviation(done.mesh.vertices, truth(devices))
    sigma = sigmas(done.mesh)
    told, pictures = quality_line(sigma, found.distance), demo_pictures(done, found, frames)
    text = demo_report(devices, done, closed, closing, found, told, pictures, frames, clock.laps)
    write_atomically(output / "report.html", text.encode())
    for picture, data in pictures.files().items():
        write_atomically(output / f"{picture}.png", data)
    clock.lap("comparing with the true shape, report")
    files = tuple(sorted(p for p in output.iterdir() if p.is_file()))
    surface = tuple(summary(done, rig))
    return Demonstration(output, files, surface, found, sigma, tuple(clock.laps))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"{folder}: {e.strerror}", hint="name another folder") from None


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

"""Precompile: the kernels that a scan and its surface need are compiled before the first one."""

from __future__ import annotations

import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from turnscan import points
from turnscan.arrays import Floats
from turnscan.compiled import is_first_run, kept_in, note_compiled, state_of_sources, was_compiled
from turnscan.detection import Detection, View
from turnscan.errors import ExportError
from turnscan.formats import export
from turnscan.gridding import to_grids
from turnscan.memory import seldom_look_for_garbage
from turnscan.meshing import to_mesh
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scan import Scan, ScanPlan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import SimulationSpec, bench
from turnscan.stripes import Stripe, Stripes
from turnscan.surface.holes import ClosingOptions
from turnscan.workflows._compile_ahead import SURFACES, CompileJob
from turnscan.workflows._demo import demo
from turnscan.workflows._importing._pictures import import_pictures
from turnscan.workflows._options._demo import DemoOptions
from turnscan.workflows._options._import import EvenSteps
from turnscan.workflows._pages._png import write_png
from turnscan.workflows._surface._reconstruct import reconstruct

_STEPS = 24
_RADIUS, _LOW, _HIGH = 20.0, 5.0, 45.0
"""mm: a column that stands in the middle of the rig's volume."""
_BLUR, _BRIGHT, _GROUND = 2.0, 160.0, 12.0
"""px, grey levels: its stripe in colour pictures, and what these show without it."""


def precompile(progress: Progress = no_progress) -> None:
    """Compile the kernels of a scan and of its surface, in three processes at a time.

    One does a short demo. Another begins with points and surfaces, on made-up stripes of a
    column, so that what the demo comes to last is compiled when it gets there. The third imports
    colour pictures of two lasers: the light of a colour is found in wider numbers than that of
    grey pictures. A part that was compiled from the same sources is left out, and kernels whose
    machine code is there take no time; where it lies is said in `turnscan.compiled`. What other
    verbs need beyond that is compiled when it is used.

    Parameters
    ----------
    progress
        Told when one of them is done; it may cancel between them.

    Raises
    ------
    ExportError
        Where machine code can be kept in no folder, or one of the processes failed.
    """
    if kept_in() is None:
        raise ExportError(
            "machine code can be kept in no folder, beside turnscan or in the user's cache",
            hint="name a folder that can be written in the environment variable NUMBA_CACHE_DIR",
        )
    is_first_run()  # of all there are: none of them has more compiled ahead
    state = state_of_sources()
    with ExitStack() as stack:
        wanted = [part for part in _PARTS if not was_compiled(part, state)]
        # Of its own, as a pool of processes would run a caller's script again.
        jobs = {part: stack.enter_context(CompileJob(part)) for part in wanted}
        for done, (part, job) in enumerate(jobs.items(), 1):
            job.wait()
            note_compiled(part, state)
            progress(done / len(jobs), "compiling")


def _pictures() -> None:
    with tempfile.TemporaryDirectory() as folder:
        demo(folder, DemoOptions(steps=_STEPS))


def _surfaces() -> None:
    rig = bench(SimulationSpec("cup", "paper", lasers=1)).rig
    settings = Settings(caps=ClosingOptions())
    camera, laser = rig.camera, rig.sheets[0].name
    with tempfile.TemporaryDirectory() as folder:
        plan = ScanPlan(camera.width, camera.height, "uint8", 1, (laser,), _STEPS, 20.0)
        with Scan.create(Path(folder) / "column.turnscan", plan, rig) as scan:
            inside = np.ones((camera.height, camera.width), dtype=np.bool_)
            volume = points.working_volume(rig, laser)
            view = View(scan, rig, laser, laser, volume, settings.stripes, inside)
            grids = to_grids([Detection(view, _column(rig, laser), ())], settings).grids
    done = to_mesh(grids, settings, rig=rig)
    deviation(done.opened.vertices, done.opened)
    for suffix in (".dxf", ".stl", ".ply"):
        export(done.mesh, suffix)


def _colours() -> None:
    rig = bench(SimulationSpec("cup", "paper", lasers=2)).rig
    with tempfile.TemporaryDirectory() as folder:
        lit = {sheet.name: Path(folder, sheet.name) for sheet in rig.sheets}
        for laser, place in lit.items():
            place.mkdir()
            _photograph(place, _column_at(rig, laser), rig.camera.width)
        scan = import_pictures(
            {laser: str(place) for laser, place in lit.items()},
            Path(folder, "column.turnscan"),
            EvenSteps(360.0 / _STEPS),
            rig=rig,
        )
        reconstruct(scan).save_report(Path(folder, "column.html"))


def _photograph(folder: Path, position: Floats, width: int) -> None:
    """Colour pictures of a red stripe at ``position`` px in each row, one for each step."""
    light = _BRIGHT * np.exp(-0.5 * ((np.arange(width) - position[:, None]) / _BLUR) ** 2)
    noise = np.random.default_rng(1)
    for step in range(_STEPS):
        picture = noise.normal(_GROUND, 1.0, (*light.shape, 3))
        picture[..., 0] += np.nan_to_num(light)
        write_png(folder / f"{step}.png", picture.clip(0, 255).astype(np.uint8))


def _column(rig: Rig, laser: str) -> Stripes:
    """The stripes of an upright column on the axis, in a whole turn."""
    position = _column_at(rig, laser)

    def all_along(value: float) -> Floats:
        return np.where(np.isnan(position), np.nan, value)

    flags = np.zeros(len(position), dtype=np.uint16)
    stripe = Stripe(position, all_along(0.05), all_along(120.0), all_along(2.0), flags)
    angles = np.linspace(0.0, 2 * np.pi, _STEPS, endpoint=False)
    return Stripes(laser, tuple(range(_STEPS)), angles, (stripe,) * _STEPS)


def _column_at(rig: Rig, laser: str) -> Floats:
    """Where a laser's stripe lies on an upright column in each row (H,), px."""
    T = rig.T_camera_table.inverse()
    out = np.cross(T.turn(rig.sheet(laser).normal), (0.0, 0.0, 1.0))
    out *= np.copysign(_RADIUS, out @ T.translation) / np.hypot(out[0], out[1])
    z = np.linspace(_LOW, _HIGH, 400)
    line = np.stack([np.full(len(z), out[0]), np.full(len(z), out[1]), z], axis=-1)
    u, v = rig.camera.project(rig.T_camera_table.apply(line)).T
    order = np.argsort(v)
    lines = np.arange(rig.camera.height, dtype=np.float64)
    position: Floats = np.interp(lines, v[order], u[order], left=np.nan, right=np.nan)
    return position


_PARTS = {"pictures": _pictures, SURFACES: _surfaces, "colours": _colours}

if __name__ == "__main__":
    seldom_look_for_garbage()
    _PARTS[sys.argv[1]]()

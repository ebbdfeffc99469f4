"""A long scan of a large sensor, sparse: what each stage costs, and what it is made of.

1 600 frames of 5 megapixels, lit and dark, stored by the writer of scan files; the part is a vase
with lobes, so that the stripe wanders. ``--quick``: 200 frames. Besides, 320 frames of 640 pixels
across, as a webcam takes. Processor time counts both cores; ratios hold on a busy machine too.
"""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numba.core.event import install_recorder  # noqa: TID251 (it listens to the compiler)

from turnscan.detection import detect_scan
from turnscan.gridding import to_grids
from turnscan.mesh import soundness
from turnscan.meshing import to_mesh
from turnscan.rig import Camera, LaserSheet, Pose, Rig
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.settings import Settings

STEPS, QUICK = 1600, 200
WIDTH, HEIGHT = 2448, 2048
DISTANCE, LIFT, ELEVATION, THETA = 490.0, 34.0, 0.2, 0.45
LOW, HIGH = 8.0, 62.0
"""mm: the part's lower and upper rim; some 750 rows of the picture."""
WARM = 120
"""Frames of the scan that has the kernels compiled before the time is taken."""
WANTED_WALL, WANTED_PEAK, WANTED_RATE = 8.0, 900.0, 2.0
"""s and MB of 1 600 frames on two cores, GB of stored pictures a second and core …"""
WANTED_SOUND, WANTED_FACES = 1.5, 2_400_000
"""… and s for the soundness of so many faces."""
SMALL, SMALL_SCALE, WANTED_SMALL = 320, 640 / WIDTH, 0.7
"""Frames of a small sensor, its part of the large one, and s for them to a mesh."""
GRAINS = 4
"""Pictures of noise that the frames take turns with, each shifted."""


def make_rig(scale: float = 1.0) -> Rig:
    """A camera above the platter looking down at the axis, and one upright sheet through it.

    ``scale`` is the size of its pictures, as a share of that of 5 megapixels.
    """
    c, s = np.cos(ELEVATION), np.sin(ELEVATION)
    R = np.array([[0, 1, 0], [s, 0, -c], [-c, 0, -s]], dtype=np.float64)
    eye = np.array([DISTANCE * c, 0.0, LIFT + DISTANCE * s])
    T = Pose(R, -R @ eye)
    normal = T.turn([-np.sin(THETA), np.cos(THETA), 0.0])
    sheet = LaserSheet("laser", normal, T.apply([0.0, 0.0, LIFT]))
    lens = np.array([-0.1, 0.02, 0.001, -0.001, 0.0])
    width, height, focal = round(WIDTH * scale), round(HEIGHT * scale), 6900 * scale
    camera = Camera(width, height, focal, focal, width / 2, height / 2, lens)
    return Rig(camera, (sheet,), T)


def radius(phi: float, z: np.ndarray) -> np.ndarray:
    """mm: the vase at an angle and at heights."""
    waist = 34.0 + 5.0 * np.sin(z / 9.0)
    return np.asarray(waist + 2.5 * np.cos(3 * phi + z / 20.0) + 0.3 * np.cos(17 * phi))


def columns(rig: Rig, angle: float) -> np.ndarray:
    """Column of the stripe in each row, NaN beside it."""
    z = np.linspace(LOW, HIGH, 1500)
    r = radius(THETA - angle, z)
    points = np.stack([r * np.cos(THETA), r * np.sin(THETA), z], axis=-1)
    u, v = rig.camera.project(rig.T_camera_table.apply(points)).T
    order = np.argsort(v)
    rows = np.arange(rig.camera.height, dtype=np.float64)
    column: np.ndarray = np.interp(rows, v[order], u[order], left=np.nan, right=np.nan)
    return column


def pictures(rig: Rig, frames: int) -> Iterator[Frame]:
    """The frames of a turn, with noise in each, made one after the other."""
    width, height = rig.camera.width, rig.camera.height
    rng = np.random.default_rng(0)
    noise = rng.normal(8.0, 1.0, (GRAINS, height, width)).clip(0, 255).astype(np.uint8)
    away = np.arange(-12, 13)
    for k in range(frames):
        angle = k * 2 * np.pi / frames
        at = columns(rig, angle)
        rows = np.flatnonzero(~np.isnan(at))
        lit = np.roll(noise[k % GRAINS], 31 * k)
        dark = np.roll(noise[(k + 1) % GRAINS], -17 * k)
        pixel = np.rint(at[rows]).astype(np.intp)[:, None] + away
        light = 180.0 * np.exp(-0.5 * ((pixel - at[rows, None]) / 1.8) ** 2)
        there = (rows[:, None], pixel)
        lit[there] = np.clip(lit[there] + light, 0, 255).astype(np.uint8)
        yield Frame(k, "laser", lit, dark, commanded=angle)


def plan_of(rig: Rig, frames: int) -> ScanPlan:
    """The plan of a turn of `pictures`."""
    return ScanPlan(rig.camera.width, rig.camera.height, "uint8", 1, ("laser",), frames, 6.0)


def write_scan(path: Path, frames: int, scale: float = 1.0) -> None:
    """A scan file of `pictures`."""
    rig = make_rig(scale)
    with Scan.create(path, plan_of(rig, frames), rig) as scan:
        for frame in pictures(rig, frames):
            scan.add(frame)


@dataclass
class Cost:
    """What a stage took."""

    name: str
    wall: float = 0.0
    """s."""
    processor: float = 0.0
    """s, of all cores."""
    peak: float = 0.0
    """MB of memory held at the highest point."""


@dataclass
class Ledger:
    """The stages of one run, in their order."""

    costs: list[Cost] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure what is done within."""
        _forget_peak()
        cost = Cost(name)
        wall, processor = time.perf_counter(), _processor()
        yield
        cost.wall, cost.processor = time.perf_counter() - wall, _processor() - processor
        cost.peak = _peak()
        self.costs.append(cost)


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _forget_peak() -> None:
    """Linux: the highest memory is counted anew from here."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _peak() -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return next(int(line.split()[1]) / 1e3 for line in lines if line.startswith("VmHWM"))


def measure(path: Path, warm: Path, scale: float = 1.0) -> tuple[list[Cost], int, float]:
    """Stages of a reconstruction, faces of its mesh, and s of processor to read the file alone.

    Raises RuntimeError where a kernel had to be compiled in a stage: ``warm`` did not need it.
    """
    settings, rig = Settings(), make_rig(scale)
    with Scan.open(warm) as scan:  # compiles, or loads what is compiled
        grids, _, _ = to_grids(detect_scan(scan, rig, settings.stripes), settings)
        to_mesh(grids, settings, rig=rig)
    books = Ledger()
    with install_recorder("numba:compile") as compiled:
        faces, reading = _staged(path, rig, settings, books)
    if compiled.buffer:
        names = {event.data["dispatcher"].py_func.__name__ for _, event in compiled.buffer}
        raise RuntimeError(f"compiled while the time was taken: {', '.join(sorted(names))}")
    return books.costs, faces, reading


def _staged(path: Path, rig: Rig, settings: Settings, books: Ledger) -> tuple[int, float]:
    start = _processor()
    path.read_bytes()
    reading = _processor() - start
    with books.stage("open"):
        scan = Scan.open(path)
    with scan:
        with books.stage("stripes"):
            seen = detect_scan(scan, rig, settings.stripes)
        with books.stage("grids"):
            grids, _, _ = to_grids(seen, settings)
        del seen
        with books.stage("mesh"):
            mesh = to_mesh(grids, settings, rig=rig).mesh
    wall, used = time.perf_counter(), _processor()
    soundness(mesh)
    wall, used = time.perf_counter() - wall, _processor() - used
    print(
        f"soundness of {len(mesh.faces)} faces, once more: {wall:.2f} s, {used:.2f} s of processor "
        f"(wanted of {WANTED_FACES} on two cores: {WANTED_SOUND} s)",
        flush=True,
    )
    return len(mesh.faces), reading


def measured_apart(path: Path, warm: Path, scale: float = 1.0) -> tuple[list[Cost], int, float]:
    """What `measure` says, in a process of its own, whose memory nothing else has filled."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, path, warm, scale).result()


def report(path: Path, warm: Path, frames: int) -> None:
    """Measure in a process of its own, and print."""
    costs, faces, reading = measured_apart(path, warm)
    wall, used = sum(c.wall for c in costs), sum(c.processor for c in costs)
    print(
        f"{frames} frames of {WIDTH}×{HEIGHT} lit and dark, file of "
        f"{path.stat().st_size / 1e6:.0f} MB → {faces} faces"
    )
    print(f"{'stage':<10}{'wall s':>9}{'cpu s':>9}{'ms/frame':>10}{'share':>8}{'peak MB':>9}")
    for c in costs:
        each = 1e3 * c.processor / frames
        share = c.processor / used
        print(f"{c.name:<10}{c.wall:9.2f}{c.processor:9.2f}{each:10.2f}{share:8.0%}{c.peak:9.0f}")
    peak = max(c.peak for c in costs)
    print(f"{'all':<10}{wall:9.2f}{used:9.2f}{1e3 * used / frames:10.2f}{1:8.0%}{peak:9.0f}")
    if frames == STEPS:
        print(f"wanted on two cores: {WANTED_WALL:.0f} s, {WANTED_PEAK:.0f} MB")
    stored = 2.0 * WIDTH * HEIGHT * frames / costs[1].processor
    print(
        f"stripes: {stored / 1e9:.1f} GB of pictures a second and core "
        f"(wanted: {WANTED_RATE:.0f}); all takes "
        f"{used / reading:.0f} × the processor time of reading the file"
    )


def run(quick: bool = False) -> None:
    """Print what each stage costs."""
    frames = QUICK if quick else STEPS
    with tempfile.TemporaryDirectory() as folder:
        path, warm = Path(folder) / "vase.turnscan", Path(folder) / "warm.turnscan"
        write_scan(warm, WARM)
        write_scan(path, frames)
        report(path, warm, frames)
        path, warm = Path(folder) / "small.turnscan", Path(folder) / "small-warm.turnscan"
        write_scan(warm, WARM, SMALL_SCALE)
        write_scan(path, SMALL, SMALL_SCALE)
        costs, faces, _ = measured_apart(path, warm, SMALL_SCALE)
        wall, used = sum(c.wall for c in costs), sum(c.processor for c in costs)
        print(
            f"{SMALL} frames of {WIDTH * SMALL_SCALE:.0f}×{HEIGHT * SMALL_SCALE:.0f} → {faces} "
            f"faces: {wall:.2f} s, {used:.2f} s of processor (wanted: {WANTED_SMALL} s)"
        )


if __name__ == "__main__":
    run()

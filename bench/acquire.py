"""Storing during a scan: milliseconds a frame, size of the file, what the table does meanwhile."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.scale import make_rig, pictures, plan_of
from turnscan import acquire
from turnscan.acquire import Hardware, look, turn_of
from turnscan.arrays import Image
from turnscan.scan import Frame, Scan

STEPS = 400
WIDTH, HEIGHT = 640, 480
MOVE = 0.02
"""s of a move; real tables take longer."""
VIEWS = 8
LARGE, WANTED = 60, 5.0
"""Frames of 5 megapixels, and ms of the processor that are wanted for one, lit and dark."""


class _Rig:
    """Two lasers on a wavy surface, sensor noise of 1.5 grey levels; pictures are made before."""

    names = ("left", "right")

    def __init__(self) -> None:
        rng = np.random.default_rng(1)
        v, u = np.mgrid[:HEIGHT, :WIDTH]
        self.lit: frozenset[str] = frozenset()
        self.moves: list[tuple[float, float]] = []
        self._shot = 0
        self._pictures: dict[str, list[Image]] = {}
        for name, side in (("", 0), ("left", -1), ("right", 1)):
            made: list[Image] = []
            for k in range(VIEWS):
                light = rng.normal(12.0, 1.5, (HEIGHT, WIDTH))
                if side:
                    centre = 320 + side * (60 + 40 * np.sin(v / 60 + k))
                    on = (v > 40) & (v < 440)
                    light += on * 140.0 * np.exp(-((u - centre) ** 2) / 2 / 1.6**2)
                made.append(np.clip(np.rint(light), 0, 255).astype(np.uint8))
            self._pictures[name] = made

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return seconds, gain

    def grab(self, timeout: float) -> Image:
        self._shot += 1
        return self._pictures["".join(self.lit)][self._shot % VIEWS]

    def move_to(self, angle: float, timeout: float) -> float:
        began = time.perf_counter()
        time.sleep(MOVE)
        self.moves.append((began, time.perf_counter()))
        return angle

    def stop(self) -> None:
        pass

    def light(self, lit: frozenset[str], lease: float) -> None:
        self.lit = lit

    def renew(self, lease: float) -> None:
        pass

    def off(self) -> None:
        self.lit = frozenset()


@dataclass(frozen=True)
class CalibrationQuality:
    """Of one scan."""

    stored: list[float]
    """s to store each frame, until it is on the disk."""
    worked: list[float]
    """s of the processor in that."""
    size: int
    """Bytes of the file."""
    overlapped: int
    """Moves during which a frame was being packed or stored."""
    seconds: float


def scan(folder: Path, steps: int = STEPS) -> CalibrationQuality:
    """One scan into a new file in this folder."""
    rig = _Rig()
    hardware = Hardware(rig, rig, rig)
    plan = turn_of(steps, rig.names, 0.01)
    first = look(plan, hardware)
    stored: list[tuple[float, float]] = []
    worked: list[float] = []
    path = folder / "bench.turnscan"
    with Scan.create(path, first.scan_plan) as opened:
        add = opened.add

        def timed(frame: Frame) -> float:
            began, busy = time.perf_counter(), time.thread_time()
            share = add(frame)
            stored.append((began, time.perf_counter()))
            worked.append(time.thread_time() - busy)
            return share

        opened.add = timed  # type: ignore[method-assign]
        began = time.perf_counter()
        acquire.run(plan, hardware, opened, first=first)
        took = time.perf_counter() - began
    overlapped = sum(any(a < end and start < b for a, b in stored) for start, end in rig.moves[2:])
    seconds = [b - a for a, b in stored]
    return CalibrationQuality(seconds, worked, path.stat().st_size, overlapped, took)


def store_large(folder: Path, frames: int = LARGE) -> tuple[list[float], list[float]]:
    """s of the processor, of all threads, and s on the clock for each frame of 5 megapixels, lit
    and dark, until it is on the disk; the first, which loads what is compiled, is left out."""
    rig = make_rig()
    worked, waited = list[float](), list[float]()
    with Scan.create(folder / "large.turnscan", plan_of(rig, frames), rig) as opened:
        for frame in pictures(rig, frames):
            began, busy = time.perf_counter(), time.process_time()
            opened.add(frame)
            worked.append(time.process_time() - busy)
            waited.append(time.perf_counter() - began)
    return worked[1:], waited[1:]


def run() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as folder:
        cpu, ms = (1e3 * np.array(times) for times in store_large(Path(folder)))
    print(
        f"storing a frame of 5 megapixels, lit and dark, until it is on the disk: median "
        f"{np.median(cpu):.2f} ms of the processor (wanted: {WANTED:.0f}), {np.median(ms):.2f} ms"
    )
    with tempfile.TemporaryDirectory() as folder:
        found = scan(Path(folder))
    ms, cpu = 1e3 * np.array(found.stored), 1e3 * np.array(found.worked)
    print(f"{STEPS} steps, 2 lasers, {WIDTH}×{HEIGHT}, dark pictures of their own, noise 1.5:")
    print(
        f"  storing a frame, until it is on the disk: median {np.median(ms):.2f} ms, "
        f"99 % {np.quantile(ms, 0.99):.2f} ms; of the processor {np.median(cpu):.2f} ms"
    )
    print(f"  file: {found.size / 1e6:.1f} MB")
    print(f"  moves during which a frame was packed or stored: {found.overlapped} of {STEPS - 1}")
    print(
        f"  the scan took {found.seconds:.1f} s; moves {MOVE * STEPS:.1f} s, "
        f"storing {ms.sum() / 1e3:.1f} s"
    )


if __name__ == "__main__":
    run()

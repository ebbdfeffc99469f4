"""A batch: how much faster with two workers than with one, and its memory over 1 000 scans.

``python -m bench batch [workers] [many]``. Every scan is the same simulated one under another name,
so that the work is equal; each worker has one thread. The results are compared with those of a
single run, byte for byte. ``many``: tiny scans, and the memory that the batch's processes hold.
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from turnscan import workflows
from turnscan.progress import Progress, no_progress
from turnscan.threads import VARIABLE

PARTS = ("workers", "many")
SCANS, QUICK, QUICK_STEPS = 32, 8, 100
WANTED = 1.85
MANY, QUICK_MANY, TINY = 1000, 300, 8


def _batch(
    folder: Path, scan: Path, scans: int, workers: int, progress: Progress = no_progress
) -> tuple[float, workflows.Batch]:
    """s on the clock, and the batch of so many copies of a scan; they are checked."""
    recipe = workflows.Recipe(formats=("stl",), report=False)
    workflows.reconstruct(scan).save(folder / "single.stl")
    single = (folder / "single.stl").read_bytes()
    source = folder / f"{scans}"
    source.mkdir(exist_ok=True)
    for k in range(scans):
        (source / f"part{k:04d}.turnscan").write_bytes(scan.read_bytes())
    begin = time.perf_counter()
    done = workflows.batch(
        [source], recipe, folder / f"{scans}by{workers}", workers=workers, progress=progress
    )
    took = time.perf_counter() - begin
    for k, outcome in enumerate(done.outcomes):
        made = Path(done.folder) / outcome.folder / f"part{k:04d}.stl"
        assert made.read_bytes() == single, f"{made}: not the result of a single run"
    return took, done


def _workers(folder: Path, quick: bool) -> None:
    scans, scan = QUICK if quick else SCANS, folder / "part.turnscan"
    spec = workflows.SimulateOptions(steps=QUICK_STEPS) if quick else workflows.SimulateOptions()
    workflows.simulate("cup", scan, spec)
    _batch(folder, scan, 1, 1)  # compiles sources and kernels, or reads what is compiled
    times, used = {}, {}
    for workers in (1, 2):
        before = _processor()
        times[workers], _ = _batch(folder, scan, scans, workers)
        used[workers] = _processor() - before
        took = f"{times[workers]:.1f} s, {used[workers]:.1f} s of their processors"
        print(f"{scans} simulated scans, {workers} workers: {took}")
    print(
        f"two workers are {times[1] / times[2]:.2f} × as fast as one (wanted: {WANTED}); "
        f"{2 * used[1] / used[2]:.2f} × by the time of their processors, whatever else these did"
    )


def _processor() -> float:
    """s of all workers that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def held() -> float:
    """MB that this process and all that it started hold; NaN where the system does not say."""
    total, waiting = 0.0, [(os.getpid(), b"")]
    try:
        while waiting:
            pid, parent = waiting.pop()
            place = Path(f"/proc/{pid}")
            words = (place / "cmdline").read_bytes()
            if words == parent:  # it begins just now, and shares the memory of what starts it
                continue
            total += _own(place)
            for task in (place / "task").iterdir():
                waiting += [(int(x), words) for x in (task / "children").read_text().split()]
    except OSError:  # one of them ended just now
        return float("nan")
    return total


def _own(place: Path) -> float:
    """MB that a process holds, by its folder in /proc."""
    lines = (place / "status").read_text().splitlines()
    return sum(int(x.split()[1]) for x in lines if x.startswith("RssAnon")) / 1e3


def _many(folder: Path, quick: bool) -> None:
    scans, scan = QUICK_MANY if quick else MANY, folder / "tiny.turnscan"
    workflows.simulate("sphere", scan, workflows.SimulateOptions(steps=TINY))
    memory: list[float] = []
    alone: list[float] = []

    def look(_: float, __: str) -> None:
        memory.append(held())
        alone.append(_own(Path("/proc/self")))

    took, _ = _batch(folder, scan, scans, 2, Progress(look))
    print(f"{scans} scans of {TINY} steps, 2 workers: {took:.1f} s")
    for k, some in enumerate(np.array_split(memory, 4)):
        print(f"MB held in quarter {k + 1}: median {np.nanmedian(some):.0f}, {np.nanmax(some):.0f}")
    print(f"MB of the batch's own process: {alone[0]:.0f} at first, {alone[-1]:.0f} at the end")
    # What the first quarter adds is what any first scan loads.
    done = np.linspace(0.0, scans, len(memory))
    late = (done > scans / 4) & np.isfinite(memory)
    slope = np.polyfit(done[late], np.asarray(memory)[late], 1)[0]
    print(f"after the first quarter {1000 * slope:+.0f} MB per 1000 scans (wanted: none)")


def run(quick: bool = False, parts: Sequence[str] = ()) -> None:
    """Print times, their ratio and memory; ``quick`` takes fewer scans and steps."""
    # Where this is set, each worker compiles the sources of all libraries anew.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ[VARIABLE] = "1"
    with tempfile.TemporaryDirectory() as folder:
        for part in parts or PARTS:
            {"workers": _workers, "many": _many}[part](Path(folder), quick)
    del os.environ[VARIABLE]

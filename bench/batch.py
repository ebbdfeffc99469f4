"""``python -m bench batch``: how much faster a batch is with two workers than with one.

Every scan is the same small one under another name, so that the work is equal; each worker has one
thread. The results are compared with those of a single run, byte for byte.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from turnscan import workflows
from turnscan.threads import VARIABLE

SCANS, QUICK, STEPS = 32, 8, 100
WANTED = 1.85


def _seconds(folder: Path, workers: int) -> tuple[float, workflows.Batch]:
    recipe = workflows.Recipe(formats=("stl",), report=False)
    begin = time.perf_counter()
    done = workflows.batch([folder / "scans"], recipe, folder / f"by{workers}", workers=workers)
    return time.perf_counter() - begin, done


def run(quick: bool = False) -> None:
    """Print the two times and their ratio; ``quick`` takes fewer scans."""
    scans = QUICK if quick else SCANS
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "scans").mkdir()
        first = folder / "scans" / "part00.turnscan"
        workflows.simulate("cup", first, workflows.SimulateOptions(steps=STEPS))
        for k in range(1, scans):
            (folder / "scans" / f"part{k:02d}.turnscan").write_bytes(first.read_bytes())
        workflows.reconstruct(first).save(folder / "single.stl")
        single = (folder / "single.stl").read_bytes()
        times = {}
        os.environ[VARIABLE] = "1"
        for workers in (1, 2):
            times[workers], done = _seconds(folder, workers)
            for k, outcome in enumerate(done.outcomes):
                made = Path(done.folder) / outcome.folder / f"part{k:02d}.stl"
                assert made.read_bytes() == single, f"{made}: not the result of a single run"
            print(f"{scans} scans of {STEPS} steps, {workers} workers: {times[workers]:.1f} s")
        del os.environ[VARIABLE]
    print(f"two workers are {times[1] / times[2]:.2f} × as fast as one (wanted: {WANTED})")

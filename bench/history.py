"""Speed over time: a file for each machine and commit, and what became slower than its noise.

``python -m bench history`` measures, keeps the figures in ``build/bench/MACHINE/COMMIT.json`` and
compares them with those of the commit measured before on this machine. ``python -m bench history
OLD [NEW]`` compares two that are kept; NEW is the newest where it is not named. Sources that were
changed since have a ``+`` at the commit's name. ``--quick``: fewer rounds.

A figure is processor time of all threads, as a multiple of what a fixed piece of NumPy takes just
before and just after: it holds on a busy machine, too. Each round takes every case once, so that
all share what the machine does otherwise.
"""

from __future__ import annotations

import json
import os
import platform
import re
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from bench import reconstruct, stripes, surface
from bench._commit import commit
from turnscan.detection import detect_scan
from turnscan.formats import export
from turnscan.gridding import to_grids
from turnscan.mesh import soundness
from turnscan.meshing import to_mesh
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.simulate import Renderer, SimulationSpec, bench, seconds_of
from turnscan.stripes import StripeSettings, detect
from turnscan.surface import mesh_grid
from turnscan.surface.decimation import decimate

PLACE = Path(__file__).parents[1] / "build" / "bench"
PARTS = None
"""Any words may follow: names of commits."""
ROUNDS, QUICK = 15, 5
LEAST = 1.05
"""Changes below this are not named: the same sources differ by it from process to process."""
SIGNIFICANT = 3.0
"""Standard errors from which a difference is none of chance."""


@dataclass(frozen=True)
class Kept:
    """What was measured at one commit on one machine."""

    commit: str
    machine: str
    taken: str
    """Date and time, UTC."""
    ratios: Mapping[str, Sequence[float]]
    """Of each case, one a round: processor time as a multiple of the yardstick's."""


@dataclass(frozen=True)
class Change:
    """How a case differs between two commits."""

    case: str
    factor: float
    """Time of the new one as a multiple of the old one's."""
    noise: float
    """Standard error of the factor's logarithm."""

    @property
    def word(self) -> str:
        """What is to be said about it; empty where it is within its noise."""
        if abs(np.log(self.factor)) <= max(SIGNIFICANT * self.noise, np.log(LEAST)):
            return ""
        return "slower" if self.factor > 1.0 else "faster"


def changes(old: Kept, new: Kept) -> list[Change]:
    """The cases that both have, the one that became slowest first."""
    found = []
    for case in old.ratios.keys() & new.ratios.keys():
        (before, unsure), (now, also) = _middle(old.ratios[case]), _middle(new.ratios[case])
        found.append(Change(case, float(np.exp(now - before)), float(np.hypot(unsure, also))))
    return sorted(found, key=lambda change: (-change.factor, change.case))


def _middle(ratios: Sequence[float]) -> tuple[float, float]:
    """Median of the logarithms, and its standard error (of a Gaussian's median, by the MAD)."""
    logs = np.log(ratios)
    middle = np.median(logs)
    spread = 1.4826 * np.median(np.abs(logs - middle))
    return float(middle), float(1.2533 * spread / len(logs) ** 0.5)


def yardstick() -> None:
    """Fixed work of one thread: sorting, arithmetic and copies, in and beyond the caches."""
    rng = np.random.default_rng(0)
    numbers = rng.random(400_000)
    np.sort(numbers)
    for _ in range(10):
        numbers = np.sqrt(numbers * numbers + 1.0)
    large = np.zeros(2_000_000)
    for _ in range(5):
        large = large + 1.0


def _cases(folder: Path, stack: ExitStack) -> dict[str, Callable[[], object]]:
    """A small piece of each stage; every one is deterministic."""
    settings, path = Settings(), folder / "ball.turnscan"
    reconstruct.write_scan(path)
    scan = stack.enter_context(Scan.open(path))
    rig = scan.rig
    assert rig is not None
    seen = detect_scan(scan, rig, settings.stripes)
    grids = to_grids(seen, settings).grids
    mesh = to_mesh(grids, settings, rig=rig).mesh
    lit, dark, _ = stripes.scene(480, 640)
    column = mesh_grid(surface.grid(120, 140, 0))
    spec = SimulationSpec("cup", "paper", lasers=1)
    renderer, exposure = Renderer(bench(spec)), seconds_of(spec)
    angles = iter(np.arange(0.0, 6.0, 0.01))
    look = StripeSettings()
    return {
        "stripes from a sparse file": lambda: detect_scan(scan, rig, settings.stripes),
        "stripes from pictures": lambda: [detect(lit, dark, look) for _ in range(40)],
        "range grids": lambda: to_grids(seen, settings),
        "mesh": lambda: to_mesh(grids, settings, rig=rig),
        "soundness": lambda: soundness(mesh),
        "decimation": lambda: decimate(column, faces=10_000),
        "simulated picture": lambda: renderer.picture(next(angles), ["right"], exposure),
        "DXF": partial(export, mesh, ".dxf"),
        "STL": partial(export, mesh, ".stl"),
    }


def _timed(job: Callable[[], object]) -> float:
    begin = time.process_time()
    job()
    return time.process_time() - begin


def measure(rounds: int) -> dict[str, list[float]]:
    """The ratios of all cases."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        cases = _cases(Path(folder), stack)
        for job in cases.values():  # compiles, or loads what is compiled
            job()
        found = {name: list[float]() for name in cases}
        for _ in range(rounds):
            before = _timed(yardstick)
            for name, job in cases.items():
                took, after = _timed(job), _timed(yardstick)
                found[name].append(2.0 * took / (before + after))
                before = after
        return found


def machine() -> str:
    """Names the kind of machine by processor and cores."""
    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(line.split(":")[1] for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return re.sub(r"\W+", "-", f"{model} {os.cpu_count()}").strip("-")


def keep(kept: Kept) -> Path:
    """Write the file of a machine and commit, in place of an older one."""
    path = PLACE / kept.machine / f"{kept.commit}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(asdict(kept), indent=1))
    return path


def kept_here() -> list[Kept]:
    """All that was measured on this kind of machine, the oldest first."""
    files = (PLACE / machine()).glob("*.json")
    return sorted((Kept(**json.loads(f.read_text())) for f in files), key=lambda k: k.taken)


def report(old: Kept, new: Kept) -> None:
    """Print how each case changed."""
    print(f"{old.commit} of {old.taken} → {new.commit} of {new.taken}, on {new.machine}")
    for change in changes(old, new):
        noise = 100.0 * SIGNIFICANT * change.noise
        said = f"{change.case:<28}{change.factor:7.3f} × the time (± {noise:.1f} %)  {change.word}"
        print(said.rstrip())


def _named(there: Sequence[Kept], word: str) -> Kept:
    found = [kept for kept in there if kept.commit.startswith(word)]
    if not found:
        names = ", ".join(kept.commit for kept in there) or "none"
        raise SystemExit(f"no figures of {word} are kept on this machine → there are {names}")
    return found[-1]


def run(quick: bool = False, parts: Sequence[str] = ()) -> None:
    """Measure, keep and compare; with names of commits compare only."""
    if len(parts) > 2:
        raise SystemExit(f"{len(parts)} commits: two are compared → name the old and the new one")
    there = kept_here()
    if parts:
        report(_named(there, parts[0]), _named(there, parts[1]) if parts[1:] else there[-1])
        return
    ratios = measure(QUICK if quick else ROUNDS)
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S")
    new = Kept(commit(), machine(), now, ratios)
    for name, found in ratios.items():
        print(f"{name:<28}{np.median(found):8.3f} × the yardstick")
    print(f"kept: {keep(new).relative_to(PLACE.parents[1])}")
    before = [kept for kept in there if kept.commit != new.commit]
    if before:
        report(before[-1], new)

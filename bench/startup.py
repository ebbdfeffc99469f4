"""Start-up: what a person waits for before turnscan does anything, and before the first surface.

Each command runs in a process of its own, which is what a person starts. Printed are seconds of
processor time (user and system, all threads) and on the clock, the best of some runs; for
``import turnscan`` also without the interpreter's own start. The first surface is measured with an
empty cache of compiled kernels (the first run on a machine, or after an update) and a filled one.
``python -m bench startup cold`` is that part alone; ``--write`` puts it into
docs/explain/sizing.md.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from bench._page import DOCS, write
from turnscan.cli import turnscan as command_line
from turnscan.workflows import SimulateOptions, simulate

PAGE = DOCS / "explain" / "sizing.md"
PARTS = ("commands", "cold")
IMPORT_LIMIT, HELP_LIMIT = 0.030, 0.3
"""s of `import turnscan`, and of `turnscan --help`, that are wanted."""
FIRST_LIMIT, DEMO_LIMIT = 8.0, 45.0
"""s on the clock that are wanted of the first surface beyond the others, and of the first demo,
after set-up."""
RUNS = 5
STEPS = 40


@dataclass(frozen=True)
class Spent:
    """What a process took, s."""

    processor: float
    clock: float

    def __str__(self) -> str:
        return f"{self.processor:.2f} s of processor, {self.clock:.2f} s on the clock"


def spent(words: list[str], runs: int = RUNS, **environment: str) -> Spent:
    """The least of both times over some runs of a program."""
    best = Spent(float("inf"), float("inf"))
    for _ in range(runs):
        before, start = os.times(), time.perf_counter()
        subprocess.run(words, env={**os.environ, **environment}, check=True, capture_output=True)
        clock, after = time.perf_counter() - start, os.times()
        used = after.children_user + after.children_system
        used -= before.children_user + before.children_system
        best = Spent(min(best.processor, used), min(best.clock, clock))
    return best


def _imports(runs: int) -> float:
    """s of processor that ``import turnscan`` takes within a running interpreter, at best."""
    code = (
        "import time; start = time.process_time(); import turnscan; "
        "print(time.process_time() - start)"
    )
    words = [sys.executable, "-c", code]
    done = [subprocess.run(words, check=True, capture_output=True, text=True) for _ in range(runs)]
    return min(float(d.stdout) for d in done)


def _first_surface(runs: int, into_pages: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        scan, cache = Path(folder) / "cup.turnscan", Path(folder) / "kernels"
        simulate("cup", scan, SimulateOptions(lasers=1, steps=STEPS))
        code = "import sys, turnscan as ts; print(ts.reconstruct(sys.argv[1]))"
        words = [sys.executable, "-c", code, str(scan)]
        cache.mkdir()
        cold = spent(words, 1, NUMBA_CACHE_DIR=str(cache))
        set_up = Path(folder) / "set-up"
        set_up.mkdir()
        program, place = [sys.executable, "-m", "turnscan"], str(set_up)
        before = spent([*program, "precompile"], 1, NUMBA_CACHE_DIR=place)
        again = spent([*program, "precompile"], 1, NUMBA_CACHE_DIR=place)
        first = spent(words, 1, NUMBA_CACHE_DIR=place)
        into = str(Path(folder) / "demo")
        demo = spent([*program, "demo", "-o", into], 1, NUMBA_CACHE_DIR=place)
        warm = spent(words, runs, NUMBA_CACHE_DIR=place)
    print(f"turnscan precompile, as make setup does: {before}; again: {again}")
    lines = ["| | s of processor | s on the clock | wanted |", "|---|---|---|---|"]
    for what, took, wanted in (
        ("`turnscan precompile`, which `make setup` ends with", before, ""),
        ("`turnscan demo` after that", demo, f"{DEMO_LIMIT:.0f} s"),
        (f"`reconstruct` of {STEPS} steps of the demo's cup, warm", warm, ""),
        ("the first one after `precompile`", first, _beyond(warm)),
        ("the first one without it", cold, _beyond(warm)),
    ):
        lines.append(f"| {what} | {took.processor:.1f} | {took.clock:.1f} | {wanted} |")
    print("\n".join(lines))
    if into_pages:
        write(PAGE, "first run", lines)


def _beyond(warm: Spent) -> str:
    return f"{warm.clock + FIRST_LIMIT:.1f} s"


def run(quick: bool = False, parts: Sequence[str] = (), into_pages: bool = False) -> None:
    """Print the times; ``quick`` takes fewer runs and leaves the compilation out."""
    runs = 2 if quick else RUNS
    if "commands" in (parts or PARTS):
        _commands(runs)
    if "cold" in parts or not (parts or quick):
        _first_surface(runs, into_pages)


def _commands(runs: int) -> None:
    bare = spent([sys.executable, "-c", "pass"], runs)
    print(f"python -c pass: {bare}")
    inside = _imports(runs)
    print(
        f"import turnscan: {inside * 1000:.1f} ms of processor in a running interpreter "
        f"(wanted: below {IMPORT_LIMIT * 1000:.0f} ms)"
    )
    program = [sys.executable, "-m", "turnscan"]
    whole = spent([*program, "--help"], runs)
    print(f"turnscan --help: {whole} (wanted: below {HELP_LIMIT} s)")
    with click.Context(command_line) as context:
        verbs = command_line.list_commands(context)
    helps = {verb: spent([*program, verb, "--help"], min(runs, 2)) for verb in verbs}
    slowest = max(helps, key=lambda verb: helps[verb].processor)
    for verb, took in helps.items():
        print(f"turnscan {verb} --help: {took}")
    print(f"the slowest of {len(helps)} verbs: {slowest}, {helps[slowest]}")

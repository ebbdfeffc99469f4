"""Put faults into a copy of the sources, and say which of them no test noticed.

What was found is kept in ``build/mutants.json``: ``--survivors`` runs those that were not killed or
not run yet, and takes the others as they were. ``--write`` puts all into the page.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from bench.mutants._copy import Copy
from bench.mutants._mutant import Mutant, Result
from bench.mutants._named import named
from bench.mutants._operators import mutants_of
from bench.mutants._page import Found, equivalent, explained, page, table
from bench.mutants._rooms import ROOMS, Suite

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "src" / "turnscan"
PAGE = ROOT / "docs" / "explain" / "mutants.md"
KEPT = ROOT / "build" / "mutants.json"
SEED = 10
_PATIENCE = 4.0
"""Times what the tests take without a fault: then a mutant runs for ever."""
_LEAST = 100.0
"""s: kernels of a mutant are compiled first."""


def main(words: Sequence[str] | None = None) -> int:
    """Run mutants; 1 where a survivor is not explained, or fewer than nine in ten are killed."""
    parser = argparse.ArgumentParser(prog="python -m bench.mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=SEED, help="of the sample")
    parser.add_argument("--rooms", default=",".join(ROOMS))
    parser.add_argument("--named", action="store_true", help="those written by hand alone")
    parser.add_argument("--sample", type=int, help="mutants drawn in each of the five rooms")
    parser.add_argument("--only", default="", help="those whose name holds this text")
    parser.add_argument("--survivors", action="store_true", help="those not killed so far")
    parser.add_argument("--page", action="store_true", help="run nothing: what was found so far")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.relative_to(ROOT)}")
    asked = parser.parse_args(words)
    rooms = asked.rooms.split(",")
    if unknown := sorted(set(rooms) - set(ROOMS)):
        parser.error(f"no room {', '.join(unknown)}; there are {', '.join(ROOMS)}")
    chosen = [m for m in _chosen(asked, rooms) if asked.only in m.key]
    kept = _kept()
    old = [replace(kept[m.key], mutant=m) for m in chosen if m.key in kept]
    settled = [r for r in old if asked.page or r.killed or equivalent(r.mutant)]
    results = settled if asked.page or asked.survivors else []
    if not asked.page:
        known = {r.mutant.key for r in results}
        with tempfile.TemporaryDirectory(prefix="turnscan-mutants-") as folder:
            for result in _results(
                Copy(ROOT, Path(folder)), [m for m in chosen if m.key not in known]
            ):
                results.append(result)
                _keep(result)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    found = Found(tuple(results), len(chosen), asked.seed, commit)
    print(table(found))
    if asked.write:
        PAGE.write_text(page(found))
    unexplained = [r.mutant for r in found.survivors if not explained(r.mutant)]
    for mutant in unexplained:
        print(f"not explained: {mutant.key}")
    return int(bool(unexplained) or found.share < 0.9)


def _keep(result: Result) -> None:
    """With what other runs have found meanwhile, of other rooms."""
    KEPT.parent.mkdir(exist_ok=True)
    kept = _kept() | {result.mutant.key: result}
    rows = {key: [r.by, round(r.seconds, 1)] for key, r in kept.items()}
    whole = KEPT.with_suffix(f".{os.getpid()}")
    whole.write_text(json.dumps(rows, indent=1, ensure_ascii=False))
    whole.replace(KEPT)


def _kept() -> dict[str, Result]:
    """What earlier runs found, by key."""
    rows = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    nothing = Mutant("", "", 0, 0, "", "", "")
    return {key: Result(nothing, by, seconds) for key, (by, seconds) in rows.items()}


def _chosen(asked: argparse.Namespace, rooms: Sequence[str]) -> Iterator[Mutant]:
    for name in rooms:
        room = ROOMS[name]
        yield from named(name, SOURCES)
        if asked.named or not room.sample:
            continue
        every = [
            mutant
            for pattern in room.modules
            for path in sorted(SOURCES.glob(pattern))
            for mutant in mutants_of(name, path.relative_to(SOURCES).as_posix(), path.read_text())
        ]
        count = room.sample if asked.sample is None else asked.sample
        yield from sorted(every, key=lambda m: _lot(asked.seed, m))[:count]


def _lot(seed: int, mutant: Mutant) -> bytes:
    """Draws the same mutants again as long as they can be made, whatever else changes."""
    return hashlib.sha256(f"{seed} {mutant.key}".encode()).digest()


def _results(copy: Copy, chosen: Sequence[Mutant]) -> Iterator[Result]:
    limits: dict[Suite, float] = {}
    for i, mutant in enumerate(chosen):
        suites = ROOMS[mutant.room].suites_of(mutant.path)
        for suite in suites:
            if suite not in limits:
                limits[suite] = _limit(copy, suite)
        result = _judged(copy, mutant, suites, limits)
        print(
            f"{i + 1}/{len(chosen)} in {result.seconds:.1f} s: {mutant.key}: "
            + (f"killed by {result.by}" if result.killed else "SURVIVED"),
            flush=True,
        )
        yield result


def _limit(copy: Copy, suite: Suite) -> float:
    """s: how long tests may run that pass without a fault."""
    run = copy.healthy(_tests(suite), suite.compiled)
    print(f"{run.seconds:.1f} s without a fault: {' '.join(suite.tests)}", flush=True)
    if not run.passed:
        sys.exit(f"the tests fail without a fault: {run.by}")
    return max(_LEAST, _PATIENCE * run.seconds)


def _judged(
    copy: Copy, mutant: Mutant, suites: Sequence[Suite], limits: Mapping[Suite, float]
) -> Result:
    began = time.monotonic()
    with copy.wrong(mutant):
        for suite in suites:
            run = copy.run(_tests(suite), suite.compiled, limits[suite])
            if not run.passed:
                return Result(mutant, run.by, time.monotonic() - began)
    return Result(mutant, "", time.monotonic() - began)


def _tests(suite: Suite) -> list[str]:
    return [f"tests/{test}" if ".py" in test else test for test in suite.tests]


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())

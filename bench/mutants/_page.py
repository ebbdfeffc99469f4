"""What a run found: as a table on the screen, and as a page of the documentation."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bench.mutants._mutant import Mutant, Result
from bench.mutants._rooms import ROOMS

_WHY: dict[str, str] = tomllib.loads(Path(__file__).with_name("survivors.toml").read_text())


def explained(mutant: Mutant) -> str:
    """Why no test notices it, "" where nobody has said."""
    return _WHY.get(mutant.key, "")


def equivalent(mutant: Mutant) -> bool:
    """Whether nothing that anybody could see differs."""
    return explained(mutant).startswith("equivalent")


@dataclass(frozen=True)
class Found:
    """The results of one run."""

    results: tuple[Result, ...]
    drawn: int
    """Mutants that were to be run."""
    seed: int
    commit: str

    @cached_property
    def survivors(self) -> list[Result]:
        """Those that no test noticed."""
        return [r for r in self.results if not r.killed]

    @property
    def same(self) -> int:
        """How many survived that are equivalent."""
        return sum(equivalent(r.mutant) for r in self.survivors)

    @property
    def share(self) -> float:
        """Part that was killed of those that are not equivalent."""
        killed = len(self.results) - len(self.survivors)
        return killed / max(len(self.results) - self.same, 1)


def table(found: Found) -> str:
    """Room by room, then the survivors."""
    lines = ["", *_rows(found), ""]
    lines += [f"survived: {_line(r)}" for r in found.survivors]
    return "\n".join(lines)


def page(found: Found) -> str:
    """The page of the documentation."""
    by_hand = [r for r in found.results if r.mutant.name]
    minutes = sum(r.seconds for r in found.results) / 60
    noticed = [
        f"| {r.mutant.name} | `{r.mutant.path}` | {f'`{r.by}`' if r.by else 'none'} |"
        for r in by_hand
    ]
    killed = sum(r.killed for r in found.results)
    left = found.drawn - len(found.results)
    waiting = f" {left} more were drawn and not run yet." if left else ""
    return "\n".join(
        [
            *_HOW.splitlines(),
            "",
            f"The last run, of {found.commit} with seed {found.seed}, killed {killed} of "
            f"{len(found.results)} mutants in {minutes:.0f} minutes on a busy machine. "
            f"{found.same} are equivalent: nothing that anybody could see differs. Of the others "
            f"{found.share:.1%} were killed.{waiting}",
            "",
            *_rows(found),
            "",
            "## Survivors",
            "",
            *([f"- {_line(r)}" for r in found.survivors] or ["None."]),
            "",
            "## Written by hand",
            "",
            "| what is wrong | in | noticed by |",
            "|---|---|---|",
            *noticed,
            "",
        ]
    )


_HOW = """\
# Would the tests notice?

`make mutants` puts faults into a copy of the sources, one at a time, and runs the quick tests that
should notice. Some are written by hand: faults that a room's tests had once let pass, and their
kind. The others are drawn with a seed from all that the operators make of a room: comparisons and
conditions negated, arithmetic exchanged, constants doubled, signs, factors and terms dropped,
minimum for maximum. A mutant is killed when a test fails, or when the tests run four times as
long as without it, and 100 s at least. `python -m bench.mutants --survivors` runs again what lived
and takes the others as earlier runs with the seed found them; the figures below came about so, over
several states of the sources.

Each runs in a process of its own, forked from one that has the libraries loaded. Small tests of
kernels run them as plain Python first; what survives that is compiled. What a room's slow tests
would notice as well does not count.

The tool is turnscan's own (`bench/mutants`). Of those on PyPI, mutmut 3.8 leaves functions with
decorators alone, as all kernels are, and switches mutants while they run, which kernels cannot do;
cosmic-ray 8.7 starts a new interpreter for each mutant. Neither takes mutants written by hand.
"""


def _rows(found: Found) -> list[str]:
    rows = [
        "| room | mutants | killed | survived | of these equivalent | min |",
        "|---|" + "---|" * 5,
    ]
    rooms = [(name, [r for r in found.results if r.mutant.room == name]) for name in ROOMS]
    for name, some in [*((n, s) for n, s in rooms if s), ("all", list(found.results))]:
        alive = [r for r in some if not r.killed]
        same = sum(equivalent(r.mutant) for r in alive)
        rows.append(
            f"| {name} | {len(some)} | {len(some) - len(alive)} | {len(alive)} | {same} "
            f"| {sum(r.seconds for r in some) / 60:.1f} |"
        )
    return rows


def _line(result: Result) -> str:
    m = result.mutant
    return f"`{m.path}`, {m.where or 'top'}: `{m.change}`: {explained(m) or 'NOT EXPLAINED'}"

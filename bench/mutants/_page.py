"""What a run found: as a table on the screen, and as a page of the documentation."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bench.mutants._mutant import Mutant, Result
from bench.mutants._rooms import ROOMS

_WHY: dict[str, str] = tomllib.loads(Path(__file__).with_name("survivors.toml").read_text())
_EQUIVALENT = "equivalent"


def explained(mutant: Mutant) -> str:
    """Why no test notices it, "" where nobody has said."""
    return _WHY.get(mutant.key, "")


@dataclass(frozen=True)
class Found:
    """The results of one run."""

    results: tuple[Result, ...]
    seed: int
    commit: str

    @cached_property
    def survivors(self) -> list[Result]:
        """Those that no test noticed."""
        return [r for r in self.results if r.outcome != "killed"]

    @property
    def share(self) -> float:
        """Part that was killed, equivalent ones counted as not killed."""
        return 1.0 - len(self.survivors) / max(len(self.results), 1)


def table(found: Found) -> str:
    """Room by room, then the survivors."""
    lines = ["", *_rows(found), ""]
    lines += [f"survived: {_line(r)}" for r in found.survivors]
    return "\n".join(lines)


def page(found: Found) -> str:
    """The page of the documentation."""
    by_hand = [r for r in found.results if r.mutant.name]
    minutes = sum(r.seconds for r in found.results) / 60
    return f"""# Would the tests notice?

`make mutants` puts faults into a copy of the sources, one at a time, and runs the quick tests that
should notice. Some faults are written by hand: each is one that a room's tests had let pass. The others are drawn
with a seed from all that the operators can make of the rooms: comparisons turned about,
arithmetic exchanged, constants doubled, signs, factors and terms dropped, conditions negated. A mutant is killed when a
test fails, or runs four times as long as without it. {" ".join(_HOW.split())}

The last run, of {found.commit} with seed {found.seed}, took {minutes:.0f} minutes of one core and killed
{_count(found.results)}, {found.share:.1%}.

{chr(10).join(_rows(found))}

## Survivors

{chr(10).join(f"- {_line(r)}" for r in found.survivors) or "None."}

## Written by hand

| what is wrong | in | noticed by |
|---|---|---|
{chr(10).join(f"| {r.mutant.name} | `{r.mutant.path}` | {f'`{r.by}`' if r.by else 'none'} |" for r in by_hand)}
"""


_HOW = """\
Each runs in a process of its own, forked from one that has the libraries loaded. Small tests of kernels run them as
plain Python first; what survives that is compiled.
"""


def _rows(found: Found) -> list[str]:
    rows = ["| room | mutants | killed | survived | of these equivalent | min |", "|---|" + "---|" * 5]
    rooms = [(name, [r for r in found.results if r.mutant.room == name]) for name in ROOMS]
    for name, some in [*((n, s) for n, s in rooms if s), ("all", list(found.results))]:
        alive = [r for r in some if r.outcome != "killed"]
        same = sum(explained(r.mutant).startswith(_EQUIVALENT) for r in alive)
        rows.append(
            f"| {name} | {len(some)} | {len(some) - len(alive)} | {len(alive)} | {same} "
            f"| {sum(r.seconds for r in some) / 60:.1f} |"
        )
    return rows


def _count(results: Sequence[Result]) -> str:
    return f"{sum(r.outcome == 'killed' for r in results)} of {len(results)} mutants"


def _line(result: Result) -> str:
    m = result.mutant
    return f"`{m.path}`, {m.where or 'top'}: `{m.change}`: {explained(m) or 'NOT EXPLAINED'}"

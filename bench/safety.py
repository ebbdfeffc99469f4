"""Time to dark after each fault, on emulated boards; ``python -m bench.safety`` writes the table.

The table stands between two marks in docs/safety.md.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

from tests.safety.faults import CASES, Case

PAGE = Path(__file__).parents[1] / "docs" / "safety.md"
BEGIN, END = "<!-- measured: python -m bench.safety -->", "<!-- end of what was measured -->"
TIMES = 3


def worst(case: Case, times: int = TIMES) -> float:
    """s, of all boards and repetitions."""
    return max(span.seconds for _ in range(times) for span in case.spans())


def row(case: Case, measured: float) -> str:
    """Of the table."""
    boards = "all" if len(case.dialects) == 4 else ", ".join(case.dialects)
    test = f"`test_faults.py::test_dark_in_time[{case.id}]`"
    told = "stays lit" if measured == math.inf else _shown(measured)
    return f"| {case.fault} | {case.does} | {_shown(case.limit)} | {told} | {boards} | {test} |"


def _shown(seconds: float) -> str:
    ms = 1e3 * seconds
    return f"{seconds:.1f} s" if ms >= 950 else f"{ms:.0f} ms" if ms >= 10 else f"{ms:.1f} ms"


def table(measured: list[float]) -> str:
    """In Markdown."""
    head = "| fault | what turnscan does | longest time to dark | measured | boards | test |"
    rows = [row(case, seconds) for case, seconds in zip(CASES, measured, strict=True)]
    return "\n".join([head, "|---|---|---|---|---|---|", *rows])


def run(quick: bool = False) -> None:
    """Print the table; once each where ``quick``."""
    print(table([worst(case, 1 if quick else TIMES) for case in CASES]))


def main() -> int:
    """Measure, and write the table into the page; 1 where something was too late."""
    measured = []
    for case in CASES:
        measured.append(worst(case))
        print(f"{case.fault}: {_shown(measured[-1])}", flush=True)
    before, _, rest = PAGE.read_text().partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n\n{table(measured)}\n\n{END}{after}")
    return int(any(m > case.limit for m, case in zip(measured, CASES, strict=True)))


if __name__ == "__main__":
    sys.exit(main())

"""Set-ups that cannot give a rig and inputs that are wrong: how many are refused, and how soon.

They are the tables of the tests themselves, run here with a clock: a case that passes was refused,
or the wrong was said, for the right reason.
"""

from __future__ import annotations

import io
import time
from collections.abc import Generator
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from bench.calibration._figures import Figure, at_most

ROOT = Path(__file__).parents[2]
SET_UPS = "tests/calibrate/test_degenerate.py"
INPUTS = "tests/workflows/test_wrong_inputs.py"
_GOOD = ("right_steps", "small_part", "threshold", "there_are", "camera_alone", "a good line")
"""Cases of these files in which nothing is wrong, or which count."""


@dataclass
class _Clock:
    """Processor seconds of each case, and which passed."""

    seconds: dict[str, float] = field(default_factory=dict)
    passed: dict[str, bool] = field(default_factory=dict)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, object, object]:
        begin = time.process_time()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = time.process_time() - begin

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" or not report.passed:
            self.passed[report.nodeid] = report.passed


def figures(quick: bool) -> list[Figure]:
    """How many cases there are, how many are refused by name, the slowest set-up, and each of the
    wrong inputs with its seconds."""
    del quick
    out = []
    for what, path, least in (("degenerate set-ups", SET_UPS, 20), ("wrong inputs", INPUTS, 12)):
        clock, said = _Clock(), io.StringIO()
        with redirect_stdout(said):
            pytest.main(["-q", "-p", "no:cacheprovider", str(ROOT / path)], plugins=[clock])
        wrong = [n for n in clock.passed if not any(good in n for good in _GOOD)]
        found = sum(clock.passed[n] for n in wrong)
        told = f"{found} of {len(wrong)}"
        met = found == len(wrong) and found >= least
        out.append(Figure(f"{what} refused by name", f"all, at least {least}", told, met))
        each = wrong if path == INPUTS else [max(wrong, key=lambda n: clock.seconds.get(n, 0.0))]
        out += [_line(clock, name, what if path == INPUTS else f"slowest of the {what}")
                for name in each]  # fmt: skip
    return out


def _line(clock: _Clock, node: str, what: str) -> Figure:
    """Seconds of one case, which counts only where it was refused."""
    name, _, case = node.rpartition("::")[2].removeprefix("test_").partition("[")
    # Of a table of cases the first column names it; numbers name nothing.
    of = case.rstrip("]").split("-")[0]
    words = name.replace("_", " ") + (f": {of}" if of and not of[0].isdigit() else "")
    seconds = clock.seconds.get(node, float("inf")) if clock.passed[node] else float("inf")
    return at_most(f"{what}, processor ({words})", seconds, 10.0, "s", 1)


__all__ = ["figures"]

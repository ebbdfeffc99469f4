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
    """How many cases there are, how many are refused by name, and the slowest."""
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
        slowest = max(wrong, key=lambda n: clock.seconds.get(n, 0.0))
        name = f"slowest of the {what}, processor ({slowest.rpartition('::')[2]})"
        out.append(at_most(name, clock.seconds.get(slowest, float("inf")), 10.0, "s", 1))
    return out


__all__ = ["figures"]

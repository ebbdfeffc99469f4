"""How long tests slept: ``pytest -p tests.sleeps`` prints the sum, over all processes.

Counted is every ``time.sleep`` of the process that runs the tests, from their own code and from
what they call, in its threads too, which may sleep side by side.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from pathlib import Path

import pytest

HERE = str(Path(__file__).parent)
_sleep = time.sleep
_lock = threading.Lock()
_slept: Counter[str] = Counter()


def _counted(seconds: float) -> None:
    caller = sys._getframe(1).f_code.co_filename
    with _lock:
        _slept["by tests" if caller.startswith(HERE) else "by what they call"] += float(seconds)
    _sleep(seconds)


def pytest_configure() -> None:
    time.sleep = _counted


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["slept"] = dict(_slept)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    _slept.update(getattr(node, "workeroutput", {}).get("slept", {}))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for who in ("by tests", "by what they call"):
        terminalreporter.write_line(f"asleep {who}: {_slept[who]:.1f} s")

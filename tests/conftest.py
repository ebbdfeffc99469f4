"""What all tests share: signals as a terminal leaves them, the budget of skips, real data."""

from __future__ import annotations

import gc
import os
import signal
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from tests.needs import budget, in_ci, needs_shared

# A property is not judged by a clock, and a run says the same each time; TURNSCAN_EXPLORE=1 looks
# at examples never seen before.
settings.register_profile(
    "turnscan",
    deadline=None,
    derandomize="TURNSCAN_EXPLORE" not in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("turnscan")


SIGNALS = ("SIGHUP", "SIGINT", "SIGQUIT", "SIGTERM")


def pytest_configure(config: pytest.Config) -> None:
    """Let the processes that tests start die of the signals that tests send.

    ``nohup make test`` and ``make test &`` hand on an ignored SIGHUP or SIGINT, which every child
    inherits. A handler does not survive the start of a program, so children have the default
    again, while the run itself goes on ignoring what it was told to ignore. The process that only
    hands out the tests stays as it is: its workers must inherit what it ignores.
    """
    if config.getoption("dist", "no") == "no":
        for number in (getattr(signal, name) for name in SIGNALS if hasattr(signal, name)):
            if signal.getsignal(number) == signal.SIG_IGN:
                signal.signal(number, lambda *_: None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadScopeScheduling:
    return ByModule(config, log)


class ByModule(LoadScopeScheduling):
    """A module's tests go to one process, so that what they share is made once.

    All that drives a browser goes to one process: it draws with the processor, and two of them
    leave nothing of two cores to the boards and leases that other tests wait for. So does what
    looks through all sources, which are parsed once there.
    """

    def _split_scope(self, nodeid: str) -> str:
        module = nodeid.partition("::")[0]
        if module.startswith(BROWSER):
            return "browser"
        return "sources" if module in PARSING else module


PARSING = [
    f"tests/contracts/test_{name}.py"
    for name in ("contracts", "doors", "harness", "insides", "words")
]


BROWSER = "tests/app/e2e/"
"""Begun first: one process has work there for more than half of the time of all."""

WAITING = ("crash", "devices", "safety", "web")
"""Rooms whose tests wait much of their time for boards, cameras, guards and servers: spread evenly
among the others, lest all processes wait at once, or none does."""

LAST = ("edit", "formats", "mesh", "points", "poses", "rig", "shapes", "stripes", "surface")
"""Rooms of many short modules: they fill the processes evenly while the last long ones end."""


gc.set_threshold(50_000, 20, 20)
"""Garbage is searched for less often than after each 700 new objects: a process of tests keeps
millions, of modules and of their syntax trees, and looked through them again and again."""


def pytest_collection_finish() -> None:
    """What is there before the first test stays to the end, and is looked through no more."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    last, waiting = (tuple(f"tests/{room}/" for room in rooms) for rooms in (LAST, WAITING))

    def kind(module: str) -> tuple[int, bool]:
        return module.startswith(last) - module.startswith(BROWSER), module.startswith(waiting)

    alike: dict[tuple[int, bool], list[str]] = {}
    for module in dict.fromkeys(item.nodeid.partition("::")[0] for item in items):
        alike.setdefault(kind(module), []).append(module)
    turn = {
        module: (stage, (k + 0.5) / len(some))
        for (stage, _), some in alike.items()
        for k, module in enumerate(some)
    }
    items.sort(key=lambda item: turn[item.nodeid.partition("::")[0]])


def _skipped(config: pytest.Config) -> Counter[str]:
    """Why tests were skipped, and how many."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = reporter.stats.get("skipped", []) if reporter else []
    return Counter(r.longrepr[2] if isinstance(r.longrepr, tuple) else "?" for r in reports)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if in_ci() and _skipped(session.config).total() > budget():
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    skipped = _skipped(config)
    terminalreporter.section("skips")
    for reason, count in skipped.most_common():
        terminalreporter.write_line(f"{count} × {reason}")
    enforced = "enforced" if in_ci() else "enforced where CI is set"
    terminalreporter.write_line(f"{skipped.total()} skipped; budget {budget()} ({enforced})")


@pytest.fixture
def shared_data() -> Path:
    """The folder of real pictures and scans made by others; skips where it is absent."""
    return needs_shared()

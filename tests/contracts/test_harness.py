"""Promises of the tests themselves: skips, signals, and what is made once."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import conftest, needs
from tests.contracts.sources import SOURCES, nodes
from tests.once import once

TOP = Path(__file__).parents[2]
TESTS = sorted(Path(__file__).parents[1].rglob("*.py"))


def test_every_skip_says_what_it_needs_and_counts_against_the_budget() -> None:
    """`tests.needs` is the one door: what skips past it would be silent in CI."""
    own = {"needs.py", Path(__file__).name}
    pattern = r"pytest\.skip|importorskip|mark\.skip|unittest\.skip|mark\.(xfail|flaky)"
    for path in (p for p in TESTS if p.name not in own):
        assert not re.search(pattern, path.read_text()), path


def test_no_module_takes_helpers_from_a_test_module() -> None:
    """Helpers are in plainly named modules; only what removes protections imports their tests."""
    exception = "tests/safety/test_removed.py"
    sources = sorted([*TESTS, *(TOP / "bench").rglob("*.py"), *(TOP / "src").rglob("*.py")])
    found = []
    for path in sources:
        name = path.relative_to(TOP).as_posix()
        source = path.is_relative_to(SOURCES)
        for node in nodes(path) if source else ast.walk(ast.parse(path.read_text())):
            imported = []
            if isinstance(node, ast.Import):
                imported = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                imported = [f"{node.module or ''}.{alias.name}" for alias in node.names]
            for module in imported:
                if re.search(r"^tests\..*\btest_", module) and name != exception:
                    found.append(f"{name}:{node.lineno}: imports {module}")
        if name not in (exception, Path(__file__).relative_to(TOP).as_posix()):
            text = r"""^ *['"]?(?:from|import) tests[\w.]*\.test_.*"""  # of a program in a string
            found += [f"{name}: {line}" for line in re.findall(text, path.read_text(), re.M)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("value", ["1", "true", "TRUE", "yes", "woodpecker"])
def test_any_truthy_ci_forbids_to_skip_what_can_be_installed(
    value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = needs.Need(lambda: "no such program")
    optional = needs.Need(lambda: "no such data", may_skip_in_ci=True)
    monkeypatch.setattr(needs, "NEEDS", {"absent": absent, "optional": optional})
    monkeypatch.setenv("CI", value)
    with pytest.raises(pytest.fail.Exception, match="no such program → make system installs"):
        needs.needs("absent")
    with pytest.raises(pytest.skip.Exception, match="no such data"):
        needs.needs("optional")
    for no in ("", "0", "false"):
        monkeypatch.setenv("CI", no)
        with pytest.raises(pytest.skip.Exception, match="no such program"):
            needs.needs("absent")


def _pytest(folder: Path, text: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run pytest with turnscan's conftest on one more test, with SIGHUP and SIGINT ignored."""

    def ignore() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    (folder / "test_one.py").write_text(text)
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "tests.conftest",
         "-c", TOP / "pyproject.toml", "--rootdir", folder, folder],
        cwd=TOP, env={**os.environ, **environment}, preexec_fn=ignore,
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip


def test_what_a_test_starts_dies_of_a_signal_that_nohup_ignores(tmp_path: Path) -> None:
    needs.needs("POSIX")
    done = _pytest(
        tmp_path,
        "import os, signal, subprocess, sys\n"
        "def test_one():\n"
        "    for number in (signal.SIGHUP, signal.SIGINT):\n"
        "        os.kill(os.getpid(), number)  # the run itself outlives what it must ignore\n"
        "        child = f'import os; os.kill(os.getpid(), {int(number)})'\n"
        "        ended = subprocess.run([sys.executable, '-c', child], stderr=-3)\n"
        "        assert ended.returncode == -number\n",
    )
    assert done.returncode == 0, done.stdout
    assert "0 skipped" in done.stdout


def test_a_skip_over_the_budget_fails_a_run_in_ci(tmp_path: Path) -> None:
    skipping = "import pytest\n" + f"@pytest.mark.parametrize('n', range({needs.budget() + 1}))\n"
    skipping += "def test_one(n): pytest.skip('tired')\n"
    done = _pytest(tmp_path, skipping, CI="1")
    assert done.returncode == 1, done.stdout
    assert re.search(rf"{needs.budget() + 1} × .*tired", done.stdout), done.stdout
    assert _pytest(tmp_path, skipping, CI="").returncode == 0


def test_what_is_made_once_is_made_by_one_and_seen_whole_by_all(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    made = []

    def make(folder: Path) -> None:
        made.append(folder)
        time.sleep(0.1)
        (folder / "it").write_text("whole")

    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(once, tmp_path_factory, "of-the-harness", make) for _ in range(4)]
        seen = [a.result() for a in asked]
    assert len(made) == 1
    assert {(folder / "it").read_text() for folder in seen} == {"whole"}

    def fail(folder: Path) -> None:
        made.append(folder)
        raise OSError("no room")

    for _ in range(2):  # who comes later sees why, too, and waits for nobody
        with pytest.raises(OSError, match="no room"):
            once(tmp_path_factory, "never-of-the-harness", fail)
    assert len(made) == 3


def test_modules_that_wait_stand_among_those_that_compute() -> None:
    rooms = ["app/e2e", "cli", "cli", "cli", "cli", "devices", "edit", "safety", "web"]
    names = [f"tests/{room}/test_{k}.py" for k, room in enumerate(rooms)]
    items = [SimpleNamespace(nodeid=f"{name}::test_{n}") for name in names for n in "ab"]
    conftest.pytest_collection_modifyitems(items)
    turn = [item.nodeid.partition("::")[0] for item in items]
    assert [item.nodeid[-1] for item in items] == ["a", "b"] * len(names), "modules stay whole"
    order = list(dict.fromkeys(turn))
    assert (order[0], order[-1]) == (names[0], names[6])
    waits = [name.split("/")[1] in conftest.WAITING for name in order]
    assert sum(waits) == 3
    assert not any(a and b for a, b in pairwise(waits))

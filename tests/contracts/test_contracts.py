"""Promises about the sources themselves, that no single room could test."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pkgutil
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import turnscan
from tests import needs

TOP = Path(__file__).parents[2]
SOURCES = sorted((TOP / "src" / "turnscan").rglob("*.py"))
ROOMS = sorted(m.name for m in pkgutil.iter_modules(turnscan.__path__) if m.ispkg)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(p.parents[2])))
def test_nothing_from_a_file_is_ever_executed(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            assert name not in {"eval", "exec", "compile", "pickle.load", "pickle.loads"}, name
            assert not any(
                k.arg in {"shell", "allow_pickle"} and ast.unparse(k.value) == "True"
                for k in node.keywords
            ), ast.unparse(node)
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [a.name for a in node.names] + [getattr(node, "module", None) or ""]
            assert not {"pickle", "marshal", "shelve"} & {m.split(".")[0] for m in modules}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_hands_out_exactly_what_it_names(room: str) -> None:
    module = importlib.import_module(f"turnscan.{room}")
    for name in getattr(module, "__all__", ()):
        thing = getattr(module, name)
        if inspect.isfunction(thing) or inspect.isclass(thing):
            assert thing.__doc__, f"turnscan.{room}.{name} has no docstring"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(p.parents[2])))
def test_no_unfinished_marks_and_no_network(path: Path) -> None:
    text = path.read_text()
    assert not re.search(r"\b(TODO|FIXME|XXX|NotImplementedError)\b", text)
    own = "|{" if path.name == "_server.py" and path.parent.name == "app" else ""
    # The server prints its own address, put together from where it listens.
    names = r"www\.w3\.org|schemas\.(microsoft|openxmlformats)\.(com|org)"  # of formats
    found = re.search(rf"\bhttps?://(?!{names}{own})", text)
    assert not found, "no address is reached at run time"


TESTS = sorted(Path(__file__).parents[1].rglob("*.py"))


def test_every_skip_says_what_it_needs_and_counts_against_the_budget() -> None:
    """`tests.needs` is the one door: what skips past it would be silent in CI."""
    own = {"needs.py", Path(__file__).name}
    pattern = r"pytest\.skip|importorskip|mark\.skip|unittest\.skip|mark\.(xfail|flaky)"
    for path in (p for p in TESTS if p.name not in own):
        assert not re.search(pattern, path.read_text()), path


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

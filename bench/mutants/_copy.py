"""An isolated copy of the tree, in which one file at a time is wrong and tests are run.

Each run is a fork of this process, which has numpy, numba and pytest loaded, and forgets turnscan:
a mutant of plain Python costs its tests and nothing else. Kernels run uncompiled where the tests
are small enough, for compiling costs more than they do.
"""

from __future__ import annotations

import importlib
import os
import re
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from bench.mutants._mutant import Mutant

_PARTS = ("src", "tests", "bench", "docs", "pyproject.toml", "CHANGELOG.md", "README.md")
_HEAVY = (
    "numpy", "scipy.sparse.linalg", "scipy.spatial", "scipy.optimize", "scipy.special",
    "scipy.stats", "cv2", "numba", "pydantic", "hypothesis", "pytest", "igl",
)  # fmt: skip

_ANEW = ("bench", "tests", "turnscan")
"""Loaded by each run from the copy: what `bench` itself needs of turnscan would hide a mutant."""


@dataclass(frozen=True)
class Run:
    """How a run of tests ended."""

    passed: bool
    by: str
    """The first test that failed, or what ended the run."""
    seconds: float


class Copy:
    """The copy, in ``folder``."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder
        ignored = shutil.ignore_patterns("static", "_build", "pictures", "node_modules")
        for part in _PARTS:
            if (root / part).is_dir():
                shutil.copytree(root / part, folder / part, ignore=ignored)
            else:
                shutil.copy2(root / part, folder)
        self._kept = folder / "kernels"
        """Machine code of the sources as they are: that of a mutant replaces it."""
        self._kept.mkdir()
        for name in _HEAVY:
            with suppress(ImportError):
                importlib.import_module(name)

    @property
    def _kernels(self) -> Path:
        return self.folder / "src" / "turnscan" / "__pycache__" / "kernels"

    def healthy(self, tests: Sequence[str], compiled: bool) -> Run:
        """Run tests on the sources as they are, and keep what they compile."""
        run = self.run(tests, compiled, 1800.0, keep=True)
        if self._kernels.is_dir():
            _link(self._kernels, self._kept)
        return run

    @contextmanager
    def wrong(self, mutant: Mutant) -> Iterator[None]:
        """Within, the mutant's file is wrong."""
        path = self.folder / "src" / "turnscan" / mutant.path
        text, written = path.read_text(), path.stat().st_mtime_ns
        path.write_text(mutant.applied(text))
        try:
            yield
        finally:
            path.write_text(text)
            os.utime(path, ns=(written, written))  # its bytecode fits again
            _link(self._kept, self._kernels)

    def run(self, tests: Sequence[str], compiled: bool, limit: float, keep: bool = False) -> Run:
        """Run tests until the first that fails, at most ``limit`` s; ``keep`` their bytecode."""
        log = self.folder / "log"
        began = time.monotonic()
        child = os.fork()
        if not child:
            self._as_child(log, tests, compiled, keep)
        code = None
        while code is None and time.monotonic() - began < limit:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                code = os.waitstatus_to_exitcode(status)
            else:
                time.sleep(0.02)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        if code is None:
            os.waitpid(child, 0)
            return Run(False, f"ran longer than {limit:.0f} s", time.monotonic() - began)
        said = log.read_text(errors="replace")
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", said, re.MULTILINE)
        by = failed[1].removeprefix("tests/") if failed else f"exit code {code}: {said[-200:]}"
        return Run(code == 0, by, time.monotonic() - began)

    def _as_child(self, log: Path, tests: Sequence[str], compiled: bool, keep: bool) -> None:
        """Never comes back."""
        code = 99
        try:
            os.setsid()
            out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            for stream in (1, 2):
                os.dup2(out, stream)
            os.chdir(self.folder)
            source = str(self.folder / "src")
            sys.path[:0] = [source, str(self.folder)]
            os.environ["PYTHONPATH"] = source
            if not keep:
                sys.dont_write_bytecode = True
                os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
            for name in [m for m in sys.modules if m.split(".")[0] in _ANEW]:
                del sys.modules[name]
            options = ["-x", "-q", "-p", "no:cacheprovider", "--tb=short", "-ra"]
            options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
            if not compiled:
                import numba  # noqa: TID251

                numba.config.DISABLE_JIT = 1
                os.environ["NUMBA_DISABLE_JIT"] = "1"
                options += ["-W", "ignore::RuntimeWarning"]  # NaN is quiet in machine code
            import pytest

            code = int(pytest.main([*options, *tests]))
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)


def _link(source: Path, target: Path) -> None:
    """Give ``target`` the folders of ``source`` that it lacks."""
    target.mkdir(parents=True, exist_ok=True)
    for folder in source.iterdir():
        if folder.is_dir() and not (target / folder.name).exists():
            shutil.copytree(folder, target / folder.name, copy_function=os.link)

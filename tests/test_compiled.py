"""Machine code is as new as the sources: what a kernel imports may change between two runs."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import turnscan
from turnscan.arrays import Floats
from turnscan.compiled import njit

PACKAGE = Path(turnscan.__file__).parent
REACH = """
import numpy as np
from turnscan.stripes._kernels import measure_round
from turnscan.stripes._list import CENTRE, COLUMNS, REACH, WIDTH
from turnscan.stripes._scan import Terms
some = np.zeros((1, COLUMNS))
some[0, CENTRE], some[0, WIDTH] = 20.0, 2.0
light = np.zeros((43, 3), np.int64)
light[1:] = np.cumsum((np.arange(42)[:, None] - 20) ** np.arange(3), axis=0)
terms = Terms(*np.zeros(6), True, *np.zeros(3), 0)
measure_round(some, 1, light, np.array([43]), terms, 1)
print(some[0, REACH])
"""
"""Prints the half window of a stripe 2 px wide, as a kernel of another module measures it."""
FACTOR = """
from turnscan.room._kernels import scaled
print(scaled(2.0))
print(scaled._cache_hits.total(), scaled._cache_misses.total())
"""


def _run(tree: Path, code: str, **variables: str) -> list[str]:
    """What a fresh process prints that takes turnscan from ``tree``."""
    with _start(tree, code, **variables) as process:
        out, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    return out.splitlines()


def _start(tree: Path, code: str, **variables: str) -> subprocess.Popen[str]:
    first = f"import sys; sys.dont_write_bytecode = True; sys.path.insert(0, {str(tree)!r})\n"
    return subprocess.Popen(
        [sys.executable, "-I", "-c", first + code],
        env={**os.environ, "NUMBA_CACHE_DIR": "", **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _folders(tree: Path) -> list[str]:
    """Names of the folders of machine code beside the sources."""
    return sorted(p.name for p in (tree / "turnscan" / "__pycache__" / "kernels").iterdir())


def _change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A turnscan of one room: a kernel, one that it calls, and a constant of a third module."""
    room = tmp_path / "turnscan" / "room"
    room.mkdir(parents=True)
    for name in ("__init__.py", "compiled.py", "locking.py"):
        shutil.copy(PACKAGE / name, room.parent)
    (room / "__init__.py").touch()
    (room / "_values.py").write_text("FACTOR = 3.0\n")
    (room / "_inner.py").write_text(
        "from turnscan.compiled import njit\nfrom turnscan.room._values import FACTOR\n"
        "@njit(cache=True, inline='always')\ndef factor():\n    return FACTOR\n"
    )
    (room / "_kernels.py").write_text(
        "from turnscan.compiled import njit\nfrom turnscan.room import _inner\n"
        "factor = _inner.factor\n"
        "@njit(cache=True)\ndef scaled(x):\n    return factor() * x\n"
    )
    return tmp_path


def test_warm_runs_see_a_constant_that_changed_in_another_module(tmp_path: Path) -> None:
    shutil.copytree(
        PACKAGE, tmp_path / "turnscan", ignore=shutil.ignore_patterns("__pycache__", "static")
    )
    assert _run(tmp_path, REACH) == ["5.0"]
    _change(tmp_path / "turnscan/stripes/_measure.py", "HALF_WINDOW = 2.5\n", "HALF_WINDOW = 1.0\n")
    assert _run(tmp_path, REACH) == ["2.0"]


def test_machine_code_is_kept_until_something_changes_and_old_code_is_removed(small: Path) -> None:
    assert _run(small, FACTOR) == ["6.0", "0 1"]
    before = _folders(small)
    assert _run(small, FACTOR) == ["6.0", "1 0"]
    assert _folders(small) == before
    _change(small / "turnscan/room/_values.py", "3.0", "5.0")
    assert _run(small, FACTOR) == ["10.0", "0 1"]
    after = _folders(small)
    assert len(after) == len(before) == 2
    assert not set(after) & set(before)


NOTE = """
from turnscan import compiled
state = compiled.state_of_sources()
print(compiled.was_compiled("all", state))
compiled.note_compiled("all", state)
print(compiled.was_compiled("all", state), compiled.was_compiled("other", state))
"""
"""Prints whether a part was compiled, and whether after it was noted."""


def test_what_was_compiled_is_known_until_a_source_or_the_machine_code_goes(small: Path) -> None:
    _run(small, FACTOR)
    kernels = small / "turnscan" / "__pycache__" / "kernels"
    assert _run(small, NOTE) == ["False", "True False"]
    (small / "turnscan" / "words.py").write_text("TEXT = 'no kernel reads it'\n")
    assert _run(small, NOTE) == ["True", "True False"]
    _change(small / "turnscan" / "room" / "_values.py", "3.0", "4.0")
    assert _run(small, NOTE) == ["False", "True False"]
    shutil.rmtree(next(p for p in kernels.iterdir() if p.is_dir()))
    assert _run(small, NOTE) == ["False", "True False"]
    (kernels / "all.compiled").write_bytes(b"\xff")
    assert _run(small, NOTE) == ["False", "True False"]


def test_other_modules_keep_their_machine_code(small: Path) -> None:
    _run(small, FACTOR)
    before = _folders(small)
    _change(small / "turnscan/room/_kernels.py", "factor() * x", "factor() + x")
    assert _run(small, FACTOR)[0] == "5.0"
    assert len(set(_folders(small)) & set(before)) == 1


def test_machine_code_of_another_numba_is_old(small: Path) -> None:
    _run(small, FACTOR)
    other = "import numba; numba.__version__ += '.post1'\n"
    assert _run(small, other + FACTOR) == ["6.0", "0 1"]


@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def test_where_the_package_cannot_be_written_another_folder_serves(
    small: Path, variable: str
) -> None:
    if variable == "XDG_CACHE_HOME":
        (small / "turnscan" / "__pycache__").touch()  # no folder: this stops the superuser too
    place = {variable: str(small / "elsewhere")}
    assert _run(small, FACTOR, **place) == ["6.0", "0 1"]
    assert _run(small, FACTOR, **place) == ["6.0", "1 0"]
    assert list((small / "elsewhere").rglob("*.nbc"))
    assert not list((small / "turnscan").rglob("*.nbc"))


def test_where_nothing_can_be_written_it_runs_all_the_same(small: Path) -> None:
    for name in ("turnscan/__pycache__", "elsewhere"):
        (small / name).touch()
    assert _run(small, FACTOR, XDG_CACHE_HOME=str(small / "elsewhere")) == ["6.0", "0 1"]


def test_a_running_process_survives_that_its_machine_code_is_removed(small: Path) -> None:
    code = (
        "import shutil\nfrom turnscan.room._kernels import scaled\nimport turnscan\n"
        "shutil.rmtree(turnscan.__path__[0] + '/__pycache__/kernels')\n"
        "print(scaled(2.0), scaled(2))\n"
    )
    assert _run(small, code) == ["6.0 6.0"]


def test_processes_that_start_at_once_compile_once(small: Path) -> None:
    """The first holds the lock until it has saved; the others wait for it and load."""
    (small / "turnscan/room/_inner.py").write_text(
        "from turnscan.compiled import njit\n@njit(cache=True)\ndef factor():\n    return 3.0\n"
    )
    gate = small / "gate"
    wait = (
        "import time, pathlib\nfrom turnscan.room._kernels import scaled\n"
        f"print('ready', flush=True)\nwhile not pathlib.Path({str(gate)!r}).exists():\n"
        "    time.sleep(0.001)\n"
    )
    processes = [_start(small, wait + FACTOR) for _ in range(3)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    gate.touch()
    found = [process.communicate(timeout=120) for process in processes]
    assert all(process.returncode == 0 for process in processes), found
    assert sorted(out.splitlines()[-1] for out, _ in found) == ["0 1", "1 0", "1 0"]


def test_a_constant_that_a_kernel_gives_to_another_has_no_type_of_its_own() -> None:
    @njit(cache=False)
    def inner(x: int) -> int:
        return x + 1

    @njit(cache=False)
    def outer() -> int:
        total = inner(5)
        for i in range(3):
            total = inner(total) + i
        return total

    assert outer() == 12
    assert len(inner.signatures) == 1  # type: ignore[attr-defined]


def test_a_slice_of_another_shape_is_refused_and_no_text_library_comes_along() -> None:
    @njit(cache=False)
    def assign(place: Floats, source: Floats) -> None:
        place[0] = source

    place = np.zeros((2, 3))
    assign(place, np.arange(3.0))
    assert place.tolist() == [[0.0, 1.0, 2.0], [0.0, 0.0, 0.0]]
    with pytest.raises(ValueError, match="slice of another shape"):
        assign(place, np.arange(4.0))
    machine_code = "".join(assign.inspect_llvm().values())  # type: ignore[attr-defined]
    assert "unicode" not in machine_code, "numba's own sentence is a third of a small kernel"


def test_kernels_can_run_uncompiled(small: Path) -> None:
    code = "from turnscan.room._kernels import scaled\nprint(scaled(2.0))"
    assert _run(small, code, NUMBA_DISABLE_JIT="1") == ["6.0"]


def test_imports_are_written_so_that_the_hash_sees_them() -> None:
    """`_imported` reads absolute imports; a relative one would be missed."""
    sources = [p for p in PACKAGE.rglob("*.py") if p.name != "compiled.py"]
    assert not [p for p in sources if re.search(r"^\s*from\s+\.", p.read_text(), re.MULTILINE)]
    assert not [p for p in sources if re.search(r"^\s*(from|import) numba", p.read_text(), re.M)]

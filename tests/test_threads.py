"""Work in parts: their number, order and bounds; and kernels that are compiled beforehand."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from turnscan import compiled
from turnscan.errors import ExportError
from turnscan.mesh import _crossing_kernels, _topology_kernels
from turnscan.points import _wholeness_kernels
from turnscan.shapes import _area_kernels
from turnscan.stripes import _kernels, _runs_kernels
from turnscan.surface import _grid_kernels
from turnscan.surface.fusion import _overlap_kernels
from turnscan.surface.holes import _patch_kernels
from turnscan.threads import VARIABLE, in_parts
from turnscan.workflows import _compile_ahead, _precompile


@pytest.mark.parametrize("threads", ["1", "3"])
def test_parts_cover_all_in_order(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, threads)
    assert in_parts(lambda a, b: (a, b), 10, 4) == [(0, 2), (2, 5), (5, 7), (7, 10)]
    assert len(in_parts(lambda a, b: (a, b), 10)) == int(threads)
    assert in_parts(lambda a, b: (a, b), 2, 5) == [(0, 1), (1, 2)]
    assert in_parts(lambda a, b: b - a, 0) == [0]
    with pytest.raises(ZeroDivisionError):
        in_parts(lambda a, b: 1 // a, 3, 3)


def test_surfaces_are_compiled_beforehand() -> None:
    _precompile._surfaces()
    for kernel in (
        _wholeness_kernels.across, _grid_kernels.triangulate, _crossing_kernels.crossings,
        _topology_kernels.opposite_half_edges, _patch_kernels.relax,
    ):  # fmt: skip
        assert kernel.signatures, kernel  # type: ignore[attr-defined]


def test_real_pictures_find_their_kernels_compiled() -> None:
    _precompile._colours()
    for kernel in (_runs_kernels.find_in_runs, _kernels.detect_lines):
        assert any("uint16" in str(s) for s in kernel.signatures), kernel  # type: ignore[attr-defined]
    assert _overlap_kernels.feet.signatures  # type: ignore[attr-defined]
    assert _area_kernels.smooth_normals.signatures  # type: ignore[attr-defined]


def test_a_script_that_guards_nothing_may_compile() -> None:
    # From the standard input there is no file that another process could run again.
    script = (
        "from turnscan.workflows import _compile_ahead, _precompile as p\n"
        "p._PARTS = {'surfaces': None}\n"
        "p.was_compiled = lambda part, state: False\n"
        "p.precompile()\n"
        "print('once')\n"
    )
    done = subprocess.run([sys.executable, "-"], input=script, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "once\n", "")


def test_a_part_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_precompile, "_PARTS", ("nothing",))
    with pytest.raises(ExportError, match="compiling failed: KeyError: 'nothing'"):
        _precompile.precompile()


def test_without_a_folder_nothing_is_compiled_in_vain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_base", lambda: None)
    with pytest.raises(ExportError, match="machine code can be kept in no folder"):
        _precompile.precompile()


def test_of_all_runs_on_a_machine_one_is_the_first(tmp_path: Path) -> None:
    code = "from turnscan.compiled import is_first_run as first; print(first(), first())"
    for expected in ("True False", "False False"):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        )  # fmt: skip
        assert done.stdout.strip() == expected


@pytest.mark.parametrize(("first", "threads"), [(True, "2"), (True, "1"), (False, "2")])
def test_the_first_run_alone_has_kernels_compiled_ahead(
    first: bool, threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[_compile_ahead.CompileJob] = []
    begin = _compile_ahead.CompileJob.__init__

    def seen(job: _compile_ahead.CompileJob, part: str) -> None:
        begin(job, part)
        started.append(job)

    monkeypatch.setattr(_compile_ahead.CompileJob, "__init__", seen)
    monkeypatch.setattr(compiled, "is_first_run", lambda: first)
    monkeypatch.setenv(VARIABLE, threads)
    with _compile_ahead.compiling_ahead():
        assert len(started) == (first and threads == "2")
        assert all(job._process.poll() is None for job in started)
    assert all(job._process.poll() is not None for job in started)

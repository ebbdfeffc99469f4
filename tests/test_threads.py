"""Work in parts: their number, order and bounds; and kernels that are compiled beforehand."""

from __future__ import annotations

import subprocess
import sys

import pytest

from turnscan import compiled
from turnscan.errors import ExportError
from turnscan.mesh import _crossing_kernels, _topology_kernels
from turnscan.points import _wholeness_kernels
from turnscan.surface import _grid_kernels
from turnscan.surface.holes import _patch_kernels
from turnscan.threads import VARIABLE, in_parts
from turnscan.workflows import _precompile


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


def test_a_script_that_guards_nothing_may_compile() -> None:
    # From the standard input there is no file that another process could run again.
    script = (
        "from turnscan.workflows import _precompile as p\n"
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

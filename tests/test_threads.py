"""Work in parts: their number, order and bounds; and kernels that are compiled beforehand."""

from __future__ import annotations

import pytest

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

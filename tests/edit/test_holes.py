"""A hole that an edit names is found again on another surface, and no other is taken for it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mesh.open_meshes import plate
from turnscan.edit import Document, Fill, HoleName
from turnscan.surface.holes import holes


@pytest.mark.parametrize(
    ("part", "found"),
    [(0.2, False), (0.3, False), (0.4, True), (1.0, True), (2.5, True), (3.5, False)],
)
def test_a_hole_of_a_third_to_three_times_the_size_is_the_one_that_was_meant(
    part: float, found: bool
) -> None:
    """``part``: the size of what is there to the size of what was named."""
    mesh = plate(24, {(3, 3), (4, 3)})
    document = Document.open(lambda *_: (mesh, ()))
    hole = min(holes(mesh), key=lambda h: h.size)
    name = HoleName(tuple(float(x) for x in hole.centre), hole.size / part)  # type: ignore[arg-type]
    document, change = document.add(Fill((name,)))
    open_now = len(holes(document.body.mesh))
    if found:
        assert change.findings == ()
        assert open_now == len(holes(mesh)) - 1
    else:
        assert [f.code for f in change.findings] == ["edit.nothing"]
        assert open_now == len(holes(mesh))
    assert np.isfinite(document.body.mesh.vertices).all()

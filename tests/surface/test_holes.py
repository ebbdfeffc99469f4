"""Borders as values: measures, order, borders that touch."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mesh.open_meshes import plate
from turnscan.mesh import boundary_loops, cut_touching
from turnscan.surface.holes import CAUSE_WORDS, holes


def test_a_hole_knows_its_measures():
    outer, inner = holes(plate(8, {(3, 3), (4, 3)}, 0.5))
    assert len(outer.loop) == 32
    assert outer.perimeter == pytest.approx(16.0)
    assert outer.area == pytest.approx(16.0)
    assert inner.perimeter == pytest.approx(3.0)
    assert inner.area == pytest.approx(0.5)
    assert inner.size == pytest.approx(np.hypot(1.0, 0.5))
    assert inner.centre == pytest.approx([2.0, 1.75, 0.0])
    assert inner.cause is None
    assert set(CAUSE_WORDS) >= {"laser", "camera", "dark", "unknown"}


def test_the_loop_runs_with_the_faces_that_it_bounds():
    mesh = plate(4)
    (outer,) = holes(mesh)
    corners = mesh.vertices[outer.loop]
    turned = np.cross(corners, np.roll(corners, -1, axis=0))[:, 2].sum()
    assert turned > 0, "the plate lies on the left"


def test_borders_that_touch_do_not_mix():
    mesh = plate(6, {(2, 2), (3, 3)})
    loops = boundary_loops(mesh)
    assert sum(len(k) for k in loops) == 24 + 8
    for loop in loops:
        sides = set(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
        assert len(sides) == len(loop)
    apart, said = cut_touching(mesh)
    assert [f.code for f in said] == ["surface.touching"]
    assert len(mesh.faces) - len(apart.faces) < 4
    _, hole = boundary_loops(apart)
    assert len(set(hole.tolist())) == len(hole)
    assert cut_touching(apart) == (apart, [])


def test_the_same_mesh_gives_the_same_list():
    mesh = plate(9, {(1, 1), (4, 4), (7, 1), (1, 7)})
    first, again = holes(mesh), holes(mesh)
    assert [h.loop.tolist() for h in first] == [h.loop.tolist() for h in again]
    perimeters = [h.perimeter for h in first]
    assert perimeters == sorted(perimeters, reverse=True)

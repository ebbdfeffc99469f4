"""Bridges between sides and between borders."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mesh.open_meshes import ball, plate, same_measured
from turnscan.errors import InputError
from turnscan.mesh import Mesh, is_closed, join, soundness, submesh
from turnscan.surface.holes import bridge, holes


def test_a_strip_parts_a_hole_in_two():
    mesh = plate(12, {(i, j) for i in range(3, 9) for j in range(5, 7)})
    hole = holes(mesh)[1]
    at = {tuple(v): int(n) for n, v in zip(hole.loop, mesh.vertices[hole.loop, :2], strict=True)}
    low, high = (at[6, 5], at[7, 5]), (at[6, 7], at[7, 7])
    done = bridge(mesh, low, high)
    assert same_measured(mesh, done)
    assert len(done.faces) == len(mesh.faces) + 2
    assert [len(h.loop) for h in holes(done)][1:] == [9, 7]
    assert soundness(done) == []
    with pytest.raises(InputError, match="does not lie on a boundary"):
        bridge(done, low, high)


def test_a_bridge_over_a_side_that_is_taken_is_refused():
    points = [[0, 0, 0], [1, 0, 0], [0.6, 0.6, 0], [0, 1, 0], [0.5, 0.5, 3], [0.5, 0.5, -3.0]]
    faces = [[0, 2, 4], [2, 0, 5], [0, 1, 5], [1, 2, 5], [2, 3, 4], [3, 0, 4]]
    with pytest.raises(InputError, match="touch the existing surface"):
        bridge(Mesh(points, faces), (0, 1), (2, 3))


def test_a_bridge_through_a_surface_or_onto_it_is_refused():
    """A plate with a gap in which a wall stands, and one whose two edges lie on another plate."""
    mesh = plate(12, {(i, j) for i in range(3, 9) for j in range(5, 7)})
    at = {tuple(v): n for n, v in enumerate(mesh.vertices[:, :2].tolist())}
    low, high = (at[6, 5], at[7, 5]), (at[6, 7], at[7, 7])
    wall = Mesh([[5.2, 6, -2], [7.8, 6, -2], [6.5, 6, 2.0]], [[0, 1, 2]])
    cover = Mesh([[5.2, 5.2, 0], [7.8, 5.2, 0], [6.5, 6.8, 0.0]], [[0, 1, 2]])
    for other in (wall, cover):
        with pytest.raises(InputError, match="cut through the existing surface, or lie on it"):
            bridge(join([mesh, other]), low, high)


def test_a_notch_is_closed_by_one_face():
    mesh = plate(6, {(2, 2)})
    loop = holes(mesh)[1].loop.tolist()
    done = bridge(mesh, (loop[0], loop[1]), (loop[2], loop[1]))
    assert len(done.faces) == len(mesh.faces) + 1
    assert soundness(done) == []


@pytest.mark.parametrize("how", ["flat", "tangent", "curvature"])
def test_a_band_joins_two_borders(how):
    mesh = ball(40)
    middle = mesh.triangles.mean(axis=1)
    torn = submesh(mesh, np.abs(middle[:, 2]) > 3.0)
    low, high = holes(torn)
    done = bridge(torn, low, high, how)
    assert same_measured(torn, done)
    assert is_closed(done)
    assert soundness(done) == []
    off = {"flat": 0.55, "tangent": 0.25, "curvature": 0.08}[how]
    new = done.triangles[~done.measured].mean(axis=1)
    assert np.abs(np.linalg.norm(new, axis=1) - 10.0).max() < off


def test_an_island_is_joined_to_the_hole_round_it():
    ring = {(i, j) for i in range(3, 9) for j in range(3, 9)}
    mesh = plate(12, ring - {(5, 5), (6, 5), (5, 6), (6, 6)})
    _, inner, island = holes(mesh)
    done = bridge(mesh, inner, island)
    assert len(holes(done)) == 1
    assert soundness(done) == []
    assert done.area_of() == pytest.approx(144.0)


def test_what_is_on_no_border_is_refused():
    mesh = plate(6, {(2, 2)})
    outer, inner = holes(mesh)
    with pytest.raises(InputError, match="does not lie on a boundary"):
        bridge(mesh, (0, 8), (1, 2))
    with pytest.raises(InputError, match="not a boundary of this mesh"):
        bridge(plate(7), outer, inner)
    with pytest.raises(InputError, match="two edges or two holes"):
        bridge(mesh, outer, (0, 1))

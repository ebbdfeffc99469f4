"""Measured points that the fillings of a closed surface pass by."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from tests.points.grids import plain_grid
from turnscan.mesh import Mesh, is_closed, submesh
from turnscan.points import RangeGrid
from turnscan.shapes import Source, volume_sigma
from turnscan.shapes._passed import Alone, alone, passed_by, passed_findings, passed_sigma
from turnscan.surface.decimation import decimate

STEP = 1.0
"""mm: side of the faces."""


def block(size: tuple[int, int, int] = (20, 16, 12)) -> Mesh:
    """A box from 0 to ``size`` mm, in faces of `STEP`, whose top was not measured but filled."""
    a, b, c = size
    corners, faces = [], []
    for axis, at in ((0, 0), (0, a), (1, 0), (1, b), (2, 0), (2, c)):
        u, v = [k for k in range(3) if k != axis]
        m, n = size[u] + 1, size[v] + 1
        grid = np.zeros((m, n, 3))
        grid[..., axis] = at
        grid[..., u], grid[..., v] = np.arange(m)[:, None], np.arange(n)
        cell = np.arange(m * n).reshape(m, n) + sum(len(k) for k in corners)
        p, q, r, s = (
            k.ravel() for k in (cell[:-1, :-1], cell[1:, :-1], cell[1:, 1:], cell[:-1, 1:])
        )
        own = np.concatenate([np.stack([p, q, r], -1), np.stack([p, r, s], -1)])
        out = (at > 0) != (axis == 1)
        corners.append(grid.reshape(-1, 3))
        faces.append(own if out else own[:, ::-1])
    vertices, where = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    joined = where.ravel()[np.concatenate(faces)].astype(np.int32)
    made = Mesh(vertices, joined)
    top = (made.triangles[..., 2] == c).all(axis=1)
    return Mesh(vertices, joined, measured=~top)


def lone(points: ArrayLike) -> Alone:
    """These points (n, 3), beside a surface of such faces."""
    return Alone(np.asarray(points, dtype=np.float64).reshape(-1, 3), STEP)


def test_the_block_is_one() -> None:
    mesh = block()
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(20 * 16 * 12)


def test_points_on_faces_are_not_alone() -> None:
    mesh = block()
    on = np.array([[10.0, 8.0, 12.5], [10.2, 0.3, 6.1]])
    off = np.array([[10.0, 8.0, 20.0 + 0.3 * k] for k in range(6)])
    found = alone(np.vstack([mesh.vertices, on, off]), mesh)
    assert np.array_equal(found.points, off)
    assert found.side == pytest.approx(STEP)
    assert not len(alone(np.zeros((0, 3)), mesh).points)
    assert not len(alone(off, Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))).points)


def test_a_few_points_by_themselves_are_strays() -> None:
    mesh = block()
    few = np.array([[10.0, 8.0, 20.0 + 0.3 * k] for k in range(4)])
    assert not len(alone(few, mesh).points)
    spread = np.array([[5.0 * k, 8.0, 30.0] for k in range(8)])
    assert not len(alone(spread, mesh).points)


def test_only_what_lies_over_a_filling_counts() -> None:
    mesh = block()
    above, below, beside, near = [10, 8, 17], [10, 8, 8.5], [30, 8, 6], [10, 8, 13]
    found = passed_by(mesh, lone([above, below, beside, near]))
    assert np.allclose(found.points, [above, below])
    assert found.distance == pytest.approx([5.0, -3.5])
    assert np.allclose(found.feet, [[10, 8, 12], [10, 8, 12]])
    whole = Mesh(mesh.vertices, mesh.faces)
    assert not len(passed_by(whole, lone([above])).points)
    assert passed_sigma(whole, found) == 0.0


@given(st.floats(2.5, 7.0), st.booleans())
def test_a_point_makes_a_cone_of_it(height: float, outside: bool) -> None:
    mesh = block((24, 24, 20))
    z = 20 + height if outside else 20 - height
    found = passed_by(mesh, lone([[12.1, 11.9, z]]))
    cone = np.pi * height**3 / 3
    assert passed_sigma(mesh, found) == pytest.approx(cone, rel=0.12)


def test_points_close_together_count_once_and_both_sides_add_up() -> None:
    mesh = block((24, 24, 20))
    one = np.array([[12.1, 11.9, 25.0]])
    many = one + np.random.default_rng(3).uniform(-0.3, 0.0, (500, 3))
    alike = passed_sigma(mesh, passed_by(mesh, lone(np.vstack([one, many]))))
    assert alike == pytest.approx(passed_sigma(mesh, passed_by(mesh, lone(one))), rel=0.1)
    apart = np.array([[6.0, 6.0, 24.0], [18.0, 18.0, 16.0]])
    each = [passed_sigma(mesh, passed_by(mesh, lone(p[None]))) for p in apart]
    assert passed_sigma(mesh, passed_by(mesh, lone(apart))) == pytest.approx(sum(each))


@pytest.mark.parametrize("tolerance", [0.01, 0.1])
def test_thinned_faces_say_the_same(tolerance: float) -> None:
    """A flat filling is few large faces then, and so is what was measured."""
    mesh = block((24, 24, 20))
    few = decimate(mesh, tolerance=tolerance)
    assert len(few.faces) < len(mesh.faces) / 10
    points = lone([[12.1, 11.9, 25.0], [6.0, 6.0, 24.0], [18.0, 17.0, 15.0]])
    fine, coarse = (passed_sigma(m, passed_by(m, points)) for m in (mesh, few))
    assert coarse == pytest.approx(fine, rel=0.05)
    assert fine > 200.0


def test_faces_that_are_known_otherwise_are_not_in_doubt() -> None:
    mesh = block((24, 24, 20))
    found = passed_by(mesh, lone([[12.0, 12.0, 25.0]]))
    half = mesh.triangles.mean(axis=1)[:, 0] < 12.0
    whole, part = passed_sigma(mesh, found), passed_sigma(mesh, found, half)
    assert part == pytest.approx(whole / 2, rel=0.1)
    assert passed_sigma(mesh, found, np.zeros_like(half)) == 0.0


def test_the_volume_of_a_part_whose_end_was_cut_off_is_as_uncertain_as_that(scan_of) -> None:
    """The far end made no face: its points say that the filling is not the end of the part."""
    grid, mesh = scan_of
    bare = volume_sigma(mesh, Source((grid,)))
    known = volume_sigma(mesh, Source((grid,), surface=submesh(mesh, np.asarray(mesh.measured))))
    assert bare.passed == 0.0
    assert known.passed > 500.0
    assert known.unmeasured == pytest.approx(np.hypot(bare.unmeasured, known.passed))
    assert known.mostly == "measured points beside the filled faces"
    assert known.measured == pytest.approx(bare.measured, nan_ok=True)


@pytest.fixture
def scan_of() -> tuple[RangeGrid, Mesh]:
    """A block, and points of its end, which is 10 mm further up than it was filled."""
    mesh = block()
    x, y = np.meshgrid(np.arange(2.0, 19.0), np.arange(2.0, 15.0), indexing="ij")
    end = np.stack([x, y, np.full(x.shape, 22.0)], axis=-1)
    return plain_grid(end), mesh


def test_a_few_strays_are_not_worth_a_word(scan_of) -> None:
    grid, mesh = scan_of
    points = grid.points[grid.found]
    (said,) = passed_findings(mesh, lone(points), 2000)
    assert said.code == "surface.passed"
    assert said.severity == "warning"
    assert f"{len(points)} measured points" in said.message
    assert "10.0 mm off" in said.message
    assert said.where == "about (10, 8, 22) mm"
    assert passed_findings(mesh, lone(points), 100 * len(points)) == []
    assert passed_findings(mesh, lone(points[:0]), 100) == []
    surface = submesh(mesh, np.asarray(mesh.measured))
    assert Source((grid,), surface=surface).findings(mesh)[0].code == "surface.passed"
    assert Source((grid,)).findings(mesh) == [], "without the surface nobody knows"

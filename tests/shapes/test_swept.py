"""Freeform pieces with one profile: the axis is found with its uncertainty, and none invented."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import noisy, prism, turned
from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import find_shapes
from turnscan.shapes.swept import Swept, find_swept
from turnscan.workflows import find_shapes as shapes_of

SIGMA = 0.02
TURN = np.linspace(0, 2 * np.pi, 120, endpoint=False)
LEAN = np.deg2rad(25.0)
WAY = np.array([0.0, -np.sin(LEAN), np.cos(LEAN)])


def _vase() -> Mesh:
    z = np.linspace(0, 60, 61)
    r = 20 + 3 * np.sin(z / 9) + 2 * np.sin(z / 4.1)
    return turned([(float(a), float(b)) for a, b in zip(r, z, strict=True)], 0.8, 150)


def _lobes() -> Mesh:
    r = 25 + 4 * np.sin(3 * TURN) + 2 * np.cos(5 * TURN)
    flat = zip(r * np.cos(TURN), r * np.sin(TURN), strict=True)
    return prism([(float(x), float(y)) for x, y in flat], 40, 0.8)


def _leaning(mesh: Mesh) -> Mesh:
    c, s = np.cos(LEAN), np.sin(LEAN)
    R: Floats = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return Mesh(mesh.vertices @ R.T + [5.0, 2.0, 1.0], mesh.faces)


def _found(mesh: Mesh) -> tuple[Swept, ...]:
    return find_swept(mesh, find_shapes(mesh))


@pytest.mark.parametrize("kind", ["surface of revolution", "extrusion"])
def test_the_axis_of_a_swept_surface_is_found(kind: str) -> None:
    body = _leaning(_vase() if kind == "surface of revolution" else _lobes())
    one = _found(noisy(body, SIGMA, 1))[0]
    assert one.kind == kind
    assert SIGMA / 2 < one.rms < 2 * SIGMA
    assert np.linalg.norm(np.cross(one.axis, WAY)) < 4 * one.axis_sigma
    assert one.axis_sigma < np.deg2rad(0.02)
    if kind == "surface of revolution":
        away = np.linalg.norm(np.cross(one.point - [5.0, 2.0, 1.0], WAY))
        assert away < 4 * one.shift_sigma
        assert one.shift_sigma < 0.005


def test_a_freeform_surface_is_not_swept() -> None:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 160, endpoint=False), np.linspace(0.1, 3.0, 120))
    r = 30 + 5 * np.cos(3 * u) * np.sin(v) ** 2 + 3 * np.sin(4 * v + u)
    X = np.stack([r * np.cos(u) * np.sin(v), r * np.sin(u) * np.sin(v), 1.3 * r * np.cos(v)], -1)
    grid = np.arange(160 * 120).reshape(120, 160)
    a, b = grid[:-1].ravel(), np.roll(grid, -1, 1)[:-1].ravel()
    faces = np.concatenate([np.stack([a, a + 160, b], 1), np.stack([b, a + 160, b + 160], 1)])
    assert _found(noisy(Mesh(X.reshape(-1, 3), faces.astype(np.int32)), SIGMA, 1)) == ()


def test_what_was_filled_is_not_swept_and_shapes_are_told_as_shapes() -> None:
    mesh = _lobes()
    filled = Mesh(mesh.vertices, mesh.faces, measured=np.arange(len(mesh.faces)) % 400 == 0)
    assert find_swept(filled, find_shapes(filled)) == ()
    box = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.7), SIGMA, 1)
    assert _found(box) == ()


def test_it_is_told_and_written() -> None:
    found = shapes_of(noisy(_lobes(), SIGMA, 1))
    assert "freeform: extrusion along (" in str(found)
    one = found.figures()["swept"][0]
    assert one["kind"] == "extrusion"
    assert one["length_mm"] == pytest.approx(40, abs=8)
    assert "axis_shift_sigma_mm" not in one

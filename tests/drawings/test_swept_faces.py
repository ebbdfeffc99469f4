"""Swept freeform pieces in STEP: one profile, drawn along a direction or turned about an axis."""

from __future__ import annotations

import numpy as np
import pytest

from tests.needs import needs
from tests.shapes.solids import noisy, prism, turned
from turnscan.arrays import Floats
from turnscan.drawings import read_step
from turnscan.mesh import Mesh
from turnscan.shapes.patches._fit import Sample
from turnscan.shapes.patches._swept_surfaces import extruded_patch, turned_patch
from turnscan.workflows._inspection import _shapes
from turnscan.workflows._inspection._shapes import find_shapes

SIGMA = 0.01
TURN = np.linspace(0, 2 * np.pi, 140, endpoint=False)
LEAN = np.deg2rad(25.0)


def _leaning(mesh: Mesh) -> Mesh:
    c, s = np.cos(LEAN), np.sin(LEAN)
    R: Floats = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return Mesh(mesh.vertices @ R.T + [5.0, 2.0, 1.0], mesh.faces)


def _lobes() -> Mesh:
    r = 15 + 2.4 * np.sin(3 * TURN) + 1.2 * np.cos(5 * TURN)
    flat = zip(r * np.cos(TURN), r * np.sin(TURN), strict=True)
    return prism([(float(x), float(y)) for x, y in flat], 20, 0.8)


def _vase() -> Mesh:
    z = np.linspace(0, 30, 41)
    r = 12 + 2 * np.sin(z / 5) + np.sin(z / 2.2)
    wall = [(float(a), float(b)) for a, b in zip(r, z, strict=True)]
    return turned([(0.4, 0.0), *wall, (0.4, 30.0)], 0.8, 110)


@pytest.mark.parametrize(
    ("body", "entity"),
    [(_lobes, b"SURFACE_OF_LINEAR_EXTRUSION"), (_vase, b"SURFACE_OF_REVOLUTION")],
)
def test_a_swept_piece_has_faces_of_one_profile(
    body: object, entity: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    needs("OpenCASCADE")
    assert callable(body)
    mesh = _leaning(body())
    found = find_shapes(noisy(mesh, SIGMA, 1))
    assert found.swept
    monkeypatch.setattr(_shapes, "find_swept", None)  # what was found once is not looked for again
    step = found.step
    assert step.figures["faces_swept"] >= 2, step.findings
    assert step.figures["faces_swept"] >= step.figures["faces_bspline"]
    assert step.figures["triangles"] == 0
    assert step.data.count(entity) == step.figures["faces_swept"]
    # The tops of the lobes lie on cylinders, too, as far as the tolerance says.
    assert step.figures["deviation_rms_mm"] < 2 * SIGMA
    back = read_step(step.data, 0.05)
    assert back.valid
    if step.solid:
        assert back.volume == pytest.approx(mesh.volume, rel=2e-3)


def _sample(X: Floats, normals: Floats) -> Sample:
    every = np.ones(len(X), dtype=np.bool_)
    return Sample(X, normals, np.full(len(X), 0.01), every, every)


def test_an_extrusion_tells_how_far_points_are_off_it_and_where() -> None:
    s, t = (k.ravel() for k in np.meshgrid(np.linspace(-10, 10, 60), np.linspace(0, 8, 20)))
    X = np.column_stack([s, t, np.sin(s / 4)])
    normals = np.column_stack([-np.cos(s / 4) / 4, 0 * s, np.ones_like(s)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    way = np.array([0.0, 1.0, 0.0])
    patch = extruded_patch(_sample(X, normals), way, np.array([0.1, 0.3, 1.0]))
    assert patch is not None
    off, own = patch.offsets(X + 0.02 * normals)
    assert off == pytest.approx(0.02, abs=1e-3)
    assert np.einsum("ij,ij->i", own, normals).min() > 0.999
    assert patch.gaps(X).max() < 2e-3
    assert np.ptp(patch.parameters(X)[:, 1]) == pytest.approx(8.0)
    assert extruded_patch(_sample(X, normals), way, way) is None
    steep = normals[:, [2, 1, 0]]
    assert extruded_patch(_sample(X, steep), way, np.array([0.0, 0.0, 1.0])) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turned_piece_tells_how_far_points_are_off_it_and_where(side: float) -> None:
    turn, z = (k.ravel() for k in np.meshgrid(np.linspace(-0.7, 0.7, 30), np.linspace(0, 20, 50)))
    r, slope = 10 + np.sin(z / 4), np.cos(z / 4) / 4
    X = np.column_stack([r * np.cos(turn), r * np.sin(turn), z]) + [3.0, 1.0, -2.0]
    normals = side * np.column_stack([np.cos(turn), np.sin(turn), -slope])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    point, axis = np.array([3.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    patch = turned_patch(_sample(X, normals), point, axis)
    assert patch is not None
    assert patch.hollow == (side < 0)
    off, own = patch.offsets(X + 0.02 * normals)
    assert off == pytest.approx(0.02, abs=1e-3)
    assert np.einsum("ij,ij->i", own, normals).min() > 0.999
    u = patch.parameters(X)[:, 0]
    # The seam is on the far side.
    assert (u.min(), u.max()) == pytest.approx((np.pi - 0.7, np.pi + 0.7))
    ring = np.column_stack([10 * np.cos(9 * turn), 10 * np.sin(9 * turn), z]) + point
    assert turned_patch(_sample(ring, normals), point, axis) is None

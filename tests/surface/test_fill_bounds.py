"""Curvature in a filling corrects the plate and never swings: no worse than tangent anywhere."""

import numpy as np
import pytest

from turnscan.mesh import Mesh, submesh
from turnscan.surface.holes import fill, holes


def woven(points):
    """A mesh of points (n, m, 3) that go round in their first direction."""
    n, m, _ = points.shape
    i, j = np.meshgrid(np.arange(n), np.arange(m - 1), indexing="ij")
    a, b = i * m + j, (i + 1) % n * m + j
    faces = np.stack([a, b, b + 1, a, b + 1, a + 1], -1).reshape(-1, 3)
    return Mesh(points.reshape(-1, 3), faces.astype(np.int32))


def turned(radius, height, rng, noise, n=120, m=60):
    phi, t = 2 * np.pi * np.arange(n)[:, None] / n, np.linspace(0, 1, m)
    r = radius(t) + rng.normal(0, noise, (n, m))
    z = height(t) + 0 * r
    return woven(np.stack([r * np.cos(phi), r * np.sin(phi), z], -1))


def _ring(p):
    return np.hypot(np.hypot(p[:, 0], p[:, 1]) - 40, p[:, 2]) - 15


def _cup(z):
    return 30 + 5 * np.sin(z / 14)


def _torus(t):
    turn = 2 * np.pi * (0.02 + 0.96 * t)  # a slit on its outside
    return 40 + 15 * np.cos(turn), 15 * np.sin(turn)


FORMS = {
    "ball": (
        (lambda t: 30 * np.cos(2.2 * t - 1.1), lambda t: 30 * np.sin(2.2 * t - 1.1)),
        lambda p: np.linalg.norm(p, axis=1) - 30,
        (30, 0, 0),
    ),
    "cup": (
        (lambda t: _cup(60 * t), lambda t: 60 * t),
        lambda p: np.hypot(p[:, 0], p[:, 1]) - _cup(p[:, 2]),
        (32, 0, 30),
    ),
    "cone": (
        (lambda t: 35 - 25 * t, lambda t: 50 * t),
        lambda p: (np.hypot(p[:, 0], p[:, 1]) - 35 + p[:, 2] / 2) / np.hypot(1, 0.5),
        (22, 0, 25),
    ),
    "torus": ((lambda t: _torus(t)[0], lambda t: _torus(t)[1]), _ring, (-25, 0, 0)),
}


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_curvature_is_no_further_from_the_truth_than_tangent(form, noise):
    (radius, height), off, at = FORMS[form]
    mesh = turned(radius, height, np.random.default_rng(7), noise)
    mesh = submesh(mesh, np.linalg.norm(mesh.triangles.mean(axis=1) - at, axis=1) > 9)
    hole = min(holes(mesh), key=lambda h: np.linalg.norm(h.centre - at))
    far = {}
    for how in ("tangent", "curvature"):
        done = fill(mesh, [hole], how)
        assert not np.array_equal(done.vertices, mesh.vertices)
        far[how] = np.abs(off(done.vertices[len(mesh.vertices) :])).max()
    assert far["curvature"] <= far["tangent"] + 0.01 + 0.1 * noise


def test_over_an_edge_curvature_has_nothing_to_say():
    """The open top of a cup: the border's curvature is that of its rim."""
    mesh = turned(lambda t: _cup(60 * t), lambda t: 60 * t, np.random.default_rng(7), 0.1)
    rim = [h for h in holes(mesh) if h.centre[2] > 30]
    one, other = fill(mesh, rim, "tangent"), fill(mesh, rim, "curvature")
    assert np.array_equal(one.vertices, other.vertices)

"""True edges: where shapes meet, how round they are, and a mesh that has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.shapes.solids import noisy, prism, turned
from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance, boundary_loops
from turnscan.shapes.primitives import Edge, ShapeSet, Sharpened, find_edges, find_shapes, sharpened
from turnscan.shapes.primitives._sharpened import split_faces

SIGMA = 0.02
TURN = 0.011
"""Radians by which the prism's edges miss the vertices of the mesh."""
FLATS = 40.0
STEPS = 200


def _made(mesh: Mesh, **options: float) -> tuple[ShapeSet, tuple[Edge, ...]]:
    found = find_shapes(mesh, **options)  # type: ignore[arg-type]
    return found, find_edges(mesh, found)


def _off_hexagon(points: Floats) -> Floats:
    """Signed distances from the prism's sides."""
    k = np.arange(6) * np.pi / 3 + TURN + np.pi / 6
    off: Floats = (points[:, :2] @ np.stack([np.cos(k), np.sin(k)]) - FLATS / 2).max(axis=1)
    return off


@pytest.fixture(scope="module")
def hexagon() -> Mesh:
    """As a turntable sees a hexagonal prism: columns every 1.8°, which miss its edges."""
    t = np.arange(STEPS) * (2 * np.pi / STEPS)
    r = FLATS / 2 / np.cos((t - TURN) % (np.pi / 3) - np.pi / 6)
    outline = list(zip(r * np.cos(t), r * np.sin(t), strict=True))
    mesh = noisy(prism(outline, 20, 0.5), SIGMA, 1)
    n = len(mesh.vertices)
    whole = np.arange(n, dtype=np.int32)
    origin = Provenance(np.full(n, SIGMA), 0 * whole, whole, whole, ("red",))
    return replace(mesh, provenance=origin)


@pytest.fixture(scope="module")
def sharp(hexagon: Mesh) -> Sharpened:
    found, edges = _made(hexagon)
    assert [(e.form, e.convex) for e in edges] == 6 * [("sharp", True)]
    assert np.degrees([e.angle for e in edges]) == pytest.approx(6 * [60], abs=0.1)
    assert all(0 < e.sigma < 1 for e in edges)
    return sharpened(hexagon, found, edges)


def _near_edges(points: Floats) -> Floats:
    corners = FLATS / 3**0.5 * np.exp(1j * (np.arange(6) * np.pi / 3 + TURN))
    at = points[:, 0] + 1j * points[:, 1]
    near: Floats = np.abs(at[:, None] - corners).min(axis=1)
    return near


def test_the_edges_of_a_prism_stand_where_its_sides_meet(hexagon: Mesh, sharp: Sharpened) -> None:
    middles = [m.triangles.mean(axis=1) for m in (hexagon, sharp.mesh)]
    before, after = (np.sqrt(np.mean(_off_hexagon(m[_near_edges(m) < 0.6]) ** 2)) for m in middles)
    assert before > 0.05  # faces cut the corner
    assert after < 0.004
    edge = sharp.mesh.vertices[sharp.on_edge]
    assert len(edge) > 6 * 40
    assert np.sqrt(np.mean(_off_hexagon(edge) ** 2)) < 0.003
    assert _near_edges(edge).max() < 0.01
    assert sharp.left == 0


def test_what_is_constructed_is_marked_and_the_rest_stays(hexagon: Mesh, sharp: Sharpened) -> None:
    origin = sharp.mesh.provenance
    assert origin is not None
    np.testing.assert_array_equal(origin.laser < 0, sharp.constructed)
    np.testing.assert_array_equal(origin.step < 0, sharp.constructed)
    assert (origin.sigma[sharp.constructed] > 0).all()
    assert (origin.sigma[sharp.constructed] < SIGMA / 3).all()
    own = np.flatnonzero(~sharp.constructed)
    assert 0.6 * len(hexagon.vertices) < len(own) < 0.95 * len(hexagon.vertices)
    np.testing.assert_array_equal(sharp.mesh.vertices[own], hexagon.vertices[own])
    assert len(boundary_loops(sharp.mesh)) == len(boundary_loops(hexagon)) == 2


def test_no_vertex_is_laid_beyond_an_edge_where_a_face_would_fold(hexagon: Mesh) -> None:
    """Rows that end at different places beside an edge, some of them behind it: those that could
    not be pulled onto it stayed on the side's plane, outside of the part."""
    X = hexagon.vertices.copy()
    near = np.flatnonzero(_near_edges(X) < 1.0)
    k = np.arange(6) * np.pi / 3 + TURN + np.pi / 6
    out = np.stack([np.cos(k), np.sin(k)])
    n = out[:, (X[near, :2] @ out).argmax(axis=1)].T
    way = np.random.default_rng(3).normal(0, 0.6, len(near))
    X[near, :2] += way[:, None] * np.column_stack([-n[:, 1], n[:, 0]])
    ragged = replace(hexagon, vertices=X)
    found, edges = _made(ragged)
    done = sharpened(ragged, found, edges)
    off = _off_hexagon(done.mesh.vertices[done.constructed])
    assert len(off) > 1000
    assert off.max() < 0.02
    assert 0.001 < np.sqrt(np.mean(off**2)) < 0.006


def _rounded(radius: float, half: float = 20.0) -> list[tuple[float, float]]:
    """A square with rounded corners, counter-clockwise."""
    out = []
    for k in range(4):
        turn = (k + np.linspace(0, 1, round(radius * np.pi / 2 / 0.3) + 1)) * np.pi / 2
        middle = (half - radius) * np.sqrt(2) * np.exp(1j * (k + 0.5) * np.pi / 2)
        out += [(z.real, z.imag) for z in middle + radius * np.exp(1j * turn)]
    return out


def _cut(leg: float, half: float = 20.0) -> list[tuple[float, float]]:
    """A square with chamfered corners, counter-clockwise."""
    side = np.array([complex(half, -half + leg), complex(half, half - leg)])
    every = (side * 1j**k for k in range(4))
    return [(z.real, z.imag) for pair in every for z in pair]


@pytest.mark.parametrize("own", [True, False])
def test_fillets_are_told_and_not_sharpened(own: bool) -> None:
    """``own``: as a shape of its own, and where it is too small to be one."""
    mesh = noisy(prism(_rounded(2.0), 20, 0.4), SIGMA, 2)
    found, edges = _made(mesh, smallest=0.003 if own else 0.1)
    assert [e.form for e in edges] == 4 * ["fillet"]
    assert [e.blend is not None for e in edges] == 4 * [own]
    off = [(e.size - 2.0) / e.sigma for e in edges]
    assert np.abs(off).max() < 4
    assert max(e.sigma for e in edges) < 0.02
    done = sharpened(mesh, found, edges)
    np.testing.assert_array_equal(done.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(done.mesh.faces, mesh.faces)
    assert not done.constructed.any()


def test_chamfers_are_told_and_not_sharpened() -> None:
    mesh = noisy(prism(_cut(1.5), 20, 0.4), SIGMA, 3)
    found, edges = _made(mesh, smallest=0.1)
    assert [e.form for e in edges] == 4 * ["chamfer"]
    assert max(abs(e.size - 1.5) / e.sigma for e in edges) < 4
    assert not sharpened(mesh, found, edges).constructed.any()
    _, apart = _made(mesh)  # with the chamfers as shapes, it has eight edges
    assert [e.form for e in apart] == 8 * ["sharp"]


@pytest.mark.parametrize(("stated", "form"), [(SIGMA, "chamfer"), (0.1, "chamfer"), (1.2, "sharp")])
def test_what_points_between_profiles_may_be_off_by_is_no_chamfer(stated: float, form: str) -> None:
    """Chords from profile to profile cut an edge off as a chamfer does; there each of many points
    states that it may lie by as much elsewhere, and all of them alike."""
    mesh = noisy(prism(_cut(1.5), 20, 0.4), SIGMA, 3)
    across = np.abs(mesh.vertices[:, 0]) + np.abs(mesh.vertices[:, 1])
    sigma = np.where(across > 40.0 - 1.5 - 5 * SIGMA, stated, SIGMA)
    whole = np.arange(len(sigma), dtype=np.int32)
    origin = Provenance(sigma, 0 * whole, whole, whole, ("red",))
    _, edges = _made(replace(mesh, provenance=origin), smallest=0.1)
    assert [e.form for e in edges] == 4 * [form]
    if form == "sharp":
        assert all(e.sigma == pytest.approx(1.5, abs=0.1) for e in edges), "it may be so large"


def test_inner_edges_are_told_from_outer() -> None:
    step = turned([(20, 0), (20, 12), (12, 12), (12, 25)], 0.5, 150)
    mesh = noisy(step, SIGMA, 4)
    found, edges = _made(mesh)
    assert sorted((e.form, e.convex) for e in edges) == [("sharp", False), ("sharp", True)]
    done = sharpened(mesh, found, edges)
    at = done.mesh.vertices[done.on_edge]
    r, z = np.hypot(at[:, 0], at[:, 1]), at[:, 2]
    corner = np.where(r > 16, 20.0, 12.0)
    assert np.abs(r - corner).max() < 0.01
    assert np.abs(z - 12).max() < 0.01


@given(st.data())
def test_cut_faces_cover_what_the_whole_ones_did(data: st.DataObject) -> None:
    n = 4
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n)))
    X = np.column_stack([i, j]).astype(float)
    low = np.array([k for k in range(n * n) if k % n < n - 1 and k // n < n - 1])
    faces = np.concatenate(
        [np.column_stack([low, low + 1, low + n]), np.column_stack([low + 1, low + n + 1, low + n])]
    )
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    sides = np.unique(sides, axis=0)
    some = np.array(data.draw(st.lists(st.booleans(), min_size=len(sides), max_size=len(sides))))
    a, b = sides[some].T.astype(np.int64)
    out, parent, middles = split_faces(faces, a, b, len(X))
    X = np.concatenate([X, (X[a] + X[b]) / 2, X[faces[middles]].mean(axis=1)])

    def doubled(f: np.ndarray) -> np.ndarray:
        u, v = X[f[:, 1]] - X[f[:, 0]], X[f[:, 2]] - X[f[:, 0]]
        return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]

    assert (doubled(out) > 0).all()
    covered = np.bincount(parent, doubled(out), minlength=len(faces))
    np.testing.assert_allclose(covered, doubled(faces))
    ends = np.concatenate([out[:, [0, 1]], out[:, [1, 2]], out[:, [2, 0]]])
    assert len(np.unique(ends, axis=0)) == len(ends)  # no side twice the same way

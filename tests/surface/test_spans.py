"""Only a border that another one faces over a smooth arc bounds a gap in one surface."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance
from turnscan.mesh._normals import vertex_normals
from turnscan.surface.holes import Hole, holes
from turnscan.surface.holes._spans import smoothed, spanned, unit, walled

R, HIGH = 20.0, 40.0
APART = 2.0
"""mm from vertex to vertex."""


def _tube(gap: tuple[float, float] | None) -> Mesh:
    """An open cylinder about z, faces outward, without a window of these limits of angle."""
    turn = np.linspace(0.0, 2 * np.pi, 73)[:-1]
    z = np.linspace(0.0, HIGH, 21)
    t, h = np.meshgrid(turn, z)
    vertices = np.stack([R * np.cos(t), R * np.sin(t), h], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(20), np.arange(72), indexing="ij"))
    if gap is not None:
        out = (turn[j] > gap[0]) & (turn[j] < gap[1]) & (i > 4) & (i < 15)
        i, j = i[~out], j[~out]
    a, b = i * 72 + j, i * 72 + (j + 1) % 72
    c, d = a + 72, b + 72
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)]).astype(np.int32)
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _shares(mesh: Mesh) -> Floats:
    """Of the lower end, the window, the upper end."""
    found = sorted(holes(mesh), key=lambda h: h.centre[2])
    return spanned(mesh, found, APART, vertex_normals(mesh))


def test_the_ends_of_a_tube_face_nothing() -> None:
    share = _shares(_tube(None))
    assert share.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("wide", [0.4, 1.2, 2.2])
def test_a_window_is_faced_all_round(wide: float) -> None:
    share = _shares(_tube((1.0, 1.0 + wide)))
    assert share[1] > 0.9
    assert share[[0, 2]].max() == 0.0


def _scattered(mesh: Mesh, sigma: float, part: float) -> Mesh:
    """A ``part`` of the vertices at the window lie off by 4 mm of scatter, and state ``sigma`` mm;
    the others 0.1 mm."""
    window = sorted(holes(mesh), key=lambda h: h.centre[2])[1]
    n, rng = len(mesh.vertices), np.random.default_rng(6)
    off = np.zeros(n)
    loop = window.loop[: round(part * len(window.loop))]
    off[loop] = rng.normal(0.0, 4.0, len(loop))
    stated = np.full(n, 0.1)
    stated[loop] = sigma
    none = np.zeros(n, np.int32)
    out = mesh.vertices * [1.0, 1.0, 0.0] / R
    return Mesh(
        mesh.vertices + off[:, None] * out, mesh.faces,
        provenance=Provenance(stated, none, none, none, ("L",)),
    )  # fmt: skip


def test_corners_that_are_known_badly_say_nothing() -> None:
    window = _tube((1.0, 1.3))
    trusted, doubted = (_shares(_scattered(window, s, 0.5))[1] for s in (0.1, 1.5))
    assert trusted < 0.75 < 0.9 < doubted


def test_where_hardly_any_corner_is_known_well_all_count() -> None:
    window = _tube((1.0, 1.3))
    trusted, doubted = (_shares(_scattered(window, s, 0.9))[1] for s in (0.1, 1.5))
    assert trusted == doubted < 0.75


def _plate(deep: float) -> Mesh:
    """A plate with a square window, 10 mm wide, from one of whose sides a wall goes down ``deep``
    mm, facing into it."""
    n, first, last = 31, 10, 20
    x, y = (a.ravel().astype(float) for a in np.meshgrid(np.arange(n), np.arange(n)))
    vertices = np.stack([x, y, 0.0 * x], axis=-1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij"))
    kept = (i < first) | (i >= last) | (j < first) | (j >= last)
    i, j = i[kept], j[kept]
    a, b, c, d = i * n + j, i * n + j + 1, (i + 1) * n + j, (i + 1) * n + j + 1
    faces = [np.stack([a, b, d], -1), np.stack([a, d, c], -1)]
    if deep:
        rim = first * n + np.arange(first, last + 1)
        foot = len(vertices) + np.arange(len(rim))
        vertices = np.concatenate([vertices, vertices[rim] - (0.0, 0.0, deep)])
        a, b, c, d = rim[:-1], rim[1:], foot[:-1], foot[1:]
        faces += [np.stack([a, b, d], -1), np.stack([a, d, c], -1)]
    used, faces = np.unique(np.concatenate(faces), return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _walled(mesh: Mesh, hole: Hole) -> float:
    return float(walled(mesh, [hole], vertex_normals(mesh))[0])


@pytest.mark.parametrize(("deep", "share"), [(0.0, 0.0), (2.0, 0.3), (4.0, 0.3)])
def test_a_wall_that_goes_down_into_a_hole_is_a_part_of_its_border(
    deep: float, share: float
) -> None:
    mesh = _plate(deep)
    hole = min(holes(mesh), key=lambda h: h.size)
    assert _walled(mesh, hole) == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize("wide", [0.4, 1.2, 1.5])
def test_about_a_place_on_a_round_or_a_hollow_face_no_wall_looks_into_it(wide: float) -> None:
    round_one = _tube((1.0, 1.0 + wide))
    hollow = Mesh(round_one.vertices, round_one.faces[:, ::-1])
    for mesh in (round_one, hollow):
        window = sorted(holes(mesh), key=lambda h: h.centre[2])[1]
        assert spanned(mesh, [window], APART, vertex_normals(mesh))[0] > 0.9
        assert _walled(mesh, window) == 0.0


def test_the_sums_go_round_the_border_and_nothing_has_no_direction() -> None:
    assert smoothed(np.eye(6)[:, :3]).sum() == pytest.approx(15.0)
    assert unit(np.array([[0.0, 3.0, 4.0], [0.0, 0.0, 0.0]])).tolist() == [[0, 0.6, 0.8], [0, 0, 0]]

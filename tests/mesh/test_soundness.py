"""What is not sound is found, with place and number; sound meshes pass."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mesh.open_meshes import ball, plate
from turnscan.mesh import Mesh, _soundness, crossings, join, opposite_half_edges, soundness

CUBE = Mesh(
    np.array([[x, y, z] for z in (0.0, 1) for y in (0, 1) for x in (0, 1)]),
    np.array([
        [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
        [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
    ]),
)  # fmt: skip


def moved(mesh: Mesh, *by: float) -> Mesh:
    return Mesh(mesh.vertices + by, mesh.faces)


def codes(mesh: Mesh) -> list[str]:
    return [f.code for f in soundness(mesh)]


def brute(mesh: Mesh) -> set[tuple[int, int]]:
    """Pairs without a common vertex where a side of one runs through the other."""

    def through(p, q, a, b, c):
        n = np.cross(b - a, c - a)
        s, t = n @ (p - a), n @ (q - a)
        if s * t >= 0:
            return False
        x = p + s / (s - t) * (q - p)
        return all(n @ np.cross(v - u, x - u) > 0 for u, v in ((a, b), (b, c), (c, a)))

    found = set()
    t = mesh.triangles
    for i in range(len(t)):
        for j in range(i + 1, len(t)):
            if set(mesh.faces[i]) & set(mesh.faces[j]):
                continue
            for one, other in ((t[i], t[j]), (t[j], t[i])):
                if any(through(one[k], one[(k + 1) % 3], *other) for k in range(3)):
                    found.add((i, j))
    return found


def test_a_cube_and_a_plate_are_sound():
    assert CUBE.volume == pytest.approx(1.0)
    assert soundness(CUBE) == []
    assert soundness(plate(5)) == []
    assert soundness(Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))) == []


@pytest.mark.parametrize("many", [0, 10**6], ids=["in parts", "at once"])
def test_all_pairs_that_cut_through_each_other_are_found(many, monkeypatch):
    monkeypatch.setattr(_soundness, "_MANY", many)
    rng = np.random.default_rng(3)
    corners = rng.random((180, 3))
    soup = Mesh(corners, np.arange(180).reshape(60, 3))
    found = {(int(a), int(b)) for a, b in crossings(soup)}
    assert len(found) > 100
    assert found == brute(soup)
    asked = np.zeros(60, bool)
    asked[[3, 40]] = True
    some = {(int(a), int(b)) for a, b in crossings(soup, asked)}
    assert some == {pair for pair in found if {3, 40} & set(pair)}


def test_fans_that_are_left_out_have_no_pairs(monkeypatch):
    from turnscan.mesh import _crossing_kernels as kernels

    rng, left_out, beside = np.random.default_rng(5), 0, 0
    for crumpled in np.linspace(0.0, 0.7, 24):
        for smooth in (plate(15), ball(16)):
            usual = np.linalg.norm(np.diff(smooth.triangles[:, :2], axis=1), axis=-1).mean()
            places = smooth.vertices + crumpled * usual * rng.normal(size=smooth.vertices.shape)
            mesh = Mesh(places, smooth.faces)
            found = crossings(mesh)
            twin = opposite_half_edges(mesh.faces)
            left_out += int(kernels.plain_fans(mesh.vertices, mesh.faces, twin).sum())
            with monkeypatch.context() as looking_at_all:
                none = np.zeros(len(places), dtype=np.bool_)
                looking_at_all.setattr(kernels, "plain_fans", lambda *mesh, none=none: none)
                assert np.array_equal(crossings(mesh), found)
            beside += sum(bool(set(mesh.faces[a]) & set(mesh.faces[b])) for a, b in found)
    assert left_out > 2000
    assert beside > 200, "crumpled enough that faces about one vertex cut each other"


@pytest.mark.parametrize("many", [0, 10**6], ids=["in parts", "at once"])
def test_a_heap_of_loose_faces_is_searched_up_to_a_limit(many, monkeypatch):
    monkeypatch.setattr(_soundness, "_MANY", many)
    corners = np.random.default_rng(4).random((6000, 3))
    heap = Mesh(corners, np.arange(6000).reshape(2000, 3))
    assert len(crossings(heap)) == 16 * 2000
    crossed = next(f for f in soundness(heap) if f.code == "surface.crossing")
    assert crossed.message == "32000 pairs of intersecting faces, or more"


def test_cubes_that_cut_through_each_other():
    two = join([CUBE, moved(CUBE, 0.5, 0.3, 0.2)])
    (finding,) = soundness(two)
    assert finding.code == "surface.crossing"
    assert f"{len(crossings(two))} pairs" in finding.message
    assert "mm, the first of" in finding.where
    assert soundness(join([CUBE, moved(CUBE, 1.5, 0.3, 0.2)])) == []


def test_faces_in_one_plane_that_overlap():
    lying = Mesh([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 1, 0], [3, 1, 0], [1, 3, 0.0]], [[0, 1, 2]])
    over = Mesh(
        lying.vertices - [0.5, 0.5, 0] * np.repeat([[0], [1]], 3, 0), [[0, 1, 2], [3, 4, 5]]
    )
    assert codes(over) == ["surface.crossing"]
    beside = Mesh(lying.vertices + [0.5, 0.5, 0] * np.repeat([[0], [1]], 3, 0), over.faces)
    assert soundness(beside) == []


def test_a_face_folded_back_onto_its_neighbour():
    folded = Mesh([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, 0]], [[0, 1, 2], [1, 0, 3]])
    assert "surface.crossing" in codes(folded)
    opened = Mesh([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, -0.5, 0]], [[0, 1, 2], [1, 0, 3]])
    assert soundness(opened) == []


def test_sides_vertices_winding_places_and_areas():
    fin = Mesh([*CUBE.vertices, [0.5, 0.0, -1.0]], [*CUBE.faces, [0, 1, 8]])
    assert "surface.side" in codes(fin)
    assert "surface.orientation" in codes(Mesh(CUBE.vertices, [[0, 1, 2], *CUBE.faces[1:]]))
    corner = Mesh(
        [*CUBE.vertices, *(CUBE.vertices[1:] + 1.0)],
        [*CUBE.faces, *np.where(CUBE.faces == 0, 7, CUBE.faces + 7)],
    )
    assert codes(corner) == ["surface.touching"]
    assert codes(join([CUBE, moved(CUBE, 1.0, 1.0, 1.0)])) == ["surface.equal"]
    thin = Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0.0]], [[0, 1, 2], [0, 2, 3]])
    assert "surface.degenerate" in codes(thin)


def test_pairs_do_not_depend_on_the_order_of_the_faces():
    rng = np.random.default_rng(8)
    for count in (12, 40):
        vertices = rng.random((count, 3))
        faces = np.array([rng.permutation(count)[:3] for _ in range(60)])
        pairs = crossings(Mesh(vertices, faces))
        turned = 59 - crossings(Mesh(vertices, faces[::-1]))[:, ::-1]
        assert 50 < len(pairs) < 16 * 60
        assert {*map(tuple, pairs.tolist())} == {*map(tuple, turned.tolist())}


def test_equal_places_are_those_of_used_vertices_in_32_bits():
    rng = np.random.default_rng(9)
    vertices = rng.integers(-2, 3, (200, 3)) * 0.1
    vertices[::7] *= 1.0 + 1e-12
    vertices[::5] *= -1.0  # −0 is 0
    faces = rng.integers(0, 150, (80, 3))
    used = np.unique(faces)
    places = vertices[used].astype(np.float32) + np.float32(0)
    _, first = np.unique(places, axis=0, return_index=True)
    again = np.delete(vertices[used], first, axis=0)
    (finding,) = (f for f in soundness(Mesh(vertices, faces)) if f.code == "surface.equal")
    x, y, z = again[0]
    assert finding.message == f"{len(again)} duplicate vertices"
    assert finding.where.startswith(f"({x:.2f}, {y:.2f}, {z:.2f}) mm")

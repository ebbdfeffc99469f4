"""Shapes: found where they are, known as well as they say, and none where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.shapes.solids import averaged, noisy, prism, turned
from turnscan.errors import InputError
from turnscan.mesh import Mesh, Provenance, vertex_normals
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives import find_shapes, neighbours_of, sizes_between

SIGMA = 0.02
SHAFT = [(0.5, 0), (25, 0), (25, 20), (15, 20), (15, 45), (10, 50), (10, 65), (0.5, 65)]


@pytest.fixture(scope="module")
def shaft():
    return turned(SHAFT, 0.6, 180)


def test_a_stepped_shaft_is_three_cylinders_a_cone_and_three_planes(shaft):
    mesh = noisy(shaft, SIGMA, 1)
    found = find_shapes(mesh)
    kinds = sorted(s.kind for s in found.shapes)
    assert kinds == ["cone"] + 3 * ["cylinder"] + 3 * ["plane"]
    assert found.coverage > 0.95
    radii = sorted(s.radius for s in found.of("cylinder"))
    assert np.allclose(radii, [10, 15, 25], atol=0.004)
    (cone,) = found.of("cone")
    assert abs(abs(cone.second) - np.pi / 4) < 4 * cone.second_sigma + 1e-4
    assert not any(s.hollow for s in found.shapes)
    # Of six pairs, each inside its uncertainty in 95 of 100 cases, and what others then imply.
    others = [find_shapes(noisy(shaft, SIGMA, seed)) for seed in (2, 3)]
    coaxial = [r for f in (found, *others) for r in f.relations if r.kind == "coaxial"]
    assert len(coaxial) >= 8
    assert np.nanmax(np.abs(found.residual)) <= found.tolerance * 1.05
    assert 0.8 * SIGMA < np.nanstd(found.residual) < 1.2 * SIGMA
    heights = sorted(round(s.value, 2) for s in sizes_between(mesh, found) if s.kind == "distance")
    assert heights == pytest.approx([20, 45, 65], abs=0.02)
    apart = [s for s in sizes_between(mesh, found) if s.kind == "axis distance"]
    assert len(apart) == 6, "coaxial as adopted, and still told how far apart they were measured"
    assert all(0 < s.value < 4 * s.sigma and 0 < s.sigma < 0.02 for s in apart)


def test_uncertainties_cover_the_truth(shaft):
    """E_n over seeds: what is said to be 1 sigma is neither half of it nor twice."""
    z = []
    for seed in range(6):
        found = find_shapes(noisy(shaft, SIGMA, 10 + seed), relations=False)
        for s in found.of("cylinder"):
            truth = min((10, 15, 25), key=lambda r, s=s: abs(r - s.radius))
            z.append((s.radius - truth) / s.radius_sigma)
            z.append(s.axis[0] / np.sqrt(s.covariance[0, 0]))
    assert len(z) == 36
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_a_sphere_and_a_torus_are_one_shape_each():
    t = np.linspace(-1.4, 1.4, 120)
    ball = turned([(20 * np.cos(a), 20 * np.sin(a)) for a in t], 0.5, 150)
    found = find_shapes(noisy(ball, SIGMA, 2))
    assert [s.kind for s in found.shapes] == ["sphere"]
    assert found.shapes[0].radius == pytest.approx(20, abs=0.003)
    t = np.linspace(-np.pi, np.pi, 130)
    ring = turned([(30 + 10 * np.cos(a), 10 * np.sin(a)) for a in t], 0.5, 260)
    found = find_shapes(noisy(ring, SIGMA, 3))
    assert found.shapes[0].kind == "torus"
    assert found.shapes[0].area > 0.95 * ring.area_of()
    assert found.shapes[0].radius == pytest.approx(30, abs=0.005)
    assert found.shapes[0].second == pytest.approx(10, abs=0.005)


HEXAGON = [(23 * np.cos(a), 23 * np.sin(a)) for a in np.arange(6) * np.pi / 3]


@pytest.mark.parametrize("sigma", [0.05, 0.1])
def test_planes_are_found_where_merging_left_neighbours_off_together(sigma):
    """And what their places are known to is what they are off by."""
    z = []
    for seed in range(3):
        mesh = averaged(prism(HEXAGON, 40, 0.7), sigma, seed)
        found = find_shapes(mesh, relations=False)
        assert [s.kind for s in found.shapes] == 6 * ["plane"]
        assert found.coverage > 0.9
        for s in found.shapes:
            side = np.pi / 6 + np.pi / 3 * np.arange(6)
            middle = 23 * np.sqrt(3) / 2 * np.column_stack([np.cos(side), np.sin(side)])
            true = np.append(middle[np.argmax(middle @ s.axis[:2])], 20.0)
            z.append(float((true - s.point) @ s.axis) / np.sqrt(s.covariance[4, 4]))
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.7


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [0.05, 0.1])
def test_cylinders_are_found_where_merging_left_neighbours_off_together(seed, sigma):
    end = [(25, 0), (25, 20), (15, 20), (15, 45)]
    found = find_shapes(averaged(turned(end, 0.7, 160), sigma, seed))
    assert sorted(s.kind for s in found.shapes) == ["cylinder", "cylinder", "plane"]
    for s, radius in zip(
        sorted(found.of("cylinder"), key=lambda s: s.radius), (15, 25), strict=True
    ):
        assert s.radius == pytest.approx(radius, abs=4 * s.radius_sigma)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [0.05, 0.1])
def test_no_shape_is_found_on_freeform_whose_neighbours_are_off_together(seed, sigma):
    t = np.linspace(-1.3, 1.3, 120)
    wall = turned([(30 + 6 * np.sin(2.2 * a) + 3 * a * a, 40 * a) for a in t], 0.7, 220)
    angle = np.arctan2(wall.vertices[:, 1], wall.vertices[:, 0])
    lobes = 1 + 0.06 * np.cos(3 * angle + 0.05 * wall.vertices[:, 2])
    body = Mesh(wall.vertices * np.column_stack([lobes, lobes, np.ones_like(lobes)]), wall.faces)
    assert not find_shapes(averaged(body, sigma, seed)).shapes


def test_a_narrow_chamfer_is_a_cone_and_no_sphere():
    """A ring of 1.4 mm lies on a sphere of ⌀ 68, too: what is not seen is not said."""
    end = [(25, 0), (25, 20), (24, 21), (5, 21)]
    found = find_shapes(noisy(turned(end, 0.35, 200), 0.06, 2))
    assert sorted(s.kind for s in found.shapes) == ["cone", "cylinder", "plane"]


def _keyed(radius: float, half: float, deep: float, seed: int) -> Mesh:
    """A shaft with a keyway as one laser sees it: from one side only, stripes bent over its edge
    along a ramp from the edge to the floor, every second of those points with its sigma."""
    turn = np.arcsin(half / radius)
    around = np.linspace(turn, 2 * np.pi - turn, 500)
    arc = [(radius * np.cos(a), radius * np.sin(a)) for a in around]
    floor = radius - deep
    foot = -half + 0.6 * deep
    mesh = prism([*arc, (floor, foot), (floor, half - 0.3)], 30, 0.5)
    X = mesh.vertices
    middle = X[mesh.faces].mean(axis=1)
    shadow = (middle[:, 0] > floor + 0.05) & (np.abs(middle[:, 1] - half) < 0.35)
    ramp = (np.abs(X[:, 1]) < half - 0.01) & (X[:, 0] > floor + 0.01)
    sigma = np.where(ramp & (np.arange(len(X)) % 2 == 0), 0.5, 0.1)
    n = len(X)
    number = np.arange(n, dtype=np.int32)
    origin = Provenance(sigma, 0 * number, number, number, ("red",))
    return replace(noisy(Mesh(X, mesh.faces[~shadow]), 0.1, seed), provenance=origin)


@pytest.mark.parametrize(("radius", "half", "deep"), [(18, 4, 4), (30, 7, 5)])
def test_a_keyway_is_its_floor_and_what_bends_over_its_edge_is_no_shape(radius, half, deep):
    found = find_shapes(_keyed(radius, half, deep, 1))
    assert [s.kind for s in found.shapes] == ["cylinder", "plane"]
    shaft, floor = found.shapes
    assert shaft.radius == pytest.approx(radius, abs=4 * shaft.radius_sigma)
    assert np.degrees(np.arccos(floor.axis[0])) < 0.5
    assert floor.point[0] == pytest.approx(radius - deep, abs=0.03)


def test_a_whole_face_that_is_known_five_times_worse_is_found():
    """A sigma that differs from face to face, as with paint or slope, is no sign of an edge."""
    box = prism([(0, 0), (40, 0), (40, 30), (0, 30)], 30, 0.8)
    n = np.nan_to_num(vertex_normals(box))
    sigma = np.where(n[:, 0] > 0.9, 5 * SIGMA, SIGMA)
    number = np.zeros(len(sigma), dtype=np.int32)
    origin = Provenance(sigma, number, number, number, ("red",))
    dice = np.random.default_rng(3).normal(size=len(sigma)) * sigma
    mesh = Mesh(box.vertices + n * dice[:, None], box.faces, provenance=origin)
    found = find_shapes(mesh)
    assert [s.kind for s in found.shapes] == 4 * ["plane"]
    (worse,) = [s for s in found.shapes if s.axis[0] > 0.9]
    assert worse.rms == pytest.approx(5 * SIGMA, rel=0.1)


@pytest.mark.parametrize(("worse", "planes"), [(1.0, 5), (3.0, 4)])
def test_a_band_of_few_stripes_that_are_known_badly_is_no_face(worse, planes):
    """Beside an edge stripes are bent alike all along it, and lie as smoothly as on a chamfer."""
    outline = [(0, 0), (40, 0), (40, 28), (37.6, 30), (0, 30)]
    body = prism(outline, 30, 0.8)
    X = body.vertices
    band = (X[:, 0] > 37.61) & (X[:, 1] > 28.01)
    where = np.round(X[:, :2], 6)
    stripe = np.unique(where, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int32)
    assert len(np.unique(stripe[band])) < 8
    sigma = np.where(band, worse * SIGMA, SIGMA)
    none = np.zeros(len(X), dtype=np.int32)
    origin = Provenance(sigma, none, stripe, none, ("red",))
    dice = np.random.default_rng(5).normal(size=len(X)) * sigma
    moved = X + np.nan_to_num(vertex_normals(body)) * dice[:, None]
    found = find_shapes(Mesh(moved, body.faces, provenance=origin))
    assert [s.kind for s in found.shapes] == planes * ["plane"]


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_invented_and_nothing_missed_in_random_turned_parts(seed):
    """Three steps of any size, some chamfered, lying in any way, bored through or not."""
    dice = np.random.default_rng(seed)
    radii = np.sort(dice.uniform(4, 8, 3).cumsum() + 4)[::-1]
    profile, z, cones, floors = [(radii[0], 0.0)], 0.0, 0, 0
    for k, r in enumerate(radii):
        z += float(dice.uniform(12, 20))
        inner = radii[k + 1] if k < 2 else 3.5
        cut = float(dice.uniform(2, 3)) if dice.random() < 0.5 and r - inner > 5 else 0.0
        cones += cut > 0
        floors += 1
        profile += [(r, z - cut), (r - cut, z), (inner, z)] if cut else [(r, z), (inner, z)]
    bored = bool(seed % 2)
    profile += [(3.5, 0.0)] if bored else []
    noise = float(dice.uniform(0.01, 0.05))
    mesh = noisy(turned(profile, 0.6, 150), noise, seed)
    turn = Rotation.from_rotvec(dice.uniform(-2, 2, 3)).as_matrix()
    found = find_shapes(Mesh(mesh.vertices @ turn.T + dice.uniform(-50, 50, 3), mesh.faces))
    kinds = [s.kind for s in found.shapes]
    assert kinds.count("cylinder") == 3 + bored
    assert kinds.count("plane") == floors
    assert kinds.count("cone") == cones
    assert len(kinds) == 3 + bored + floors + cones
    true = np.sort([*radii, *([3.5] if bored else [])])
    measured = sorted(found.of("cylinder"), key=lambda s: s.radius)
    z_scores = [(s.radius - r) / s.radius_sigma for s, r in zip(measured, true, strict=True)]
    assert np.abs(z_scores).max() < 5
    assert [s.hollow for s in measured] == [bored and k == 0 for k in range(len(measured))]


def test_points_that_are_known_badly_hide_no_face() -> None:
    mesh = prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5)
    dice = np.random.default_rng(1)
    n = len(mesh.vertices)
    sigma = np.where(dice.random(n) < 0.1, 0.3, 0.02)
    out = np.nan_to_num(vertex_normals(mesh))
    none = np.zeros(n, np.int32)
    known = Provenance(sigma, none, none, none, ("laser",))
    rough = mesh.vertices + out * (dice.normal(0, 1, n) * sigma)[:, None]
    found = find_shapes(Mesh(rough, mesh.faces, known))
    assert [s.kind for s in found.shapes] == 4 * ["plane"]
    assert found.coverage > 0.9


def test_a_hole_is_hollow():
    tube = turned([(8, 20), (8, 0)], 0.5, 100)
    (bore,) = find_shapes(noisy(tube, SIGMA, 4)).shapes
    assert (bore.kind, bore.hollow) == ("cylinder", True)
    assert bore.radius == pytest.approx(8, abs=4 * bore.radius_sigma)


def test_a_prism_is_square_where_it_is_and_not_where_it_is_not():
    box = prism([(0, 0), (40, 0), (40, 30), (0, 30)], 30, 0.8)
    found = find_shapes(noisy(box, SIGMA, 5))
    assert [s.kind for s in found.shapes] == 4 * ["plane"]
    assert {r.kind for r in found.relations} == {"parallel", "perpendicular"}
    sides = [s.value for s in sizes_between(box, found) if s.kind == "distance"]
    assert sorted(sides) == pytest.approx([30, 40], abs=0.01)
    assert len(neighbours_of(box, found)) == 4
    lean = prism([(0, 0), (40, 0), (41, 30), (0, 30)], 30, 0.8)  # 1.9° off square
    found = find_shapes(noisy(lean, SIGMA, 6))
    wrong = [r for r in found.relations if r.off > np.radians(1)]
    assert not wrong
    assert len([r for r in found.relations if r.kind == "perpendicular"]) == 2
    angles = [np.degrees(s.value) for s in sizes_between(lean, found) if s.kind == "angle"]
    assert any(abs(a - 88.09) < 0.05 for a in angles)


def test_freeform_has_no_shape():
    t = np.linspace(-1.3, 1.3, 110)
    body = turned([(25 * np.cos(a), 35 * np.sin(a)) for a in t], 0.6, 160)
    X = body.vertices.copy()
    X[:, 0] *= 1.2 + 0.2 * np.sin(X[:, 2] / 9)
    X[:, 1] *= 1 + 0.15 * np.cos(X[:, 2] / 7) + 0.004 * X[:, 0]
    found = find_shapes(noisy(Mesh(X, body.faces), SIGMA, 7))
    assert found.coverage < 0.02


def test_what_nobody_measured_has_no_say(shaft):
    mesh = noisy(shaft, SIGMA, 8)
    low = (mesh.vertices[mesh.faces][:, :, 2] < 19).all(axis=1)
    moved = mesh.vertices.copy()
    moved[np.unique(mesh.faces[low])] *= 1.1
    found = find_shapes(Mesh(moved, mesh.faces, measured=~low))
    assert sorted(round(s.radius) for s in found.of("cylinder")) == [10, 15]
    inner = np.setdiff1d(np.unique(mesh.faces[low]), np.unique(mesh.faces[~low]))
    assert (found.label[inner] == -1).all()
    assert np.isnan(found.residual[inner]).all()


def test_calibration_counts(shaft):
    mesh = noisy(shaft, SIGMA, 9)
    out = mesh.vertices * [1, 1, 0]
    alone = find_shapes(mesh, relations=False)
    found = find_shapes(mesh, relations=False, moves=[0.001 * out])
    for a, b in zip(alone.shapes, found.shapes, strict=True):
        if a.kind == "cylinder":
            extra = np.sqrt(b.radius_sigma**2 - a.radius_sigma**2)
            assert extra == pytest.approx(0.001 * a.radius, rel=0.02)


@pytest.mark.parametrize("kind", range(5))
def test_derivatives_are_those_of_the_distance(kind):
    dice = np.random.default_rng(kind)
    axis = dice.normal(size=3)
    q = np.concatenate([dice.normal(size=3), axis / np.linalg.norm(axis), [9.0, 0.4, 0, 0]])
    if kind == surface.TORUS:
        q[7] = 3.0
    X = dice.normal(size=(20, 3)) * 10
    _d, J = surface.jacobian(kind, q, X)
    for k in np.flatnonzero(surface.FREE[kind]):
        step = np.zeros(7)
        step[k] = 1e-6
        there = surface.distances(kind, surface.moved(q, step), X)[0]
        back = surface.distances(kind, surface.moved(q, -step), X)[0]
        assert np.allclose((there - back) / 2e-6, J[:, k], atol=1e-5)


def test_no_surface_is_a_sentence():
    with pytest.raises(InputError, match="no faces"):
        find_shapes(Mesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=int)))
    with pytest.raises(InputError, match="no face was measured"):
        find_shapes(Mesh(np.eye(3), [[0, 1, 2]], measured=[False]))

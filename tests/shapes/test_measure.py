"""Measurements of shapes of known size; their uncertainty is that of the noise put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.shapes.tubes import NOISE, cylinder, noisy, wall_of
from turnscan import shapes
from turnscan.errors import InputError
from turnscan.mesh import Mesh, is_closed
from turnscan.workflows import measure

ROUNDS = 60


def rounds(mesh: Mesh, taken) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    done = [taken(noisy(mesh, rng)) for _ in range(ROUNDS)]
    return np.array([d.value for d in done]), np.array([d.sigma for d in done])


@pytest.mark.parametrize(
    ("measure", "truth", "cautious"),
    [
        (lambda m: shapes.region_diameter(m, wall_of(m)), 20.0, 1.3),
        (lambda m: shapes.section_diameter(m, (0, 0, 1), 7.3), 20.0, 2.2),
        (lambda m: replace(shapes.volume(m), sigma=shapes.volume_sigma(m).noise), None, 2.0),
        (lambda m: shapes.area(m), cylinder(10.0, 30.0).area_of(), 6.0),
        (
            lambda m: shapes.distance(
                *(shapes.Spot(m.vertices[k], NOISE) for k in (0, len(m.vertices) - 1))
            ),
            np.hypot(10.0, 30.0),
            1.8,
        ),
        (
            lambda m: shapes.corner_angle(
                *(shapes.Spot(m.vertices[k], NOISE) for k in (0, len(m.vertices) - 2, 10))
            ),
            np.pi / 2,
            1.8,
        ),
    ],
)
def test_the_value_is_right_and_its_sigma_is_that_of_the_noise(measure, truth, cautious) -> None:
    mesh = cylinder(10.0, 30.0)
    assert is_closed(mesh)
    value, sigma = rounds(mesh, measure)
    exact = measure(noisy(mesh, np.random.default_rng(0))) if truth is None else None
    if exact is not None:
        flat = replace(mesh, provenance=None)
        truth = measure(flat).value
    z = (value - truth) / sigma
    rms = float(np.sqrt(np.mean(z**2)))
    assert rms < 1.25, "not less than it claims"
    assert rms > 0.8 / cautious, "nor far more"
    assert abs(value.mean() - truth) < 3.5 * sigma.mean() / np.sqrt(ROUNDS) or cautious >= 6


def test_a_section_of_a_coarse_mesh_has_the_diameter_of_its_vertices() -> None:
    for n in (7, 12, 40):
        mesh = cylinder(10.0, 30.0, n=n)
        assert shapes.section_diameter(mesh, (0, 0, 1), 7.3).value == pytest.approx(20, abs=1e-6)
        assert shapes.region_diameter(mesh, wall_of(mesh)).value == pytest.approx(20, abs=1e-6)


def test_the_loop_that_is_meant() -> None:
    small = cylinder(4.0, 30.0)
    both = Mesh(
        np.concatenate([cylinder(10.0, 30.0).vertices, small.vertices + (40, 0, 0)]),
        np.concatenate([cylinder(10.0, 30.0).faces, small.faces + len(small.vertices)]),
    )
    assert shapes.section_diameter(both, (0, 0, 1), 9.9).value == pytest.approx(20)
    assert shapes.section_diameter(both, (0, 0, 1), 9.9, (44, 0, 9)).value == pytest.approx(8)
    with pytest.raises(InputError, match="does not meet"):
        shapes.section_diameter(both, (0, 0, 1), 99.0)


def test_planes_of_a_region() -> None:
    mesh = cylinder(10.0, 30.0, n=60)
    n = len(mesh.vertices)
    top, bottom = ((mesh.faces == k).any(axis=1) for k in (n - 1, n - 2))
    up, down = shapes.plane_of(mesh, top), shapes.plane_of(mesh, bottom)
    assert np.allclose(up.normal, (0, 0, 1))
    assert np.allclose(down.normal, (0, 0, -1))
    assert shapes.planes_angle(up, down).value == pytest.approx(np.pi)
    spot = shapes.Spot(np.array([1.0, 2.0, 34.5]), 0.03)
    away = shapes.to_plane(spot, up)
    assert away.value == pytest.approx(4.5)
    assert away.sigma >= 0.03
    assert np.allclose(away.places, [(1, 2, 34.5), (1, 2, 30)])


def test_a_filled_gap_has_no_say_in_a_diameter() -> None:
    mesh = noisy(cylinder(10.0, 30.0), np.random.default_rng(5))
    dent = mesh.vertices.copy()
    pushed = (dent[:, 0] > 6) & (dent[:, 2] > 2) & (dent[:, 2] < 28)
    dent[pushed, 0] -= 2.0
    filled = replace(mesh, vertices=dent, measured=~pushed[mesh.faces].any(axis=1))
    done = shapes.section_diameter(filled, (0, 0, 1), 7.3)
    assert abs(done.value - 20.0) < 4 * done.sigma
    assert done.sigma < NOISE


def test_what_was_not_measured_does_not_count_and_is_named() -> None:
    mesh = cylinder(10.0, 30.0)
    wall = wall_of(mesh)
    capped = replace(mesh, measured=wall)
    assert "% of its area was not measured" in shapes.volume(capped).text
    share = 1 - capped.area_of(wall) / capped.area_of()
    assert f"mm², {share:.1%} of it not measured" in str(measure(capped))
    assert "not measured" not in str(measure(mesh))
    assert np.isnan(shapes.volume(capped).sigma)
    with pytest.raises(InputError, match="no measured faces"):
        shapes.plane_of(capped, ~wall)
    with pytest.raises(InputError, match="open"):
        shapes.volume(Mesh(mesh.vertices, mesh.faces[wall]))
    assert shapes.area(mesh, wall).value == pytest.approx(2 * 40 * 10 * np.sin(np.pi / 40) * 30)


def test_the_angle_between_two_planes_has_the_noise_of_both() -> None:
    """One of few points and one of many: their normals are not equally sure, and both count."""
    rng = np.random.default_rng(12)
    tilt = np.radians(40.0)
    pulls = []
    for first, second in ((9, 25), (25, 9), (12, 12)):
        for _ in range(80):
            planes = []
            for count, turn in ((first, 0.0), (second, tilt)):
                x, y = rng.uniform(-10, 10, (2, count))
                z = rng.normal(0, NOISE, count)
                c, s = np.cos(turn), np.sin(turn)
                points = np.stack([x, c * y - s * z, s * y + c * z], axis=-1)
                planes.append(shapes.fit_plane(points, np.full(count, NOISE)))
            found = shapes.planes_angle(*planes)
            angle = min(found.value, np.pi - found.value)
            pulls.append((angle - tilt) / found.sigma)
    z = np.reshape(pulls, (3, -1))
    # `normal_sigma` is that of the worst direction, the tilt is about one: never too sure.
    assert np.all(z.std(axis=1) < 1.15)
    assert np.all(z.std(axis=1) > 0.6)


def test_a_corner_is_the_same_wherever_it_lies() -> None:
    p, q = np.array([3.0, 0.0, 0.0]), np.array([1.0, 1.0, 0.0])
    for shift in ((0.0, 0.0, 0.0), (5.0, -40.0, 7.0)):
        a, corner, b = (shapes.Spot(x + shift, 0.02) for x in (p, 0 * p, q))
        found = shapes.corner_angle(a, corner, b)
        assert found.value == pytest.approx(np.pi / 4)
        # Each end turns by its noise over its distance; the corner turns both.
        ends = 0.02 * np.hypot(1 / 3, 1 / 2**0.5)
        both = 0.02 * np.linalg.norm(p - q) / (3 * 2**0.5)
        assert found.sigma == pytest.approx(np.hypot(ends, both))


def test_a_plane_is_less_sure_far_from_the_points_that_it_goes_through() -> None:
    """It tilts about their middle: 100 mm away its noise is that of the lever."""
    rng = np.random.default_rng(6)
    pulls = []
    for _ in range(300):
        x, y = rng.uniform(-10, 10, (2, 30))
        plane = shapes.fit_plane(
            np.stack([x, y, rng.normal(0, NOISE, 30)], axis=-1), np.full(30, NOISE)
        )
        far = shapes.Spot(np.array([100.0, 0.0, 5.0 + rng.normal(0, NOISE)]), NOISE)
        found = shapes.to_plane(far, plane)
        pulls.append((abs(found.value) - 5.0) / found.sigma)
    # 300 planes: the scatter is known to 4 %; the tilt counted is that of the worse direction.
    assert 0.75 < np.std(pulls) < 1.1


def test_noise_along_the_surface_is_no_error_of_a_place_on_it() -> None:
    """Between places on planes that lie anyhow, pulls scatter as they are stated to."""
    rng = np.random.default_rng(7)
    far, turned = list[float](), list[float]()
    for _ in range(1500):
        places = rng.uniform(-30, 30, (3, 3))
        normals = rng.normal(size=(3, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        off = places + NOISE * rng.normal(size=(3, 1)) * normals
        across = [np.outer(n, n) for n in normals]
        spots = [shapes.Spot(x, NOISE, C) for x, C in zip(off, across, strict=True)]
        true = [shapes.Spot(x) for x in places]
        apart, angle = shapes.distance(*spots[:2]), shapes.corner_angle(*spots)
        far.append((apart.value - shapes.distance(*true[:2]).value) / apart.sigma)
        turned.append((angle.value - shapes.corner_angle(*true).value) / angle.sigma)
    # 1500 pulls: their scatter is known to 2 %.
    assert 0.94 < np.std(far) < 1.06
    assert 0.94 < np.std(turned) < 1.06


def test_a_surface_is_off_across_itself_and_at_an_edge_across_both_faces() -> None:
    def about(*places: tuple[float, float, float]) -> np.ndarray:
        """Of two faces with a common edge, the first vertex at one end of it."""
        mesh = Mesh(np.array(places, float), np.array([[0, 1, 2], [1, 0, 3]]))
        return np.asarray(shapes.Spot.on(mesh, 0, mesh.vertices[0]).across)

    base = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    assert np.allclose(about(*base, (0.0, -1.0, 0.0)), np.diag((0, 0, 1)))
    assert np.allclose(about(*base, (0.0, 0.0, -1.0)), np.diag((0, 1, 1)))
    tilted = np.linalg.eigvalsh(about(*base, (0.0, -1.0, 0.3)))
    assert tilted[-1] == pytest.approx(1.0)
    assert tilted[1] == pytest.approx(np.tan(np.arctan(0.3) / 2) ** 2, rel=0.1)
    assert np.array_equal(about(*3 * [base[0]], base[0]), np.eye(3))


def test_how_much_of_an_area_was_not_measured_is_said() -> None:
    mesh = cylinder(10.0, 30.0)
    half = mesh.triangles[..., 2].mean(axis=1) < 15.0
    said = shapes.area(replace(mesh, measured=half)).text
    assert "50.0% of its area was not measured" in said


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_noise_does_not_add_to_an_area_and_edges_stay(noise: float) -> None:
    mesh = cylinder(10.0, 30.0, n=150, m=100)
    truth = mesh.area_of()
    rng = np.random.default_rng(7)
    known = noisy(mesh, rng).provenance
    assert known is not None
    moved = mesh.vertices + rng.normal(0, noise, mesh.vertices.shape)
    rough = replace(
        mesh, vertices=moved, provenance=replace(known, sigma=np.full(len(moved), noise))
    )
    found = shapes.area(rough)
    assert rough.area_of() > (1.003 if noise < 0.03 else 1.02) * truth
    assert found.value == pytest.approx(truth, rel=0.003)
    assert abs(found.value - truth) < 3 * found.sigma
    assert "taken off" in found.text
    assert shapes.area(mesh).value == pytest.approx(truth), "without noise it is as it is"
    exact = replace(mesh, provenance=replace(known, sigma=np.full(len(moved), noise)))
    assert shapes.area(exact).value == pytest.approx(truth, rel=0.002), "nothing that is form"

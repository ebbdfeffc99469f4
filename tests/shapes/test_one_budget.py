"""What is said of a size is the same however it was asked for, and errors keep to it: also those
that whole stripes share, that neighbours share, and that all points share."""

from __future__ import annotations

import numpy as np
import pytest

from tests.shapes.solids import averaged, noisy, prism, turned
from turnscan.arrays import Floats
from turnscan.mesh import Mesh, Provenance, vertex_normals
from turnscan.shapes import find_planes, fit_cylinder, fit_sphere, plane_angles
from turnscan.shapes.primitives import find_shapes, fit_whole
from turnscan.shapes.walls import wall_thickness

SIGMA, BENT, SEEDS = 0.02, 0.1, 12
"""mm: noise of a point, and how far stripes beside edges are off as a whole."""


def striped(mesh: Mesh, around: int, seed: int, far: float = BENT) -> Mesh:
    """Each column of a mesh is a stripe; two of five are ``far`` off as a whole, as sigma says."""
    dice = np.random.default_rng(seed)
    column = np.arange(len(mesh.vertices)) % around
    bent = np.where(column % 5 < 2, far, 0.0)
    off = dice.normal(0, SIGMA, len(column)) + bent * dice.normal(size=around)[column]
    n = np.nan_to_num(vertex_normals(mesh))
    zero = np.zeros(len(column), np.int32)
    line = (np.arange(len(column)) // around).astype(np.int32)
    known = Provenance(np.hypot(SIGMA, bent), zero, column.astype(np.int32), line, ("one",))
    return Mesh(mesh.vertices + n * off[:, None], mesh.faces, known)


def ratio(errors: list[float], sigmas: list[float]) -> float:
    return float(np.sqrt(np.mean((np.array(errors) / np.array(sigmas)) ** 2)))


def test_the_median_of_a_wall_errs_with_its_stripes_as_it_says() -> None:
    """Two stripes of five are off by 0.1 mm: what the median feels of each is not averaged out by
    the points on it, and bounded by the scatter of the places: more than is felt of most."""
    clean = prism([(0.0, 0.0), (30.0, 0.0), (30.0, 5.0), (0.0, 5.0)], 20.0, 0.5)
    around = int((np.abs(clean.vertices[:, 2]) < 1e-9).sum())
    found = [wall_thickness(striped(clean, around, seed)) for seed in range(SEEDS)]
    errors = [w.median - 5.0 for w in found if w is not None]
    assert len(errors) == SEEDS
    assert 0.3 < ratio(errors, [w.median_sigma for w in found if w is not None]) < 1.5
    # Half of the stripes of either side, each felt no more than the scatter of the places is.
    assert max(w.median_sigma for w in found if w is not None) < BENT / np.sqrt(0.4 * around / 2)


@pytest.mark.parametrize("rounds", [0, 2])
def test_the_median_of_a_wall_errs_with_what_neighbours_share(rounds: int) -> None:
    clean, errors, sigmas = turned([(20, 0), (20, 30), (17, 30), (17, 0)], 0.6, 200), [], []
    for seed in range(SEEDS):
        found = wall_thickness(averaged(clean, SIGMA, seed, rounds=rounds))
        assert found is not None
        errors.append(found.median - 3.0)
        sigmas.append(found.median_sigma)
    assert 0.4 < ratio(errors, sigmas) < 1.8


def _ball(seed: int) -> Mesh:
    up = np.linspace(-1.1, 1.1, 50)
    outline = [(20 * float(np.cos(a)), 20 * float(np.sin(a))) for a in up]
    return striped(turned(outline, 1.0, 100), 100, seed, SIGMA)


def _tube(seed: int) -> Mesh:
    return striped(turned([(20, 0), (20, 30)], 0.6, 150), 150, seed, SIGMA)


@pytest.mark.parametrize(("part", "fit", "at"), [(_ball, fit_sphere, 3), (_tube, fit_cylinder, 4)])
def test_a_shape_that_is_asked_for_is_known_as_one_that_is_found(part, fit, at) -> None:
    errors, sigmas = [], []
    for seed in range(SEEDS):
        mesh = part(seed)
        moves = [0.004 * np.nan_to_num(vertex_normals(mesh))]
        asked = fit_whole(fit, mesh, moves)
        sigma = float(np.sqrt(asked.covariance[at, at]))
        if seed < 2:
            (found,) = find_shapes(mesh, moves=moves).shapes
            assert sigma == pytest.approx(found.radius_sigma, rel=0.15)
        alone = float(np.sqrt(fit_whole(fit, mesh).covariance[at, at]))
        assert sigma == pytest.approx(np.hypot(0.004, alone), rel=0.05)
        errors.append(asked.radius - 20.0)
        sigmas.append(alone)
    assert 0.4 < ratio(errors, sigmas) < 1.8


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_moves_a_sphere_one_way_is_in_its_centre_s_uncertainty_that_way(axis: int) -> None:
    mesh = _ball(0)
    moved = np.zeros_like(mesh.vertices)
    moved[:, axis] = 0.1
    alone, both = (
        np.sqrt(np.diag(fit_whole(fit_sphere, mesh, m).covariance)) for m in ([], [moved])
    )
    due = alone.copy()
    due[axis] = np.hypot(alone[axis], 0.1)
    assert both == pytest.approx(due, rel=0.01, abs=1e-4)


@pytest.mark.parametrize("steps", [24, 60, 200])
def test_a_cylinder_has_no_planar_face_however_coarse_its_turn(steps: int) -> None:
    for seed in range(2):
        round_ = turned([(25, 0), (25, 78)], 0.6, steps)
        assert find_planes(averaged(round_, 0.08, seed, rounds=0)) == []
        assert find_planes(noisy(round_, 0.08, seed)) == []


@pytest.mark.parametrize("step", [0.5, 4.0])
def test_a_hexagon_keeps_its_six_sides(step: float) -> None:
    t = np.radians(np.arange(0, 360, 60))
    corners = [(23 * float(np.cos(a)), 23 * float(np.sin(a))) for a in t]
    walls = prism(corners, 40.0, step)
    sides = find_planes(noisy(walls, 0.05, 1))
    assert len(sides) == 6
    z = [(np.degrees(a.angle) % 60 + 30) % 60 - 30 for a in plane_angles(sides)]
    # Of each side the way counts in which it is known worst, so that angles are stated too wide.
    assert 0.1 < ratio(z, [float(np.degrees(a.sigma)) for a in plane_angles(sides)]) < 1.8


def _turning(mesh: Mesh, where: Floats) -> Floats:
    """(v, 3) mm: 0.01 rad about x of the vertices ``where``."""
    return np.where(where[:, None], 0.01 * np.cross([1.0, 0.0, 0.0], mesh.vertices), 0.0)


def test_what_turns_two_faces_alike_leaves_their_angle() -> None:
    mesh = noisy(prism([(0, 0), (40, 0), (40, 30), (0, 30)], 20, 0.5), SIGMA, 1)
    every, front = np.ones(len(mesh.vertices)), mesh.vertices[:, 1] < 1.0
    plain = find_planes(mesh)
    alike, one = (find_planes(mesh, moves=[_turning(mesh, w)]) for w in (every > 0, front))
    assert max(s.plane.normal_sigma for s in alike) == pytest.approx(0.01, rel=0.05)
    for a, b in zip(plane_angles(plain), plane_angles(alike), strict=True):
        assert b.sigma == pytest.approx(a.sigma, rel=0.2)
    assert max(a.sigma for a in plane_angles(one)) == pytest.approx(0.01, rel=0.05)

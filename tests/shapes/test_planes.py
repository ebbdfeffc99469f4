"""The flat sides of a scanned box: all found, square, and flat to the noise put in."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic import box, full_turn, make_rig, scan_shape, with_noise
from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.points import Volume, build_grid, clip
from turnscan.shapes import find_planes, plane_angles
from turnscan.shapes._planes import _neighbours
from turnscan.surface.fusion import paste

TURN = 0.3


@pytest.fixture(scope="module")
def stripes():
    rig = make_rig(elevation=0.35, lift=20.0)
    return rig, scan_shape(rig, box((25, 18, 20), (3, 2, 20), TURN), full_turn(60))


def scanned(stripes, noise):
    rig, exact = stripes
    noisy = with_noise(exact, noise, 5) if noise else exact
    grid = build_grid(rig, "L0", noisy, range(60), full_turn(60))
    return paste([clip(grid, Volume(60, 1))]), float(np.nanmedian(grid.sigma))


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_box_has_five_sides_at_right_angles(stripes, noise):
    mesh, sigma = scanned(stripes, noise)
    sides = find_planes(mesh)
    assert len(sides) == 5
    c, s = np.cos(TURN), np.sin(TURN)
    want = np.array([[c, s, 0], [-c, -s, 0], [-s, c, 0], [s, -c, 0], [0, 0, 1.0]])
    nearest = [int(np.argmax(want @ r.plane.normal)) for r in sides]
    assert sorted(nearest) == [0, 1, 2, 3, 4], "each side once, facing outward"
    for r, k in zip(sides, nearest, strict=True):
        off = np.arccos(min(1.0, want[k] @ r.plane.normal))
        assert off < (1e-6 if not noise else 5 * r.plane.normal_sigma + 1e-3)
        size = [36 * 39, 36 * 39, 50 * 39, 50 * 39, 50 * 36][k]
        assert 0.6 * size < r.area < 1.05 * size
        if noise:
            assert 0.03 * sigma < r.plane.rms < 1.3 * sigma
        else:
            assert r.plane.rms < 1e-6
    if noise:
        walls = [r.plane.rms for r, k in zip(sides, nearest, strict=True) if k < 4]
        assert min(walls) > 0.4 * sigma, "flatness is not flattered"
    for a in plane_angles(sides):
        off = min(a.off_square, a.off_parallel)
        assert off < 1e-6 if not noise else off < 5 * a.sigma + 2e-3


def test_a_ball_has_no_flat_side_and_two_levels_are_two():
    t, z = np.meshgrid(np.linspace(0, 2 * np.pi, 60, endpoint=False), np.linspace(-0.9, 0.9, 40))
    r = np.sqrt(1 - z**2)
    ball = sheet(np.stack([30 * r * np.cos(t), 30 * r * np.sin(t), 30 * z], -1))
    assert find_planes(ball, tolerance=0.05, smallest=0.05) == []
    x, y = np.meshgrid(np.arange(0, 40.0), np.arange(0, 30.0))
    two = sheet(np.stack([x, y, np.where(x < 20, 0.0, 6.0)], -1))
    found = find_planes(two, tolerance=0.1)
    assert len(found) == 2
    (angle,) = plane_angles(found)
    assert angle.off_parallel < 1e-9
    gap = abs(found[0].plane.distance - found[1].plane.distance)
    assert gap == pytest.approx(6.0, abs=1e-9)


def test_one_side_cut_by_a_shadow_is_one_side():
    x, y = np.meshgrid(np.arange(0, 40.0), np.arange(0, 30.0))
    whole = sheet(np.stack([x, y, 0 * x], -1))
    middle = whole.triangles[..., 0].mean(axis=1)
    cut = Mesh(whole.vertices, whole.faces[np.abs(middle - 20) > 3])
    (side,) = find_planes(cut, tolerance=0.1)
    assert side.area == pytest.approx(39 * 29 - 6 * 29, rel=0.05)


def test_a_mesh_without_faces_is_refused():
    with pytest.raises(InputError, match="no faces"):
        find_planes(Mesh(np.eye(3), np.zeros((0, 3), int)))


def sheet(points) -> Mesh:
    """A grid of points (m, n, 3) as a mesh."""
    m, n, _ = points.shape
    k = np.arange(m * n).reshape(m, n)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    return Mesh(
        points.reshape(-1, 3), np.concatenate([np.stack(f, -1) for f in ((a, b, c), (a, c, d))])
    )


def test_a_side_smaller_than_the_share_asked_for_is_none():
    x, y = np.meshgrid(np.arange(0, 40.0), np.arange(0, 30.0))
    step = sheet(np.stack([x, y, np.where(x < 30, 0.0, 6.0)], -1))
    # The upper level is a fifth of the surface; its riser belongs to neither.
    assert len(find_planes(step, tolerance=0.1, smallest=0.1)) == 2
    assert len(find_planes(step, tolerance=0.1, smallest=0.3)) == 1
    assert find_planes(step, tolerance=0.1, smallest=0.9) == []


def test_neighbours_are_what_a_side_joins():
    mesh = sheet(np.stack([*np.meshgrid(np.arange(5.0), np.arange(4.0)), np.zeros((4, 5))], -1))
    start, near = _neighbours(mesh)
    sides = {(int(a), int(b)) for f in mesh.faces for a, b in zip(f, np.roll(f, 1), strict=True)}
    for v in range(len(mesh.vertices)):
        joined = {b for a, b in sides if a == v} | {a for a, b in sides if b == v}
        assert set(near[start[v] : start[v + 1]].tolist()) == joined

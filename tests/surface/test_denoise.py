"""Denoising along the rays, outliers, the brush: how far, how much, and what stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mesh.checks import cube
from tests.reports import into
from tests.surface.grids import column, random_grid
from turnscan.errors import InputError
from turnscan.mesh import boundary_loops
from turnscan.points import RangeGrid
from turnscan.stripes import StripeFlag
from turnscan.surface._noise import noise as noise_of
from turnscan.surface.clean import denoise, despike, smooth, spikes

NOISE = 0.02
INNER = (slice(8, -8), slice(8, -8))
Relief = Callable[[np.ndarray, np.ndarray], np.ndarray]


def relief(shape: Relief, seed: int = 0, size: int = 100) -> tuple[np.ndarray, RangeGrid]:
    """Points of x = shape(y, z), seen from x = 400 mm, and the grid of them with noise."""
    rng = np.random.default_rng(seed)
    at = (np.arange(size) - size / 2) * 0.25
    y, z = np.meshgrid(at, at, indexing="ij")
    points = np.stack([shape(y, z), y, z], axis=-1)
    eyes = np.stack([np.full(size, 400.0), at, 0 * at], axis=-1)
    grid = RangeGrid(
        "L0", np.arange(size), np.linspace(0, 1, size), points, np.full(y.shape, NOISE),
        np.ones(y.shape), np.zeros(y.shape, np.uint16), False, eyes,
    )  # fmt: skip
    noisy = points + rng.normal(0, NOISE, y.shape)[..., None] * rays(grid)
    return points, replace(grid, points=noisy)


def rays(grid: RangeGrid) -> np.ndarray:
    ray = grid.eyes[:, None] - grid.points
    return ray / np.linalg.norm(ray, axis=2, keepdims=True)


def off(grid: RangeGrid, truth: np.ndarray) -> np.ndarray:
    """mm: how far each point lies from its true place, along its ray."""
    return np.einsum("sni,sni->sn", grid.points - truth, rays(grid))[INNER]


SHAPES: dict[str, Relief] = {
    "flat": lambda y, z: 0.3 * y + 0.1 * z,
    "ball of 25 mm": lambda y, z: np.sqrt(25.0**2 - 0.8 * (y**2 + z**2)),
    "ridge of 90°": lambda y, z: -np.abs(y + 0.1),
    "step of 1 mm": lambda y, z: np.where(y > 0.1, 1.0, 0.0),
    "step of 8 sigma": lambda y, z: np.where(y > 0.1, 8 * NOISE, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SHAPES))
def test_noise_falls_by_two_and_a_half_and_the_surface_stays(name: str) -> None:
    """The floor: a second-order fit over this window can average no more than 3.5 times."""
    truth, grid = relief(SHAPES[name])
    before, after = off(grid, truth), off(denoise(grid), truth)
    assert 2.5 < before.std() / after.std() < 3.5
    assert abs(after.mean()) < 0.1 * NOISE


@pytest.mark.parametrize("name", ["ridge of 90°", "step of 1 mm", "step of 8 sigma"])
def test_edges_keep_their_place(name: str) -> None:
    truth, grid = relief(SHAPES[name])
    beside = np.abs(truth[INNER][..., 1]) < 0.6
    near = off(denoise(grid), truth)[beside]
    assert abs(near.mean()) < 0.15 * NOISE, "an edge is neither cut nor grown"
    assert 0.2 * NOISE < near.std() < 0.75 * NOISE
    # The same neighbours, averaged without looking for the edge, would move it by much more.
    plain = np.mean([np.roll(truth[..., 0], k, axis=0) for k in range(-3, 4)], axis=0)
    assert np.abs(plain - truth[..., 0])[INNER][beside].mean() > 3 * np.abs(near).mean()


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    missing=st.floats(0, 0.9),
    most=st.floats(0.1, 5.0),
    behind=st.sampled_from([0.0, 0.3]),
)
def test_no_point_moves_further_than_its_sigma_allows_nor_off_its_ray(
    seed, missing, most, behind
) -> None:
    grid = random_grid(seed, 12, 11, missing, True, behind)
    out = denoise(grid, most)
    assert np.array_equal(out.found, grid.found)
    move = (out.points - grid.points)[grid.found]
    assert (np.linalg.norm(move, axis=1) <= most * grid.sigma[grid.found] * (1 + 1e-9)).all()
    ray = rays(grid)[grid.found]
    assert np.abs(move - np.einsum("ij,ij->i", move, ray)[:, None] * ray).max(initial=0) < 1e-12
    assert out.points.tobytes() == denoise(grid, most).points.tobytes()


def test_what_has_no_sigma_does_not_move() -> None:
    _, grid = relief(SHAPES["flat"], size=30)
    sigma = grid.sigma.copy()
    sigma[10:20] = np.nan
    out = denoise(replace(grid, sigma=sigma))
    assert np.array_equal(out.points[10:20], grid.points[10:20])
    assert (out.points[20:25] != grid.points[20:25]).any()


@pytest.mark.parametrize("size", [8.0, 20.0])
def test_outliers_go_and_what_is_beside_them_stays(size: float) -> None:
    truth, grid = relief(SHAPES["ridge of 90°"])
    wrong = np.zeros(grid.flags.shape, dtype=bool)
    wrong[5::10, 5::10] = True
    points = grid.points + (size * NOISE * wrong)[..., None] * rays(grid)
    out, findings = despike(replace(grid, points=points), 4.0)
    assert (~out.found[wrong]).mean() > (0.95 if size < 10 else 0.999)
    assert out.found[~wrong].mean() > 0.9985, "four sigma: 1 in 16 000 by chance, edges aside"
    assert (out.flags[~out.found] == StripeFlag.AMBIGUOUS).all()
    assert findings[0].message.startswith(str(int((~out.found).sum())))
    assert despike(replace(grid, points=truth))[1] == []
    blind = replace(grid, eyes=None)
    assert despike(blind)[0] is blind


def turned(steps: int, noise: float) -> RangeGrid:
    """A can of radius 25 mm and 40 mm height, seen from 300 mm in a full turn of so many steps."""
    angles = np.arange(steps) * 2 * np.pi / steps
    way = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    z = np.arange(80) * 0.5
    points = 25.0 * way[:, None] + z[:, None] * np.array([0.0, 0.0, 1.0])
    shape = points.shape[:2]
    grid = RangeGrid(
        "L0", np.arange(steps), angles, points, np.full(shape, noise), np.ones(shape),
        np.zeros(shape, np.uint16), True, 300.0 * way + np.array([0.0, 0.0, 60.0]),
    )  # fmt: skip
    off = np.random.default_rng(steps).normal(0, noise, shape)
    return replace(grid, points=points + off[..., None] * rays(grid))


@pytest.mark.parametrize("steps", [12, 24, 40, 60])
@pytest.mark.parametrize("noise", [0.003, 0.02])
def test_what_a_surface_bends_by_between_coarse_steps_is_no_spike(steps: int, noise: float) -> None:
    grid = turned(steps, noise)
    left, _ = despike(grid, 5.0)
    assert left.found.mean() > 0.998
    wrong = np.zeros(grid.flags.shape, dtype=bool)
    wrong[2::5, 4::8] = True
    points = grid.points + (2.0 * wrong)[..., None] * rays(grid)
    left, _ = despike(replace(grid, points=points), 5.0)
    assert left.found[~wrong].mean() > 0.998
    # Where steps bend a surface by a hundred sigma and more, it does not tell a spike.
    if noise * steps**2 > 10:
        assert (~left.found[wrong]).mean() > 0.85


def test_spikes_of_a_mesh_go_edges_and_corners_stay() -> None:
    mesh = cube()
    rng = np.random.default_rng(3)
    rough = mesh.vertices + rng.normal(0, 0.01, mesh.vertices.shape)
    flat = np.flatnonzero((np.abs(mesh.vertices - 5.0) < 4.0).sum(axis=1) == 2)
    chosen = flat[:: len(flat) // 12]
    rough[chosen] += np.where(np.abs(mesh.vertices[chosen] - 5.0) > 4.9, 0.6, 0.0)
    spiky = replace(mesh, vertices=rough)
    assert set(np.flatnonzero(spikes(spiky))) == set(chosen)
    left, findings = despike(spiky, 6.0)
    assert len(boundary_loops(left)) == len(chosen), "a hole each, to be filled"
    assert findings[0].message.startswith(f"{len(chosen)} points")


def test_the_brush_smooths_where_it_is_and_nothing_else() -> None:
    mesh = column()
    where = np.clip((mesh.vertices[:, 2] - 15.0) / 5.0, 0.0, 1.0)
    out = smooth(mesh, where, rounds=8)
    assert np.array_equal(out.vertices[where == 0], mesh.vertices[where == 0])
    rims = np.concatenate(boundary_loops(mesh))
    assert np.array_equal(out.vertices[rims], mesh.vertices[rims])

    def ripple(m):
        phi = np.arctan2(m.vertices[:, 1], m.vertices[:, 0])
        r = np.hypot(m.vertices[:, 0], m.vertices[:, 1]) - 30.0 - np.cos(5 * phi)
        return r[(where == 1) & (m.vertices[:, 2] < 37.0)]

    assert ripple(out).std() < 0.6 * ripple(mesh).std()
    assert abs(ripple(out).mean() - ripple(mesh).mean()) < NOISE, "it does not shrink"
    assert out.provenance is mesh.provenance


def test_options_that_cannot_be_are_refused() -> None:
    _, grid = relief(SHAPES["flat"], size=8)
    with pytest.raises(InputError, match="sigma"):
        denoise(grid, 0.0)
    with pytest.raises(InputError, match="camera position"):
        denoise(replace(grid, eyes=None))
    with pytest.raises(InputError, match="nan sigma"):
        despike(grid, float("nan"))
    mesh = cube(2)
    with pytest.raises(InputError, match="weights"):
        smooth(mesh, [1.0])
    with pytest.raises(InputError, match="weights"):
        smooth(mesh, np.full(len(mesh.vertices), 1.5))
    with pytest.raises(InputError, match="rounds"):
        smooth(mesh, np.ones(len(mesh.vertices)), 0)


def test_the_share_done_is_told_and_the_result_is_the_same_however_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, grid = relief(SHAPES["ridge of 90°"], size=40)
    grid = replace(grid, closed=True)  # the first profile's neighbours are the last ones
    monkeypatch.setattr("turnscan.surface.clean._denoise._AT_A_TIME", 40)
    once = denoise(grid)
    monkeypatch.setattr("turnscan.surface.clean._denoise._AT_A_TIME", 7)
    shares = list[float]()
    assert np.array_equal(denoise(grid, progress=into(shares)).points, once.points)
    assert shares == [first / 40 for first in range(0, 40, 7)]


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_a_sigma_is_believed_no_further_than_the_surface_itself_shows(noise: float) -> None:
    """The second difference of three points has six times their variance, and its usual size is the
    0.6745th part of its root. Where the points claim ten times their noise, three halves of that
    are believed; where they claim less than they show, they are believed."""
    rng = np.random.default_rng(8)
    flat, grid = relief(SHAPES["flat"], size=200)
    points = flat + rng.normal(0, noise, flat.shape[:2])[..., None] * rays(grid)
    claimed = replace(grid, points=points, sigma=np.full(grid.sigma.shape, 10 * noise))
    # The rays lean by up to 2°, so their second differences are those of one direction.
    assert noise_of(claimed) == pytest.approx(1.5 * 0.6745 * noise, rel=0.06)
    modest = replace(claimed, sigma=np.full(grid.sigma.shape, 0.3 * noise))
    assert noise_of(modest) == pytest.approx(0.3 * noise)

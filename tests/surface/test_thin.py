"""Resampled profiles: what was a surface stays one, whole, with its ends and its tears."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.points.grids import plain_grid
from turnscan.mesh import boundary_loops, components, soundness
from turnscan.points import Along
from turnscan.surface import mesh_grid, thin


def wavy(seed, *, dropout=0.0, noise=0.0, overhang=0.0):
    """A turned wall of 12 profiles; with overhang its profiles pass heights several times."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * np.arange(12) / 12
    t = np.linspace(0, 1, 60) + 0 * angles[:, None]
    z = 81.7 - 80 * t + overhang * np.sin(14 * t + 0.2 * np.cos(angles)[:, None])
    r = 25 + 6 * np.sin(9 * t) + rng.normal(0, noise, t.shape)
    z = z + rng.normal(0, 0.4 * noise, t.shape)
    points = np.stack([r * np.cos(angles[:, None]), r * np.sin(angles[:, None]), z], axis=-1)
    points[rng.random(t.shape) < dropout] = np.nan
    return replace(plain_grid(points, angles, sigma=max(noise, 0.05)), closed=True)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    spacing=st.floats(0.3, 15),
    by=st.sampled_from(["height", "arc"]),
    dropout=st.sampled_from([0.0, 0.02, 0.2]),
    noise=st.sampled_from([0.0, 0.1, 0.7]),
    overhang=st.sampled_from([0.0, 12.0]),
)
def test_thinning_tears_nothing_closes_nothing_and_keeps_the_ends(
    seed, spacing, by, dropout, noise, overhang
):
    grid = wavy(seed, dropout=dropout, noise=noise, overhang=overhang)
    new = thin(grid, Along(spacing, by))
    for k in range(12):
        old = grid.points[k][grid.found[k]]
        got = new.points[k][new.found[k]]
        assert np.array_equal(got[0], old[0])
        assert np.array_equal(got[-1], old[-1])
    dense, coarse = mesh_grid(grid), mesh_grid(new)
    assert len(boundary_loops(coarse)) == len(boundary_loops(dense))
    assert components(coarse).max() == components(dense).max()
    v, f = len(coarse.vertices), len(coarse.faces)
    euler = [len(m.vertices) - len(m.faces) / 2 - _borders(m) / 2 for m in (coarse, dense)]
    assert euler[0] == euler[1], (v, f)
    kept = {tuple(p) for p in coarse.vertices}
    for loop in boundary_loops(dense):
        corners = dense.provenance.step[loop], dense.vertices[loop]
        for step in np.unique(corners[0]):
            z = corners[1][corners[0] == step]
            assert any(tuple(p) in kept for p in z), "every profile keeps a point of every border"


def _borders(mesh):
    return sum(len(loop) for loop in boundary_loops(mesh))


@pytest.mark.parametrize("spacing", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("by", ["height", "arc"])
def test_a_height_of_81_7_stays_81_7(spacing, by):
    coarse = mesh_grid(thin(wavy(0), Along(spacing, by)))
    assert np.ptp(coarse.vertices[:, 2]) == pytest.approx(80.0, abs=1e-12)
    assert len(boundary_loops(coarse)) == 2
    step, line = coarse.provenance.step, coarse.provenance.line
    near = np.linalg.norm(wavy(0).points[step, line] - coarse.vertices, axis=1)
    assert near.max() < 1.0, "a vertex knows the measured point that is nearest"
    assert not [f for f in soundness(coarse) if f.severity == "warning"]


def test_coarser_points_lie_on_the_measured_profiles_and_are_no_further_apart():
    grid = wavy(3, overhang=12.0)
    new = thin(grid, Along(2.0))
    lines = new.origin.lines
    for k in range(12):
        at = lines[k][new.found[k]]
        assert (np.diff(at) > 0).all()
        a, w = np.floor(at).astype(int), (at % 1)[:, None]
        b = np.minimum(a + 1, 59)
        want = (1 - w) * grid.points[k, a] + w * grid.points[k, b]
        assert np.abs(want - new.points[k][new.found[k]]).max() < 1e-9
        way = np.concatenate(
            [[0], np.cumsum(np.linalg.norm(np.diff(grid.points[k], axis=0), axis=1))]
        )
        assert np.diff(np.interp(at, np.arange(60), way)).max() <= 2 * 2.0 + 2.0

"""What is fitted was measured: no vertex of a filling has a say, and noisy points have less."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from tests.points.grids import plain_grid
from turnscan.cli._measure import verb
from turnscan.errors import InputError
from turnscan.formats import ExportOptions, export, read_mesh
from turnscan.mesh import is_closed, measured_vertices
from turnscan.shapes import find_planes, fit_cylinder, measured_points
from turnscan.surface import mesh_grid
from turnscan.surface.holes import ClosingOptions, close

RADIUS, NOISE = 25.0, 0.02


@pytest.fixture(scope="module")
def closed():
    """A tube whose two ends were closed, its upper half ten times as noisy, as its sigma says."""
    rng = np.random.default_rng(5)
    angles = 2 * np.pi * np.arange(60) / 60
    z = np.linspace(2, 40, 30)
    sigma = np.where(z > 25, 10 * NOISE, NOISE) + 0 * angles[:, None]
    r = RADIUS + rng.normal(0, 1, sigma.shape) * sigma
    points = np.stack(
        [r * np.cos(angles)[:, None], r * np.sin(angles)[:, None], z + 0 * r], axis=-1
    )
    grid = replace(plain_grid(points, angles), closed=True, sigma=sigma)
    mesh, _ = close(mesh_grid(grid), ClosingOptions(bottom="floor", top=None, holes="tangent"))
    assert is_closed(mesh)
    assert len(mesh.vertices) > 60 * 30 + 50
    return mesh


def test_added_vertices_are_not_fitted_and_sigma_weighs(closed):
    points, sigma = measured_points(closed)
    assert len(points) == 60 * 30
    fit = fit_cylinder(points, sigma)
    off = abs(fit.radius - RADIUS)
    assert off < 3 * np.sqrt(fit.covariance[4, 4]) < 3 * NOISE
    assert np.sqrt(fit.covariance[4, 4]) < np.sqrt(fit_cylinder(points).covariance[4, 4])
    assert abs(fit_cylinder(closed.vertices).radius - RADIUS) > 0.2


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".3mf"])
def test_the_written_mesh_measures_the_same(closed, tmp_path, suffix):
    path = tmp_path / f"tube{suffix}"
    path.write_bytes(export(closed, suffix, options=ExportOptions()))
    back = read_mesh(path.read_bytes(), suffix)
    assert measured_vertices(back).sum() == 60 * 30
    done = CliRunner().invoke(verb, [str(path), "--cylinder", "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)["cylinder"]
    assert told["points"] == 60 * 30
    assert told["radius_mm"] == pytest.approx(RADIUS, abs=0.02)


def test_one_ring_is_refused_in_words(tmp_path):
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    path = tmp_path / "ring.ply"
    rows = "\n".join(f"{25 * np.cos(a)} {25 * np.sin(a)} 0" for a in t)
    head = "\n".join(f"property double {c}" for c in "xyz")
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex 60\n{head}\n"
        "element face 58\nproperty list uchar int vertex_indices\nend_header\n"
        f"{rows}\n" + "".join(f"3 0 {i} {i + 1}\n" for i in range(1, 59))
    )
    done = CliRunner().invoke(verb, [str(path), "--cylinder"])
    assert isinstance(done.exception, InputError)
    assert "one plane" in str(done.exception)


def test_flat_fillings_are_no_sides(closed):
    unknown = ~measured_vertices(closed)
    for side in find_planes(closed):
        assert not (side.inliers & unknown).any()
        assert abs(side.plane.normal[2]) < 0.5

"""The map of quality: what it shows, and that what it calls poor is further off in truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.mesh import Mesh, Provenance
from turnscan.pipeline import Reconstruction, reconstruct
from turnscan.scan import Scan
from turnscan.settings import Settings
from turnscan.shapes import deviation
from turnscan.simulate import SimulationSpec, simulated
from turnscan.surface.holes import CAUSE_WORDS, Cause, holes
from turnscan.workflows._pages._colours import CAUSE_COLOURS
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file, truth
from turnscan.workflows._surface._quality_map import (
    errors_by_sigma,
    quality_figure,
    quality_line,
    sigmas,
)


def _tube(sigma: Floats | None = None) -> Mesh:
    """A tube of 10 mm radius, open at both ends, 12 rings of 24."""
    turn, z = np.meshgrid(np.arange(24) * np.pi / 12, np.linspace(0.0, 20.0, 12))
    points = np.stack([10 * np.cos(turn), 10 * np.sin(turn), z], axis=-1).reshape(-1, 3)
    k = np.arange(11 * 24)
    right = k // 24 * 24 + (k + 1) % 24
    faces = np.concatenate(
        [np.stack([k, right, right + 24], 1), np.stack([k, right + 24, k + 24], 1)]
    )
    if sigma is None:
        return Mesh(points, faces)
    one = np.zeros(len(points), np.int32)
    return Mesh(points, faces, Provenance(sigma, one, one, one, ("L0",)))


def test_equal_parts_from_the_least_sigma_to_the_largest() -> None:
    rng = np.random.default_rng(1)
    sigma = rng.uniform(0.05, 0.5, 5000)
    sigma[::50] = np.nan
    rms = errors_by_sigma(sigma, rng.normal(0.0, np.nan_to_num(sigma, nan=9.0)))
    assert (np.diff(rms, axis=0) > 0).all()
    np.testing.assert_allclose(rms[:, 1], rms[:, 0], rtol=0.1)
    assert "20% of the points" in quality_line(sigma, np.nan_to_num(sigma))


def test_holes_have_the_colours_of_their_causes_and_sigma_a_scale_in_mm() -> None:
    mesh = _tube(np.linspace(0.02, 0.2, 12 * 24))
    names: tuple[Cause, Cause] = ("camera", "outside")
    found = [replace(h, cause=c) for h, c in zip(holes(mesh), names, strict=True)]
    figure = quality_figure(mesh, found)
    (legend,) = figure.legends
    assert {t.get_text() for t in legend.get_texts()} == {CAUSE_WORDS[c] for c in names}
    assert "sigma of the points, mm" in {a.get_ylabel() for a in figure.axes}
    seen = [np.asarray(a.images[0].get_array()) for a in figure.axes[:2]]
    for cause, h in zip(names, found, strict=True):
        # The upper lid is seen from above, the lower one from below; shades darken, hues stay.
        picture = seen[0 if h.centre[2] > 10 else 1].reshape(-1, 3).astype(float)
        colour = np.array(CAUSE_COLOURS[cause], dtype=float)
        bright = picture.sum(axis=1) < 3 * 250
        hue = picture[bright] / np.maximum(picture[bright].sum(axis=1, keepdims=True), 1.0)
        near = np.abs(hue - colour / colour.sum()).max(axis=1) < 0.02
        assert near.mean() > 0.05
        assert not (np.abs(hue - np.array([190, 190, 190]) / 570).max(axis=1) < 1e-3).mean() > 0.5


def test_a_surface_without_sigmas_has_no_map() -> None:
    with pytest.raises(InputError, match="no vertex of the mesh has a sigma"):
        quality_figure(_tube(), [])
    some = np.full(12 * 24, np.nan)
    some[5] = 0.1
    assert quality_figure(_tube(some), []).legends == []


@pytest.fixture(scope="module", params=["cup", "bracket"])
def judged(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Reconstruction, Floats]:
    """A part on the demo's rig as it was measured, and how far each vertex is off in truth."""
    spec = SimulationSpec(scene=request.param, rig="paper", steps=40, seed=7)
    devices, path = simulated(spec), Path(tmp_path_factory.mktemp("scans")) / "part.turnscan"
    scan_into_file(devices, plan_of(devices), path, "sparse")
    with Scan.open(path) as scan:
        done = reconstruct(scan, None, Settings())
    return request.param, done, deviation(done.mesh.vertices, truth(devices)).distance


@pytest.mark.slow
def test_what_the_map_calls_poor_is_further_off_the_true_shape(
    judged: tuple[str, Reconstruction, Floats],
) -> None:
    part, done, error = judged
    rms = errors_by_sigma(sigmas(done.mesh), error)
    # Sigma is what the points are off, from the best fifth to the worst.
    assert rms[-1, 1] > rms[0, 1]
    if part == "cup":
        # It is measured alike all over, and its map must not make much of little.
        np.testing.assert_allclose(rms[:, 1], rms[:, 0], rtol=0.15)
        assert rms[-1, 0] < 1.3 * rms[0, 0]
    else:
        # What light and camera come to flatly is not: half as much again (1.50; 1.30 and 1.44 by
        # seeds 9 and 8), and the map knows it. It says more than that, as steps so coarse leave
        # open what lies between them.
        assert rms[-1, 1] > 1.4 * rms[0, 1]
        assert rms[-1, 0] < 5.0 * rms[-1, 1]
        assert rms[-1, 0] > 1.4 * rms[0, 0]
        assert rms[-1, 1] < 1.2 * rms[-1, 0]


def test_the_sigma_of_a_region_is_that_of_the_points_about() -> None:
    rng = np.random.default_rng(2)
    half = np.repeat([0.1, 0.4], 6 * 24)
    noisy = half * rng.uniform(0.8, 1.2, len(half))
    found = sigmas(_tube(noisy))
    # Chance is gone, and the step between the halves is where it was.
    assert np.std(found[:24]) < 0.35 * np.std(noisy[:24])
    np.testing.assert_allclose(found[:24], 0.1, rtol=0.15)
    np.testing.assert_allclose(found[-24:], 0.4, rtol=0.15)

"""The volume of a solid is as well known as the shapes that bound it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.needs import needs
from tests.shapes.solids import closed_box, noisy, turned
from turnscan.arrays import Floats
from turnscan.mesh import Mesh, submesh
from turnscan.shapes.primitives import find_shapes, shapes_volume_sigma, volume_slopes
from turnscan.shapes.primitives._surface_kernels import frame
from turnscan.workflows._inspection._shapes import find_shapes as found_on

TUBE = [(9.0, 0.0), (14.0, 0.0), (14.0, 20.0), (9.0, 20.0), (9.0, 0.0)]
SIGMA = 0.02


def _moved(mesh: Mesh, X: Floats) -> float:
    return replace(mesh, vertices=X).volume


def test_slopes_are_what_the_volume_does_when_a_shape_moves() -> None:
    """Walls and ends of a tube: each radius, and each end's shift and tilt, by moving the mesh."""
    mesh = turned(TUBE, 0.5, 180)
    found = find_shapes(noisy(mesh, 1e-4, 1), relations=False)
    assert sorted(s.kind for s in found.shapes) == ["cylinder", "cylinder", "plane", "plane"]
    t, r = mesh.triangles, np.hypot(*mesh.vertices[:, :2].T)
    own = np.full(len(t), -1, dtype=np.int32)
    for k, s in enumerate(found.shapes):
        own[np.abs(s.distances(t.reshape(-1, 3))).reshape(-1, 3).max(axis=1) < 0.01] = k
    assert (own >= 0).all()
    slope = volume_slopes(found, t, own).reshape(-1, 7)
    whole, step = mesh.volume, 1e-4
    for k, s in enumerate(found.shapes):
        on = np.abs(s.distances(mesh.vertices)) < 0.01
        X = mesh.vertices.copy()
        if s.kind == "plane":
            for j, e in enumerate(frame(s.axis)):
                X[on] -= step * ((X[on] - s.point) @ e)[:, None] * s.axis
                tilt = (_moved(mesh, X) - whole) / step
                assert slope[k, j] == pytest.approx(tilt, abs=2e-3 * mesh.area_of())
                X = mesh.vertices.copy()
            X[on] += step * s.axis
            at = 4
        else:
            X[on, :2] *= 1 + step / r[on, None]
            at = 5
        assert slope[k, at] == pytest.approx((_moved(mesh, X) - whole) / step, rel=0.01)


def test_shapes_alone_say_how_well_a_volume_is_known() -> None:
    """Eight boxes with noise: volumes of the shapes' own prism scatter as the shapes say."""
    needs("OpenCASCADE")
    off, said = list[float](), list[float]()
    t = closed_box()
    for seed in range(8):
        step = found_on(noisy(t, SIGMA, seed)).step
        assert step.volume is not None
        assert step.figures["faces"] == 6
        off.append(step.volume.value - 24 * 16 * 12)
        said.append(step.volume.known.shapes)
        assert step.volume.sigma == pytest.approx(step.volume.known.shapes, rel=0.5)
        assert f"± {step.volume.sigma:.3g} mm³" in step.findings[0].message
        assert step.figures["volume_sigma_mm3"] == step.volume.sigma
    z = np.array(off) / np.array(said)
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.7


def test_what_a_hole_covers_is_said_to_be_unknown() -> None:
    """Six planes close where the mesh has a hole in one of them."""
    needs("OpenCASCADE")
    whole = noisy(closed_box(), SIGMA, 1)
    middle = whole.triangles.mean(axis=1)
    torn = submesh(whole, np.linalg.norm(middle - [12.0, 8.0, 12.0], axis=1) > 3.0)
    for mesh, unknown in ((whole, False), (torn, True)):
        step = found_on(mesh).step
        assert step.volume is not None
        assert step.volume.closed is not unknown
        assert ("holes cover is not known" in step.findings[0].message) is unknown


@pytest.mark.parametrize("deep", [0.0, 0.4])
def test_a_filling_in_a_pocket_that_the_solid_lacks_is_in_its_uncertainty(deep: float) -> None:
    """Of a pocket its sides alone were measured: six planes close over it. On a face that goes on
    about a filling nothing is doubted."""
    needs("OpenCASCADE")
    whole = closed_box()
    X = whole.vertices.copy()
    floor = (X[:, 2] == 12.0) & (np.abs(X[:, :2] - [12.0, 8.0]) <= [4.0, 3.0]).all(axis=1)
    X[floor, 2] -= deep
    middle = whole.triangles.mean(axis=1)
    seen = (middle[:, 2] < 11.99) | (np.abs(middle[:, :2] - [12.0, 8.0]) > [4.0, 3.0]).any(axis=1)
    pocket = whole.volume - replace(whole, vertices=X).volume
    mesh = noisy(replace(whole, vertices=X), SIGMA, 1)
    step = found_on(Mesh(mesh.vertices, mesh.faces, measured=seen)).step
    assert step.volume is not None
    assert step.figures["faces"] == 6
    off = step.volume.value - (whole.volume - pocket)
    assert abs(off) < 2 * step.volume.sigma
    assert pocket / 2 < step.volume.sigma < 2 * pocket or (deep == 0 and step.volume.sigma < 3)


def test_a_calibration_moves_all_faces_of_a_solid_at_once() -> None:
    """A scale that is unknown by a part in a thousand makes three of a volume."""
    mesh = closed_box()
    quiet = noisy(mesh, 1e-4, 1)
    found = find_shapes(quiet, moves=[1e-3 * quiet.vertices])
    t = mesh.triangles
    own = np.array(
        [
            int(np.argmin([np.abs(s.distances(corners)).max() for s in found.shapes]))
            for corners in t
        ],
        dtype=np.int32,
    )
    assert len(found.shapes) == 6
    assert shapes_volume_sigma(found, t, own) == pytest.approx(3e-3 * mesh.volume, rel=0.01)

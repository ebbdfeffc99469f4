"""Planes and half-planes through meshes: polylines, their sigma and the filled faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.shapes.outlines import along, regular, wall
from turnscan.errors import InputError
from turnscan.mesh import Mesh, join
from turnscan.shapes import fit_section, half_plane_cut, plane_cut
from turnscan.shapes._section import cross_section

BOX = Mesh(
    np.array([[x, y, z] for z in (0.0, 10) for y in (-3.0, 3) for x in (-5.0, 5)]),
    np.array([[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
              [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]]),
)  # fmt: skip


def _area(points: np.ndarray) -> float:
    x, y = points.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


@pytest.mark.parametrize(
    ("normal", "distance", "size"),
    [([0, 0, 1], 4.0, (10, 6)), ([1, 0, 0], 1.0, (6, 10)), ([0, 1, 0], 0.5, (10, 10)),
     ([0, 0, 5], 20.0, (10, 6)), ([0, 0, 1], 0.0, (10, 6)), ([0, 0, 1], 10.0, (10, 6))],
)  # fmt: skip
def test_a_box_is_cut_into_a_rectangle_as_people_look_at_it(
    normal: list[float], distance: float, size: tuple[float, float]
) -> None:
    cut = plane_cut(normal, distance)
    [chain] = cross_section(BOX, cut)
    assert chain.closed
    assert np.allclose(np.ptp(chain.points, axis=0), size)
    assert _area(chain.points) > 0, "material on the left"
    assert cut.up[2] == 1.0 or cut.right[0] == cut.up[1] == 1.0
    part = cut.in_part(chain.points)
    assert np.allclose(part @ np.array(normal), distance)
    assert part[:, 0].min() >= -5 - 1e-9


def test_a_plane_across_the_axis_has_its_length() -> None:
    [chain] = cross_section(BOX, plane_cut([1, 1, 0], 0.0))
    assert np.allclose(np.ptp(chain.points, axis=0), (6 * np.sqrt(2), 10))


def test_a_half_plane_ends_at_the_axis() -> None:
    [chain] = cross_section(BOX, half_plane_cut(0.0))
    assert not chain.closed
    assert np.allclose(np.ptp(chain.points, axis=0), (5, 10))
    assert np.allclose(sorted(chain.points[[0, -1], 1]), (0, 10))
    assert np.allclose(chain.points[[0, -1], 0], 0)
    moved = replace(BOX, vertices=BOX.vertices + [20, 0, 0])
    [chain] = cross_section(moved, half_plane_cut(0.0))
    assert chain.closed


def test_points_carry_the_sigma_of_their_vertices() -> None:
    mesh = wall(along(regular(4, 10.0), 1.0), np.array([0.0, 1.0]), 0.02)
    [chain] = cross_section(mesh, plane_cut([0, 0, 1], 0.5))
    # In the middle between two independent vertices: σ/√2.
    assert np.allclose(chain.sigma, 0.02 / np.sqrt(2), rtol=0.02)
    [chain] = cross_section(mesh, plane_cut([0, 0, 1], 0.0))
    assert np.allclose(chain.sigma, 0.02, rtol=0.02)


def test_what_was_filled_is_told_and_not_fitted() -> None:
    outline = along(np.array([[10.0, -6], [10, 6], [-10, 6], [-10, -6]]), 0.5)
    mesh = wall(outline, np.array([0.0, 1.0]), 0.01)
    middle = mesh.triangles.mean(axis=1)
    gap = (middle[:, 1] > 5.5) & (np.abs(middle[:, 0]) < 4)
    bulged = mesh.vertices + 0.8 * ((mesh.vertices[:, [1]] > 5.5) & (
        np.abs(mesh.vertices[:, [0]]) < 3)) * [0, 1, 0]  # fmt: skip
    mesh = replace(mesh, vertices=bulged, measured=~gap)
    s = fit_section(mesh, plane_cut([0, 0, 1], 0.4))
    [chain] = s.chains
    assert chain.closed
    assert 7.0 < chain.steps[chain.filled].sum() < 11.0
    [outline_found] = s.fitted
    assert not outline_found.closed
    assert abs(outline_found.box[1, 1] - 6.0) < 0.03, "the filling has no say"
    assert len(chain.runs(True)) == len(chain.runs(False)) == 1


def test_bad_input_says_where_the_part_is() -> None:
    with pytest.raises(InputError, match=r"misses the part: the part reaches from z = 0.000 to"):
        cross_section(BOX, plane_cut([0, 0, 1], 11.0, "z = 11 mm"))
    with pytest.raises(InputError, match="from the axis on that side"):
        cross_section(replace(BOX, vertices=BOX.vertices - [20, 0, 0]), half_plane_cut(0.0))
    with pytest.raises(InputError, match="no faces"):
        cross_section(Mesh(BOX.vertices, np.zeros((0, 3), np.int32)), plane_cut([0, 0, 1], 5))
    for normal in ([0, 0, 0], [0, np.nan, 1], [1, 2]):
        with pytest.raises(InputError, match="normal"):
            plane_cut(normal, 1.0)


def test_a_plane_in_a_gap_is_told_from_one_beside_the_part() -> None:
    apart = join([BOX, replace(BOX, vertices=BOX.vertices + [0.0, 0.0, 15.0])])
    with pytest.raises(InputError, match="lies in a gap of the surface"):
        cross_section(apart, plane_cut([0, 0, 1.0], 12.0, "z = 12 mm"))
    with pytest.raises(InputError, match=r"reaches from z = 0.000 to 25.000 mm"):
        cross_section(apart, plane_cut([0, 0, 1.0], 30.0, "z = 30 mm"))

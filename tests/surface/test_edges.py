"""Faces that a part may have beyond a border: turned off just so far that nobody saw them."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh
from turnscan.surface.holes import holes
from turnscan.surface.holes._edges import faces_beyond
from turnscan.surface.holes._hole_places import Places, places_in

HIGH = 30.0


def _plate() -> Mesh:
    """One upright square that looks along +x, its lower side on the platter."""
    y, z = np.meshgrid(np.linspace(-15.0, 15.0, 16), np.linspace(0.0, HIGH, 16))
    vertices = np.stack([np.zeros_like(y), y, z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(15), np.arange(15), indexing="ij"))
    a = i * 16 + j
    b, c, d = a + 1, a + 16, a + 17
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)])
    return Mesh(vertices, faces.astype(np.int32))


def _asked(limit: float, hit: float, floor: float = -1.0) -> tuple[Places, Floats, Bools]:
    """With all in sight that is turned off from +x by less than ``limit`` degrees; what is kept
    ends below ``floor``."""
    mesh = _plate()
    found = holes(mesh)

    def measurable(places: Places) -> Bools:
        return np.asarray(places.normal[:, 0] > np.cos(np.deg2rad(limit)))

    def ahead(X: Floats, way: Floats) -> Floats:
        return np.full(len(X), hit)

    return faces_beyond(
        mesh, found, places_in(mesh, found), measurable, ahead, lambda X: X[:, 2] < floor
    )


def test_the_part_turns_off_by_little_more_than_what_hides_it() -> None:
    sides, area, _ = _asked(70.0, 10.0)
    # The next bend is 75°, and most edges are square.
    assert sides.normal[:, 0] == pytest.approx(0.0, abs=0.02)
    assert len(sides.at) == len(area)
    assert sides.at[:, 2].min() > -1.0
    # Four sides of 30 mm go 10 mm back, and half a margin that is left out at the border.
    assert area.sum() == pytest.approx(120.0 * 12.0, rel=0.1)


def test_a_face_that_comes_to_nothing_goes_half_as_far_as_its_hole_is_large() -> None:
    _, near, _ = _asked(70.0, 10.0)
    _, far, _ = _asked(70.0, np.inf)
    assert 1.5 < far.sum() / near.sum() < 3.0


def test_where_all_would_have_been_measured_there_is_no_face() -> None:
    sides, area, _ = _asked(179.9, 10.0)
    assert len(sides.at) == 0
    assert len(area) == 0


def test_beyond_a_square_edge_a_little_more_is_taken_and_straight_on_nothing() -> None:
    assert _asked(100.0, 10.0)[0].normal[:, 0] == pytest.approx(np.cos(np.deg2rad(125.0)))
    straight = _asked(0.0, 10.0)[0]
    assert straight.normal[:, 0] == pytest.approx(1.0)
    assert not straight.bent.any()


def test_where_what_is_kept_ends_the_face_it_stands_on_is_missing() -> None:
    sides, area, cut = _asked(70.0, 10.0, floor=1.0)
    foot = 30.0 * 0.5 * HIGH * 2**0.5  # a lower side, and half the size of the hole
    assert area[cut].sum() == pytest.approx(foot, rel=0.15)
    assert sides.at[cut, 2].max() < 10.0

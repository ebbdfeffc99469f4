"""Faces that a part may have beyond a border: turned off just so far that nobody saw them."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh, join
from turnscan.surface.holes import holes
from turnscan.surface.holes._edges import _crowd, _feet, _within, faces_beyond
from turnscan.surface.holes._hole_places import Places, places_in

HIGH = 30.0


def _near(X: Floats) -> Floats:
    """Samples a millimetre apart."""
    return np.ones(len(X))


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
        mesh, found, places_in(mesh, found), measurable, ahead, lambda X: X[:, 2] < floor, _near
    )[:3]


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
    """A round bar that nothing more was measured of: the disc, and hardly a strip above it."""
    turn, z = np.meshgrid(np.linspace(0.0, 2 * np.pi, 48, endpoint=False), np.linspace(0, HIGH, 16))
    vertices = np.stack([20 * np.cos(turn), 20 * np.sin(turn), z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(15), np.arange(48), indexing="ij"))
    a, b = i * 48 + j, i * 48 + (j + 1) % 48
    faces = np.concatenate([np.stack([a, b, b + 48], -1), np.stack([a, b + 48, a + 48], -1)])
    mesh = Mesh(vertices, faces.astype(np.int32))
    found = holes(mesh)
    sides, area, cut = faces_beyond(
        mesh, found, places_in(mesh, found),
        lambda p: np.zeros(len(p.at), np.bool_),
        lambda X, way: np.full(len(X), 1.0),
        lambda X: X[:, 2] < 1.0,
        _near,
    )[:3]  # fmt: skip
    assert area[cut].sum() == pytest.approx(np.pi * 20.0**2, rel=0.03)
    assert sides.at[cut, 2].max() < 1.0
    assert len({found[k].centre[2] > 1.0 for k in sides.hole[cut]}) == 1


def test_a_border_that_is_cut_along_one_side_has_a_foot_by_its_length() -> None:
    sides, area, cut = _asked(70.0, 10.0, floor=1.0)
    foot = 30.0 * 0.25 * HIGH * 2**0.5  # a lower side, and a quarter of the size of the hole
    assert area[cut].sum() == pytest.approx(foot, rel=0.15)
    assert sides.at[cut, 2].max() < 10.0


def test_the_foot_is_one_whatever_holes_its_rim_belongs_to() -> None:
    """Two rows of border, 30 mm long and 20 mm apart; one row by itself says nothing of depth."""
    y = np.linspace(0.0, 30.0, 16)
    X = np.array([[x, v, 0.0] for x in (0.0, 20.0) for v in y] + [[5.0, 5.0, 40.0]])
    cut, width, size = X[:, 2] < 1.0, np.full(len(X), 2.0), np.full(len(X), 40.0)
    up = np.tile([0.0, 0.0, 1.0], (len(X), 1))
    foot = _feet(X, up, cut, width, size)
    assert foot.sum() == pytest.approx(600.0)
    assert foot[-1] == 0.0
    assert _feet(X, up, cut & (X[:, 0] < 1.0), width, size).sum() == pytest.approx(16 * 2.0 * 10.0)


def test_the_foot_of_a_plate_is_as_wide_as_the_plate_is_thick() -> None:
    """Two rows of border 2 mm apart, which look away from each other; or alike, as a rough one."""
    y = np.linspace(0.0, 30.0, 16)
    X = np.array([[x, v, 0.0] for x in (0.0, 2.0) for v in y])
    away = np.where(X[:, :1] > 1.0, 1.0, -1.0) * [[1.0, 0.0, 0.0]]
    cut, width, size = np.ones(32, np.bool_), np.full(32, 2.0), np.full(32, 40.0)
    assert _feet(X, away, cut, width, size).sum() == pytest.approx(60.0)
    by_size = 32 * 2.0 * 0.25 * 40.0
    assert _feet(X, np.abs(away), cut, width, size).sum() == pytest.approx(by_size)


@pytest.mark.parametrize(("apart", "thin"), [(3.0, True), (1.5, False)])
def test_a_side_thinner_than_two_samples_is_known_and_no_guess(apart: float, thin: bool) -> None:
    """Front and back of a plate, 4 mm thick, whose sides nobody measured."""
    front = _plate()
    back = Mesh(front.vertices - [4.0, 0.0, 0.0], front.faces[:, ::-1])
    mesh = join([front, back])
    found = holes(mesh)
    sides, area, cut, known = faces_beyond(
        mesh, found, places_in(mesh, found),
        lambda p: np.zeros(len(p.at), np.bool_),
        lambda X, way: np.full(len(X), 10.0),
        lambda X: np.zeros(len(X), np.bool_),
        lambda X: np.full(len(X), apart),
    )  # fmt: skip
    assert not cut.any()
    if not thin:
        assert not known.any()
        return
    # Four sides of 30 by 4 mm, once for the border of either face; corners look two ways.
    assert area[known].sum() == pytest.approx(2 * 4 * 30.0 * 4.0, rel=0.1)
    assert area[known].sum() > 0.9 * area.sum()
    middle = sides.at[known] - [-2.0, 0.0, 0.5 * HIGH]
    assert np.abs(sides.normal[known, 0]).max() < 0.2
    assert np.einsum("ij,ij->i", middle, sides.normal[known]).min() > 10.0


def test_a_face_that_is_searched_from_two_sides_counts_once() -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.arange(20.0), np.arange(20.0)))
    once = np.stack([x, y, np.zeros_like(x)], axis=1)
    at = np.concatenate([once, once + [0.3, 0.3, 0.0]])
    up = np.tile([0.0, 0.0, 1.0], (len(at), 1))
    one, both = np.zeros(len(at), np.int32), np.ones(len(at))
    crowd = _crowd(at, up, one, both)
    inner = ((at[:, :2] > 4) & (at[:, :2] < 15)).all(axis=1)
    assert np.median(crowd[inner]) == pytest.approx(2.0, rel=0.15)
    # Faces that look another way, or belong to another hole, are others.
    other = np.where(np.arange(len(at)) < len(once), 1.0, -1.0)[:, None] * up
    assert np.median(_crowd(at, other, one, both)) == pytest.approx(1.0, rel=0.1)
    assert np.median(_crowd(at, up, (other[:, 2] > 0).astype(np.int32), both)) < 1.1


def test_what_a_border_bounds_lies_within_its_hull() -> None:
    mesh = _plate()
    found = holes(mesh)
    X = np.array([[0.0, 0.0, 10.0], [0.0, -10.0, 10.0]])
    ways = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    hole = np.zeros(2, np.int32)
    np.testing.assert_allclose(_within(mesh, found, X, ways, hole), [20.0, 25.0], atol=0.1)
    # Out of a flat border's plane its hull ends at once.
    assert _within(mesh, found, X[:1], np.array([[1.0, 0.0, 0.0]]), hole[:1])[0] < 0.1

"""Ends of bores, and the missing ends of a bar, through which one looks as well."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.mesh import Mesh, join
from turnscan.surface.holes import holes
from turnscan.surface.holes._hole_places import places_in
from turnscan.surface.holes._through_holes import through


def _sheet(y: float, flip: bool) -> Mesh:
    """An upright square of 60 mm with a window of 20 mm in its middle, that looks along y."""
    x, z = np.meshgrid(np.linspace(-30.0, 30.0, 25), np.linspace(0.0, 60.0, 25))
    vertices = np.stack([x, np.full_like(x, y), z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(24), np.arange(24), indexing="ij"))
    keep = (np.abs(i - 11.5) > 4) | (np.abs(j - 11.5) > 4)
    a = (i * 25 + j)[keep]
    faces = np.concatenate([np.stack([a, a + 1, a + 26], -1), np.stack([a, a + 26, a + 25], -1)])
    return Mesh(vertices, (faces[:, ::-1] if flip else faces).astype(np.int32))


def _bar(slant: float) -> Mesh:
    """A round bar along x whose ends are missing; it tapers to either side by ``slant``."""
    turn, x = np.meshgrid(np.linspace(0.0, 2 * np.pi, 48, endpoint=False), np.linspace(-30, 30, 31))
    r = 20.0 - slant * np.abs(x)
    vertices = np.stack([x, r * np.cos(turn), 30.0 + r * np.sin(turn)], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(30), np.arange(48), indexing="ij"))
    a, b = i * 48 + j, i * 48 + (j + 1) % 48
    faces = np.concatenate([np.stack([a, b, b + 48], -1), np.stack([a, b + 48, a + 48], -1)])
    return Mesh(vertices, faces.astype(np.int32))


def test_two_windows_behind_each_other_are_a_bore() -> None:
    mesh = join([_sheet(-10.0, False), _sheet(10.0, True)])
    found = [h for h in holes(mesh) if h.size < 40.0]
    assert len(found) == 2
    deep = through(mesh, found, places_in(mesh, found), np.ones(2, np.bool_))
    assert deep == pytest.approx([20.0, 20.0])


@pytest.mark.parametrize("slant", [0.0, 0.3])
def test_the_missing_ends_of_a_bar_are_no_bore(slant: float) -> None:
    mesh = _bar(slant)
    found = holes(mesh)
    assert len(found) == 2
    deep = through(mesh, found, places_in(mesh, found), np.ones(2, np.bool_))
    assert deep.tolist() == [0.0, 0.0]


def test_one_window_by_itself_is_no_bore() -> None:
    """Asked for one of them alone there is nothing that it could lead to."""
    mesh = join([_sheet(-10.0, False), _sheet(10.0, True)])
    found = [h for h in holes(mesh) if h.size < 40.0]
    deep = through(mesh, found, places_in(mesh, found), np.array([True, False]))
    assert deep.tolist() == [0.0, 0.0]

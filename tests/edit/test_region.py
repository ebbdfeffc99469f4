"""A region means the same on the mesh it was drawn on and on another mesh of the part."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.edit.surfaces import around, sheet
from turnscan.edit import Alive, Body, Region
from turnscan.edit._region import numbers_of, runs_of
from turnscan.errors import InputError


@given(st.sets(st.integers(0, 3000)))
def test_a_list_of_faces_survives_its_code(faces: set[int]) -> None:
    runs = runs_of(sorted(faces))
    assert numbers_of(runs, 3001).tolist() == sorted(faces)
    assert numbers_of(runs, 1500).tolist() == [f for f in sorted(faces) if f < 1500]


def test_a_few_bytes_cannot_ask_for_much_memory() -> None:
    assert numbers_of((0, 1 << 31) * 1000, 7).tolist() == list(range(7))


def test_on_its_own_mesh_the_region_is_exact() -> None:
    body = Body.of(sheet())
    faces = np.array([3, 4, 5, 99, 400])
    region = Region.of(body, faces)
    assert region.find(body).tolist() == faces.tolist()
    fewer = Alive(np.array([4, 7]), False).on(body)
    assert fewer.key == body.key
    assert region.find(fewer).tolist() == [3, 5, 99, 400]


@pytest.mark.parametrize("other", [sheet(n=24, noise=0.05), sheet(n=31), sheet(n=17)])
def test_on_another_mesh_the_region_is_where_it_was(other) -> None:
    mesh = sheet()
    where = ((15.0, 22.0), 9.0)
    region = Region.of(Body.of(mesh), around(mesh, *where))
    found, wanted = region.find(Body.of(other)), around(other, *where)
    # Its border can be off by half a face of either mesh.
    rim = 2 * np.pi * where[1] * 40 / 16
    assert len(np.setxor1d(found, wanted)) < 0.5 * rim * (len(other.faces) / 40**2)
    assert len(np.intersect1d(found, wanted)) > 0.8 * len(wanted)


def test_what_lies_beside_a_region_is_not_in_it_however_near() -> None:
    """A spike that another scan does not have: nothing of the sound surface goes with it."""
    mesh = sheet()
    spiky = mesh.vertices.copy()
    tip = 24 * 12 + 12
    spiky[tip, 2] += 6.0
    spike = np.flatnonzero((mesh.faces == tip).any(axis=1))
    body = Body.of(type(mesh)(spiky, mesh.faces))
    found = Region.of(body, spike).find(Body.of(mesh))
    assert len(found) <= len(spike)
    assert np.isin(found, spike).all()


def test_nothing_and_the_dead_cannot_be_chosen() -> None:
    body = Body.of(sheet())
    with pytest.raises(InputError, match="nothing is selected"):
        Region.of(body, [])
    for faces in ([-1], [len(body.alive)], [5]):
        with pytest.raises(InputError, match="do not exist"):
            Region.of(Alive(np.array([5]), False).on(body), faces)

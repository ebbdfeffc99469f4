"""The parts are closed, and lie on their exact surfaces."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.mesh import Mesh
from turnscan.simulate import PARTS, Part, from_mesh
from turnscan.simulate import part as make
from turnscan.simulate._solids import CHORD, bisected

# Bodies of several pieces: where they overlap, triangles lie inside, not on the surface.
_JOINED = {"ball-bar": 0.9, "shaft": 0.5, "hexagon": 0.3, "gear": 0.3, "bracket": 0.9}


@cache
def part(name: str) -> Part:
    """Made once: nothing changes a part."""
    return make(name)


@pytest.mark.parametrize("name", sorted(PARTS))
def test_every_part_is_closed_outward_and_stands_on_the_table(name: str) -> None:
    mesh = part(name).mesh
    edges = np.sort(np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    _, count = np.unique(edges @ (len(mesh.vertices), 1), return_counts=True)
    assert (count == 2).all()
    assert mesh.volume > 0
    assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=CHORD)


@pytest.mark.parametrize(
    "name", [n for n in sorted(PARTS) if n not in ("mug", "head", "mannequin", "bust")]
)
def test_triangles_lie_on_the_true_surface(name: str) -> None:
    made = part(name)
    assert made.distance is not None
    mesh = made.mesh
    some = mesh.triangles[:: max(1, len(mesh.faces) // 4000)]
    points = np.concatenate([some.mean(axis=1), some[:, 0]])
    d = np.abs(made.distance(points))
    on = d <= 2 * CHORD
    assert on.mean() >= _JOINED.get(name, 1.0)
    assert (made.distance(points) < 2 * CHORD).all()  # nothing sticks out


@pytest.mark.parametrize(
    ("name", "volume"),
    [
        ("sphere", 4 / 3 * np.pi * 20**3),
        ("cylinder", np.pi * 25**2 * 80),
        ("cone", np.pi * 70 / 3 * (35**2 + 35 * 10 + 10**2)),
        ("torus", 2 * np.pi**2 * 30 * 10**2),
        ("plate", 60 * 8 * 80),
        ("v-groove", (46 * 25 - 15 * 15) * 80),
        ("grooves", (60 * 10 - 3.5) * 80),
    ],
)
def test_volumes_are_those_of_the_formulae(name: str, volume: float) -> None:
    assert part(name).mesh.volume == pytest.approx(volume, rel=3e-4)


def test_the_cups_wall_is_as_thick_as_stated() -> None:
    made = part("cup")
    assert made.distance is not None
    for turn in (2.0,):
        r = np.linspace(22.0, 42.0, 4001)
        for h in (15.0, 45.0, 78.0):
            p = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full_like(r, h)])
            inside = made.distance(p) < 0
            across = inside.sum() * (r[1] - r[0])
            assert 2.4 <= across <= 2.75  # a slanted wall is a little wider along r


@given(st.floats(0.5, 30.0))
@settings(max_examples=10)
def test_bisection_keeps_the_surface(longest: float) -> None:
    mesh = part("hexagon").mesh
    fine = bisected(mesh, longest)
    t = fine.triangles
    assert np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max() <= longest
    assert fine.volume == pytest.approx(mesh.volume, rel=1e-9)


def test_an_unknown_part_names_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no simulated part 'teapot'.*cup"):
        part("teapot")


def test_a_mesh_without_faces_is_refused() -> None:
    with pytest.raises(InputError, match="no faces"):
        from_mesh("empty.stl", Mesh(np.zeros((3, 3)), np.zeros((0, 3), np.int32)))


def test_a_mesh_that_is_inside_out_is_turned_and_an_open_one_is_left_as_it_is() -> None:
    made = part("plate").mesh
    out = replace(made, faces=made.faces[:, ::-1])
    assert from_mesh("out", out).mesh.volume == pytest.approx(made.volume)
    assert from_mesh("plate", made).mesh is made
    open_ = replace(out, faces=out.faces[1:])
    assert from_mesh("open", open_).mesh is open_

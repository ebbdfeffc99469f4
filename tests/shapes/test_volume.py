"""What the uncertainty of a volume says of the surface between its points and over its gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from turnscan import shapes
from turnscan.surface import FillHow, Mesh, Provenance, fill, is_closed, submesh


def swept(section: np.ndarray, radius: float, turns: int) -> Mesh:
    """A ring: a closed section (m, 2), counter-clockwise, swept about the z axis."""
    phi = np.arange(turns) * 2 * np.pi / turns
    r, z = radius + section[:, 0], section[:, 1]
    x = np.stack([np.outer(np.cos(phi), r), np.outer(np.sin(phi), r), np.tile(z, (turns, 1))], -1)
    cell = np.arange(turns * len(r)).reshape(turns, -1)
    over, on = np.roll(cell, -1, axis=0), np.roll(cell, -1, axis=1)
    both = np.roll(over, -1, axis=1)
    a, b, c, d = cell.ravel(), over.ravel(), both.ravel(), on.ravel()
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Mesh(x.reshape(-1, 3), faces.astype(np.int32))


def ball(radius: float = 20.0, n: int = 48) -> Mesh:
    """A ball whose points lie about evenly."""
    i = np.arange(n * n) + 0.5
    z = 1 - 2 * i / (n * n)
    phi = i * np.pi * (1 + 5**0.5)
    x = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], -1)
    faces = ConvexHull(x).simplices
    t = x[faces]
    inward = np.einsum("ij,ij->i", np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), t[:, 0]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(radius * x, faces.astype(np.int32))


def test_a_ball_holds_what_bulges_between_its_points() -> None:
    mesh = ball()
    assert is_closed(mesh)
    lost = 4 / 3 * np.pi * 20.0**3 - mesh.volume
    assert lost > 0
    assert shapes.volume_sigma(mesh).between == pytest.approx(lost, rel=0.35)
    assert shapes.mean_curvature(mesh) == pytest.approx(4 * np.pi * 20.0, rel=0.01)


def test_a_round_ring_does_and_its_inside_counts_against_it() -> None:
    turn = np.arange(40) * 2 * np.pi / 40
    mesh = swept(8.0 * np.column_stack([np.cos(turn), np.sin(turn)]), 30.0, 150)
    lost = 2 * np.pi**2 * 30.0 * 64.0 - mesh.volume
    assert shapes.volume_sigma(mesh).between == pytest.approx(lost, rel=0.35)
    hollow = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert shapes.volume_sigma(hollow).between == pytest.approx(lost, rel=0.35)


def test_sharp_edges_lost_between_points_are_in_it_on_average() -> None:
    rng = np.random.default_rng(4)
    side, spacing, radius = 12.0, 1.0, 60.0
    lost, said = [], []
    for _ in range(12):
        at = [np.arange(rng.uniform(0.05, 0.95), side, spacing) for _ in range(4)]
        way = np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
        along = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
        section = np.concatenate(
            [
                side / 2 * w + (k - side / 2)[:, None] * a
                for k, w, a in zip(at, way, along, strict=True)
            ]
        )
        mesh = swept(section, radius, 360)
        lost.append(2 * np.pi * radius * side**2 - mesh.volume)
        said.append(shapes.volume_sigma(mesh).between)
    assert min(lost) > 0
    assert 0.5 < np.mean(said) / np.mean(lost) < 1.3


@pytest.mark.parametrize("how", ["flat", "tangent"])
def test_a_filled_gap_is_as_uncertain_as_its_filling_is_wrong(how: FillHow) -> None:
    whole = ball(n=80)
    gone = whole.triangles[..., 2].min(axis=1) > 16.0
    done = fill(submesh(whole, ~gone), how=how)
    wrong = abs(done.volume - whole.volume)
    said = shapes.volume_sigma(done)
    assert said.mostly == "what was filled"
    assert wrong < 2 * said.filled, "not surer than it may be"
    assert said.filled < 0.05 * whole.volume, "and not so wide that it says nothing"
    if how == "flat":
        assert said.filled < 4 * wrong
    assert shapes.volume_sigma(whole).filled == 0.0


def test_all_parts_are_in_the_measurement() -> None:
    whole = ball(n=30)
    v = len(whole.vertices)
    zero = np.zeros(v, np.int32)
    known = replace(whole, provenance=Provenance(np.full(v, 0.05), zero, zero, zero, ("left",)))
    said, told = shapes.volume_sigma(known), shapes.volume(known)
    assert told.sigma == pytest.approx(np.sqrt(said.noise**2 + said.between**2))
    assert said.mostly in told.text
    # Independent points: the area times sigma over the root of their number.
    assert said.noise == pytest.approx(known.area_of() * 0.05 / v**0.5, rel=0.1)
    nothing = replace(whole, measured=np.zeros(len(whole.faces), dtype=np.bool_))
    assert shapes.volume_sigma(nothing).filled == pytest.approx(whole.volume)

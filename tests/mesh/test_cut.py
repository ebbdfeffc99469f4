"""Cuts by a plane: exact, closed, and of the volume that geometry says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.edit.surfaces import sheet
from turnscan.errors import InputError
from turnscan.mesh import Mesh, crossings, cut, is_closed, join, sections
from turnscan.mesh._mesh import Provenance
from turnscan.simulate import part
from turnscan.surface.holes import holes


def tube(outer: float, inner: float, height: float, n: int = 60, at: float = 0.0) -> Mesh:
    """A closed tube along z, made of four rings."""
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([np.cos(a), np.sin(a)], axis=-1)
    rings = [(outer, 0.0), (outer, height), (inner, height), (inner, 0.0)]
    v = np.concatenate([np.column_stack([r * ring, np.full(n, z)]) for r, z in rings])
    v[:, 0] += at
    k = np.arange(n)
    faces = []
    for r in range(4):
        a0, b0 = r * n + k, r * n + (k + 1) % n
        a1, b1 = (r + 1) % 4 * n + k, (r + 1) % 4 * n + (k + 1) % n
        faces += [np.stack([a0, b0, b1], axis=-1), np.stack([a0, b1, a1], axis=-1)]
    return Mesh(v, np.concatenate(faces))


def ngon(radius: float, n: int = 60) -> float:
    return 0.5 * n * radius**2 * np.sin(2 * np.pi / n)


def area(mesh: Mesh, faces: np.ndarray) -> float:
    t = mesh.triangles[faces]
    return float(np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2)


def test_a_tube_cut_across_keeps_its_bore() -> None:
    mesh = tube(10, 6, 20)
    assert is_closed(mesh)
    for sign in (1, -1):
        done = cut(mesh, (0, 0, sign), sign * 8.0)
        assert is_closed(done)
        wanted = (ngon(10) - ngon(6)) * (12.0 if sign > 0 else 8.0)
        assert done.volume == pytest.approx(wanted, rel=1e-12)
        assert done.measured is not None
        assert area(done, ~done.measured) == pytest.approx(ngon(10) - ngon(6), rel=1e-12)
        open_cut = cut(mesh, (0, 0, sign), sign * 8.0, cap=False)
        assert sorted(round(h.perimeter, 6) for h in holes(open_cut)) == sorted(
            round(120 * r * np.sin(np.pi / 60), 6) for r in (6, 10)
        )


def test_the_lid_of_a_rough_part_does_not_lie_on_itself() -> None:
    smooth = tube(10, 6, 20, n=360)
    noise = np.random.default_rng(0).normal(0.0, 0.004, smooth.vertices.shape)
    rough = Mesh(smooth.vertices + noise, smooth.faces)
    for normal, offset in (
        ((0.36, 0.48, 0.8), 8.0),
        ((0.0, 0.6, 0.8), 8.0),
        ((1.0, 0.0, 0.01), 0.3),
    ):
        done = cut(rough, normal, offset)
        assert is_closed(done)
        assert done.measured is not None
        lid = ~done.measured
        assert lid.sum() > 10
        pairs = crossings(done)
        assert not lid[pairs].all(axis=1).any()


def test_sections_beside_and_within_each_other() -> None:
    mesh = join([tube(10, 6, 20), tube(4, 2, 20), tube(5, 1, 20, at=30)])
    done = cut(mesh, (0, 0, 1), 5.0)
    assert is_closed(done)
    ring = ngon(10) - ngon(6) + ngon(4) - ngon(2) + ngon(5) - ngon(1)
    assert done.volume == pytest.approx(15 * ring, rel=1e-12)
    assert done.measured is not None
    assert area(done, ~done.measured) == pytest.approx(ring, rel=1e-12)


@settings(max_examples=60)
@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1),
    st.floats(-0.9, 0.9),
)
def test_both_halves_of_any_cut_make_up_the_whole(normal, where) -> None:
    mesh = tube(10, 6, 20, n=24)
    unit = np.array(normal) / np.linalg.norm(normal)
    middle = unit @ (0, 0, 10)
    reach = 14.0 * where
    one = cut(mesh, unit, middle + reach)
    other = cut(mesh, -unit, -(middle + reach))
    for half in (one, other):
        assert not len(half.faces) or is_closed(half)
    assert one.volume + other.volume == pytest.approx(mesh.volume, rel=1e-9)
    caps = [0.0 if m.measured is None else area(m, ~m.measured) for m in (one, other)]
    assert caps[0] == pytest.approx(caps[1], rel=1e-9)


def test_the_cup_is_cut_lengthwise_and_stays_closed() -> None:
    cup = part("cup").mesh
    assert is_closed(cup)
    for normal in ((1, 0, 0), (0.3, 0.1, 0.9)):
        unit = np.array(normal) / np.linalg.norm(normal)
        place = float(unit @ cup.bounds.mean(axis=0)) + 0.137
        one, other = cut(cup, unit, place), cut(cup, -unit, -place)
        assert is_closed(one)
        assert is_closed(other)
        assert one.volume + other.volume == pytest.approx(cup.volume, rel=1e-9)


def test_an_open_surface_is_closed_along_the_section_alone() -> None:
    mesh = sheet(20)
    done = cut(mesh, (1, 0, 0), 17.3)
    assert done.measured is not None
    assert done.vertices[:, 0].min() == pytest.approx(17.3, abs=1e-9)
    flat = done.triangles[~done.measured][..., 0]
    assert np.allclose(flat, 17.3)
    assert mesh.provenance is not None
    assert isinstance(done.provenance, Provenance)
    assert set(done.provenance.step) <= set(range(8, 20))


@pytest.mark.parametrize("seed", range(4))
def test_an_open_chain_is_one_loop_whatever_the_order_of_faces(seed: int) -> None:
    """Three quarters of a tube's wall: its section begins where no side ends."""
    a = np.linspace(0, 1.5 * np.pi, 41)
    ring = np.stack([10 * np.cos(a), 10 * np.sin(a)], axis=-1)
    v = np.concatenate([np.column_stack([ring, np.full(41, z)]) for z in (0.0, 20.0)])
    k = np.arange(40)
    faces = np.concatenate(
        [np.stack([k, k + 1, k + 42], axis=-1), np.stack([k, k + 42, k + 41], axis=-1)]
    )
    mixed = np.random.default_rng(seed).permutation(faces)
    (loop,) = sections(Mesh(v, mixed), (0, 0, 1), 8.0)
    assert len(loop.points) == 81, "41 upright sides and 40 diagonals"
    around = np.unwrap(np.arctan2(loop.points[:, 1], loop.points[:, 0]))
    assert (np.diff(around) > 0).all() or (np.diff(around) < 0).all(), "from end to end, once"
    assert np.ptp(around) == pytest.approx(1.5 * np.pi)


def test_nothing_moves_and_a_plane_beside_the_part_changes_nothing() -> None:
    mesh = tube(10, 6, 20)
    assert cut(mesh, (0, 0, 1), -1.0) is mesh
    assert len(cut(mesh, (0, 0, 1), 21.0).faces) == 0
    kept = {tuple(v) for v in cut(mesh, (1, 0, 0), 0.3).vertices} & {
        tuple(v) for v in mesh.vertices
    }
    assert len(kept) == (mesh.vertices[:, 0] > 0.3).sum()
    through = cut(mesh, (0, 0, 1), 0.0)
    assert is_closed(through), "a plane that the bottom lies in"
    for normal in ((0, 0, 0), (np.nan, 0, 1), (1, 2)):
        with pytest.raises(InputError, match="normal"):
            cut(mesh, normal, 1.0)

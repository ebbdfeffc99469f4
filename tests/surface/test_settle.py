"""A mesh on the lattice: every format carries it, and what was sound stays sound."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats.parts import torus
from turnscan.formats import export, read_mesh
from turnscan.mesh import Mesh, is_closed, join, soundness
from turnscan.surface.clean import settled

FORMATS = (".stl", ".ply", ".obj", ".3mf", ".dxf", ".glb")


def sliced(part, seed, count, thin):
    """A closed part in which some faces are split near a side or a corner: slivers and caps."""
    rng = np.random.default_rng(seed)
    vertices, faces = list(part.vertices), part.faces.tolist()
    for f in rng.choice(len(faces), count, replace=False):
        a, b, c = faces[f]
        w = rng.dirichlet([1, 1, 1]) if rng.random() < 0.3 else np.array([0.5, 0.5, 0.0])
        w = (1 - thin) * w + thin * np.eye(3)[2]
        if rng.random() < 0.5:
            w = (1 - thin) * np.eye(3)[0] + thin * w
        vertices.append(w @ part.vertices[[a, b, c]])
        d = len(vertices) - 1
        faces[f] = [a, b, d]
        faces += [[b, c, d], [c, a, d]]
    return Mesh(np.array(vertices), np.array(faces, np.int32))


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    thin=st.sampled_from([0.0, 1e-14, 1e-9, 1e-7, 1e-5, 1e-3]),
    scale=st.sampled_from([0.5, 20.0, 700.0]),
    shift=st.sampled_from([0.0, 300.0]),
)
def test_slivers_go_and_every_format_carries_what_is_left(seed, thin, scale, shift):
    part = torus(24, 14)
    part = Mesh(part.vertices * scale / 20 + shift, part.faces)
    mesh = settled(sliced(part, seed, 20, thin))
    assert is_closed(mesh)
    assert soundness(mesh) == []
    assert mesh.volume == pytest.approx(part.volume, rel=1e-3 if shift * 10 > scale else 1e-5)
    assert np.array_equal(settled(mesh).vertices, mesh.vertices), "once is enough"
    for suffix in FORMATS:
        read = read_mesh(export(mesh, suffix), suffix)
        assert is_closed(read), suffix
        assert soundness(read) == [], suffix
        assert len(read.faces) == len(mesh.faces)


def test_surfaces_that_touch_do_not_become_one():
    part = torus(24, 14)
    far = part.vertices[:, 0].max() * 2
    mesh = settled(
        join([part, Mesh(part.vertices * (-1, 1, 1) + (far, 0, 0), part.faces[:, ::-1])])
    )
    for suffix in FORMATS:
        read = read_mesh(export(mesh, suffix), suffix)
        assert not [f for f in soundness(read) if f.code in ("surface.touching", "surface.equal")]


def test_what_cannot_be_repaired_is_named_with_place_and_number():
    part = torus(24, 14)
    twice = settled(join([part, Mesh(part.vertices + (3.0, 0.1, 0.2), part.faces)]))
    (found,) = soundness(twice)
    assert found.code == "surface.crossing"
    assert "mm" in found.where
    assert found.message[0].isdigit()

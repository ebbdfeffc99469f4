"""What is written reads back the same, whatever the numbers."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats.parts import box_with_hole, inside, measured, torus
from turnscan.errors import ExportError, InputError
from turnscan.formats import EXPORTERS, ExportOptions, Profiles, audit, export, read_mesh
from turnscan.mesh import Mesh, PointCloud

TEXT = ExportOptions(ascii=True)
CHOICES = [
    ExportOptions(),
    TEXT,
    ExportOptions(single=True),
    ExportOptions(dxf_forms=("polyface",)),
    ExportOptions(dxf_version="R2010"),
    ExportOptions(dxf_forms=("mesh", "polyface", "3dface"), dxf_version="R2010"),
]


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    """Few vertices with odd coordinates, faces in any order, some without area."""
    magnitude = draw(st.sampled_from([5e-324, 1e-310, 1e-12, 1e-3, 1.0, 1e3, 1e7]))
    offset = draw(st.sampled_from([0.0, 0.0, 1e7, -12345.678, 9e8]))
    number = st.floats(-1.0, 1.0, allow_nan=False)
    count = draw(st.integers(3, 9))
    rows = draw(st.lists(st.tuples(number, number, number), min_size=count, max_size=count))
    corner = st.integers(0, count - 1)
    faces = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=12))
    return Mesh(np.array(rows) * magnitude + offset, np.array(faces))


@pytest.mark.parametrize("suffix", EXPORTERS)
@given(mesh=meshes(), options=st.sampled_from(CHOICES))
@settings(max_examples=40)
def test_odd_coordinates_survive(suffix: str, mesh: Mesh, options: ExportOptions) -> None:
    data = export(mesh, suffix, options=options)
    found = audit(data, mesh, suffix, options=options)
    assert not [f for f in found if f.severity == "error"]


@pytest.mark.parametrize("suffix", EXPORTERS)
@pytest.mark.parametrize("options", CHOICES)
@pytest.mark.parametrize("mesh", [torus(30, 20), box_with_hole(), measured(torus(7, 5))])
def test_parts_survive(suffix: str, options: ExportOptions, mesh: Mesh) -> None:
    data = export(mesh, suffix, options=options)
    said = [f.code for f in audit(data, mesh, suffix, options=options)]
    lost = mesh.colour is not None and suffix in (".dxf", ".stl", ".xyz")
    assert said == (["export.no-colours"] if lost else [])
    assert data == export(mesh, suffix, options=options), "the same input, other bytes"
    read = read_mesh(data, suffix)
    if suffix != ".xyz":
        copies = len(options.dxf_forms) if suffix == ".dxf" else 1
        assert len(read.faces) == copies * len(mesh.faces)
        assert len(read.vertices) == len(mesh.vertices)
        assert read.volume == pytest.approx(copies * mesh.volume, rel=1e-6)


def test_one_triangle() -> None:
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0.5]]), np.array([[0, 1, 2]]))
    for suffix in EXPORTERS:
        assert audit(export(mesh, suffix), mesh, suffix) == []


def test_nothing_to_write_is_said() -> None:
    empty = Mesh(np.empty((0, 3)), np.empty((0, 3)))
    for suffix in EXPORTERS:
        with pytest.raises(InputError, match=r"no (faces|vertices|points)"):
            export(empty, suffix)
    points = Mesh(np.ones((3, 3)), np.empty((0, 3)))
    for suffix in (".dxf", ".stl", ".obj"):
        with pytest.raises(InputError, match="no faces"):
            export(points, suffix)


def test_a_coordinate_beyond_a_thousand_kilometres_is_refused() -> None:
    mesh = Mesh(np.eye(3) * 2e9, np.array([[0, 1, 2]]))
    for suffix in EXPORTERS:
        with pytest.raises(ExportError, match="2e\\+09 mm"):
            export(mesh, suffix)


def test_an_absurd_sigma_is_refused() -> None:
    mesh = measured(torus(4, 4))
    assert mesh.provenance is not None
    sigma = np.full(16, 1e10)
    cloud = PointCloud(mesh.vertices, sigma, *[np.zeros(16, np.int32)] * 3, ("left",))
    with pytest.raises(ExportError, match="does not fit"):
        export(cloud, ".xyz")


@pytest.mark.parametrize("options", [ExportOptions(), TEXT])
def test_ply_keeps_the_values_of_each_vertex(options: ExportOptions) -> None:
    mesh = measured(torus(9, 8))
    read = read_mesh(export(mesh, ".ply", options=options), ".PLY")
    assert mesh.provenance is not None
    assert read.provenance is not None
    assert read.colour is not None
    assert mesh.colour is not None
    np.testing.assert_array_equal(read.colour, mesh.colour)
    np.testing.assert_allclose(read.provenance.sigma, mesh.provenance.sigma, atol=1e-9)
    for name in ("laser", "step", "line"):
        np.testing.assert_array_equal(
            getattr(read.provenance, name), getattr(mesh.provenance, name)
        )
    assert read.provenance.lasers == ("left", "right hand")


def test_points_go_into_ply_and_xyz_and_nowhere_else() -> None:
    origin = measured(torus(9, 8))
    p = origin.provenance
    assert p is not None
    cloud = PointCloud(origin.vertices, p.sigma, p.laser, p.step, p.line, p.lasers)
    for suffix in (".ply", ".xyz"):
        data = export(cloud, suffix)
        assert audit(data, cloud, suffix) == []
        assert len(read_mesh(data, suffix).faces) == 0
    for suffix in (".dxf", ".stl", ".obj"):
        with pytest.raises(InputError, match="cannot hold points"):
            export(cloud, suffix)


def test_profiles_alone_become_a_dxf() -> None:
    profiles = Profiles({"left": (np.ones((2, 3)),)})
    assert audit(export(profiles, ".dxf"), profiles, ".dxf") == []
    with pytest.raises(InputError, match="cannot hold profiles"):
        export(profiles, ".stl")


def test_an_unknown_suffix_is_an_input_error() -> None:
    with pytest.raises(InputError, match="step"):
        export(torus(4, 4), ".step")
    with pytest.raises(InputError, match="''"):
        read_mesh(b"", "")


@pytest.mark.parametrize("suffix", EXPORTERS)
def test_the_origin_is_embedded(suffix: str) -> None:
    about = {"rig": "0123abcd", "step_mm": 0.5, "note": "naïve \n line"}
    data = export(torus(6, 5), suffix, options=ExportOptions(about=about))
    text = inside(data, suffix)
    assert b"0123abcd" in text
    assert b"turnscan" in text
    if suffix != ".glb":  # in which a metre is a metre
        assert re.search(b"mm|millimet(re|er)", text)
    assert audit(data, torus(6, 5), suffix) == []

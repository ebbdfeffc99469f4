"""Faces that were not measured stay marked, in every format that can say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.formats.parts import measured, torus
from turnscan.formats import ExportOptions, audit, export, read_mesh
from turnscan.mesh import Mesh

MARKS = np.random.default_rng(2).random(2 * 12 * 9) > 0.2
PART = replace(measured(torus(12, 9)), measured=MARKS)


def marked_faces(mesh: Mesh) -> set[tuple[float, ...]]:
    """The vertices of every face that was not measured."""
    return {tuple(np.round(t.ravel(), 3).tolist()) for t in mesh.triangles[~mesh.measured]}


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".3mf"])
@pytest.mark.parametrize("text", [False, True])
def test_marks_come_back_face_by_face(suffix: str, text: bool) -> None:
    options = ExportOptions(ascii=text)
    data = export(PART, suffix, options=options)
    assert not [f for f in audit(data, PART, suffix, options=options) if f.severity == "error"]
    read = read_mesh(data, suffix)
    assert np.array_equal(read.faces, PART.faces)
    assert np.array_equal(read.measured, MARKS)
    whole = replace(PART, measured=None)
    assert read_mesh(export(whole, suffix, options=options), suffix).measured is None
    other = replace(PART, measured=~MARKS)
    assert "export.values" in [f.code for f in audit(data, other, suffix, options=options)]


def test_a_glb_has_a_material_for_them() -> None:
    data = export(PART, ".glb")
    assert not audit(data, PART, ".glb")
    read = read_mesh(data, ".glb")
    assert (~read.measured).sum() == (~MARKS).sum()
    assert marked_faces(read) == marked_faces(PART)
    assert read_mesh(export(replace(PART, measured=None), ".glb"), ".glb").measured is None
    fewer = replace(PART, measured=~MARKS)
    assert "export.coordinates" in [f.code for f in audit(data, fewer, ".glb")]


@pytest.mark.parametrize("forms", [("3dface",), ("polyface",), ("mesh",), ("3dface", "polyface")])
def test_a_dxf_has_a_layer_for_them(forms: tuple[str, ...]) -> None:
    options = ExportOptions(dxf_forms=forms, dxf_version="R2010")  # type: ignore[arg-type]
    data = export(PART, ".dxf", options=options)
    assert not [f for f in audit(data, PART, ".dxf", options=options) if f.severity == "error"]
    read = read_mesh(data, ".dxf")
    assert (~read.measured).sum() == len(forms) * (~MARKS).sum()
    assert marked_faces(read) == marked_faces(PART)
    for form in forms:
        assert f"TURNSCAN_{form.upper()}_FILLED_MM".encode() in data
    plain = export(replace(PART, measured=None), ".dxf", options=options)
    assert b"FILLED" not in plain
    assert read_mesh(plain, ".dxf").measured is None
    fewer = MARKS.copy()
    fewer[np.flatnonzero(~MARKS)[0]] = True
    other = replace(PART, measured=fewer)
    assert [f for f in audit(data, other, ".dxf", options=options) if f.severity == "error"]


def test_nothing_but_measured_points_goes_into_an_xyz() -> None:
    seen = np.zeros(len(PART.vertices), bool)
    seen[PART.faces[MARKS]] = True
    seen &= PART.provenance.step >= 0
    data = export(PART, ".xyz")
    assert [f.code for f in audit(data, PART, ".xyz")] == ["export.no-colours"]
    read = read_mesh(data, ".xyz")
    assert 0 < len(read.vertices) < len(PART.vertices)
    assert np.allclose(read.vertices, PART.vertices[seen], atol=1e-6)
    bare = replace(PART, provenance=None, measured=np.arange(len(MARKS)) > 30)
    lost = [f.code for f in audit(export(bare, ".xyz"), bare, ".xyz")]
    assert lost == ["export.no-colours"]


def test_a_part_of_which_nothing_was_measured() -> None:
    none = replace(PART, measured=np.zeros(len(MARKS), bool), provenance=None)
    for suffix in (".dxf", ".ply", ".obj", ".3mf", ".glb"):
        data = export(none, suffix)
        assert not [f for f in audit(data, none, suffix) if f.severity == "error"]
        assert not read_mesh(data, suffix).measured.any()

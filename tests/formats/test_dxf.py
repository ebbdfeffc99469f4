"""DXF: forms, layers, units, limits."""

from __future__ import annotations

import io
import re
from typing import get_args

import numpy as np
import pytest
from ezdxf.filemanagement import read

from tests.formats.parts import torus
from turnscan.errors import FormatError, InputError
from turnscan.formats import (
    DxfForm,
    ExportOptions,
    Profiles,
    audit,
    export,
    read_dxf,
    read_dxf_content,
    write_dxf,
)
from turnscan.mesh import Mesh
from turnscan.points import RangeGrid
from turnscan.points import profiles as profiles_of

PART = torus(12, 9)
LINES = Profiles({"left": (PART.vertices[:5], PART.vertices[7:8]), "2": (PART.vertices[10:20],)})


def tally(count: int) -> Mesh:
    """A mesh of exactly ``count`` vertices, all used: loose triangles, the last with a tail."""
    i = np.arange(count - count % 3).reshape(-1, 3)
    tail = [[k - 2, k - 1, k] for k in range(count - count % 3, count)]
    rng = np.random.default_rng(1)
    return Mesh(rng.uniform(-50, 50, (count, 3)), np.array([*i.tolist(), *tail]))


def ribbon(count: int) -> Mesh:
    """A mesh of exactly ``count`` faces, each sharing two vertices with the one before."""
    i = np.arange(count)
    rng = np.random.default_rng(1)
    return Mesh(rng.uniform(-50, 50, (count + 2, 3)), np.stack([i, i + 1, i + 2], axis=1))


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_each_form_has_its_layer_and_ezdxf_finds_no_fault(version: str) -> None:
    forms = [f for f in get_args(DxfForm) if version == "R2010" or f != "mesh"]
    options = ExportOptions(dxf_forms=tuple(forms), dxf_version=version)  # type: ignore[arg-type]
    data = write_dxf(PART, options, LINES)
    assert audit(data, PART, ".dxf", options=options, profiles=LINES) == []
    document = read(io.StringIO(data.decode("ascii")))
    assert document.acad_release == version
    auditor = document.audit()
    assert not auditor.errors
    assert not auditor.fixes
    kinds = {(e.dxftype(), e.dxf.layer) for e in document.modelspace()}
    assert ("3DFACE", "TURNSCAN_3DFACE_MM") in kinds
    assert ("POLYLINE", "TURNSCAN_POLYFACE_MM") in kinds
    assert ("POLYLINE", "TURNSCAN_PROFILES_LEFT_MM") in kinds
    assert ("POINT", "TURNSCAN_PROFILES_LEFT_MM") in kinds
    assert ("POLYLINE", "TURNSCAN_PROFILES_2_MM") in kinds
    assert (("MESH", "TURNSCAN_MESH_MM") in kinds) == (version == "R2010")
    assert all(layer in document.layers for _, layer in kinds)
    if version == "R2010":
        assert document.header["$INSUNITS"] == 4
        assert document.header["$MEASUREMENT"] == 1
    assert data.startswith(b"999\nunit: millimetre\n")


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_handles_are_unique_and_below_the_seed(version: str) -> None:
    options = ExportOptions(dxf_forms=("3dface", "polyface", "profiles"), dxf_version=version)  # type: ignore[arg-type]
    text = write_dxf(PART, options, LINES).decode()
    seed = int(re.findall(r"\$HANDSEED\n +5\n([0-9A-F]+)", text)[0], 16)
    pairs = re.findall(r" *(\d+)\n([^\n]*)\n", text[text.index("ENTITIES\n") + 9 :])
    drawn = [int(value, 16) for code, value in pairs if code == "5"]
    pairs = re.findall(r" *(\d+)\n([^\n]*)\n", text[: text.index("ENTITIES\n")])
    known = [int(value, 16) for code, value in pairs if code in ("5", "105") and value][1:]
    assert len(set(drawn)) == len(drawn) > len(PART.faces)
    assert not set(drawn) & set(known)
    assert seed > max(drawn)


@pytest.mark.parametrize(
    ("mesh", "runs"),
    [
        (tally(32_766), 1),
        (tally(32_767), 1),
        (tally(32_768), 2),
        (ribbon(32_000), 1),
        (ribbon(32_001), 2),
    ],
)
def test_polyfaces_stay_within_the_limit(mesh: Mesh, runs: int) -> None:
    options = ExportOptions(dxf_forms=("polyface",))
    data = export(mesh, ".dxf", options=options)
    sizes = re.findall(rb"\n70\n64\n71\n(\d+)\n72\n(\d+)\n", data)
    assert len(sizes) == runs
    assert all(int(v) <= 32_767 and int(f) <= 32_000 for v, f in sizes)
    assert sum(int(f) for _, f in sizes) == len(mesh.faces)
    found = audit(data, mesh, ".dxf", options=options)
    assert [f.code for f in found] == ["export.ezdxf-skipped"]


def test_profiles_are_cut_where_points_are_missing() -> None:
    points = np.arange(24.0).reshape(1, 8, 3)
    points[0, [0, 3, 5]] = np.nan
    missing = np.where(np.isnan(points[..., 0]), np.nan, 0.1)
    grid = RangeGrid(
        laser="left",
        steps=np.zeros(1, np.int32),
        angles=np.zeros(1),
        points=points,
        sigma=missing,
        amplitude=missing,
        flags=np.zeros((1, 8), np.uint16),
        closed=False,
    )
    runs = [p.points for step in profiles_of(grid, shortest=1) for p in step]
    profiles = Profiles({grid.laser: tuple(runs)})
    assert [len(run) for run in profiles.lines["left"]] == [2, 1, 2]
    content = read_dxf_content(export(profiles, ".dxf"))
    assert [len(run) for run in content.runs] == [2, 2, 1]
    np.testing.assert_allclose(content.runs[0], points[0, 1:3])


def test_what_a_form_needs_must_be_there() -> None:
    with pytest.raises(InputError, match="no profiles"):
        export(PART, ".dxf", options=ExportOptions(dxf_forms=("profiles",)))
    with pytest.raises(InputError, match="R12 has no MESH"):
        ExportOptions(dxf_forms=("mesh",))
    with pytest.raises(InputError, match="R13"):
        ExportOptions(dxf_version="R13")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="solid"):
        ExportOptions(dxf_forms=("solid",))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no DXF form"):
        ExportOptions(dxf_forms=())


def wrap(*lines: str) -> bytes:
    """A minimal drawing, as other programs write it."""
    return "\r\n".join(
        ["  0", "SECTION", "  2", "ENTITIES", *lines, "0", "ENDSEC", "0", "EOF", ""]
    ).encode()


def corner(k: int, x: float, y: float, z: float) -> list[str]:
    return [f" 1{k}", f"{x}", f" 2{k}", f"{x * 0 + y:E}", f" 3{k}", f"{z}"]


def test_a_quadrilateral_becomes_two_triangles() -> None:
    corners = [*corner(0, 0, 0, 0), *corner(1, 1, 0, 0), *corner(2, 1, 1, 0)]
    three = wrap("0", "3DFACE", "8", "0", *corners)
    assert len(read_dxf(three).faces) == 1
    quad = read_dxf(wrap("0", "3DFACE", "8", "0", *corners, *corner(3, 0, 1, 0)))
    assert quad.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_a_closed_polygon_mesh_is_read() -> None:
    nodes: list[str] = []
    for i in range(3):
        for j in range(2):
            nodes += ["0", "VERTEX", "70", "64", *corner(0, i, j, i * j)]
    head = ["0", "POLYLINE", "66", "1", "70", "17", "71", "3", "72", "2"]
    mesh = read_dxf(wrap(*head, *nodes, "0", "SEQEND"))
    assert len(mesh.vertices) == 6
    assert len(mesh.faces) == 6


def test_what_is_no_drawing_is_named() -> None:
    good = export(PART, ".dxf")
    cases = {
        b"AutoCAD Binary DXF\r\n\x1a\x00": "binary",
        b"AC1024\x00\x00": "binary",
        b"": "ends before",
        good[: len(good) // 2]: "ends before",
        good.replace(b"\n13\n", b"\nxx\n", 1): "'xx' is not a group code",
        good.replace(b"\n10\n55.000000", b"\n10\nnan", 1): "'nan' is not a finite",
        good.replace(b"\n10\n55.000000", b"\n10\n5,5", 1): "'5,5' is not the number",
    }
    for data, message in cases.items():
        with pytest.raises(FormatError, match=message):
            read_dxf(data)
    with pytest.raises(InputError, match="none of its 1 entities"):
        read_dxf(wrap("0", "LINE", *corner(0, 1, 2, 3)))


def test_lasers_of_like_names_keep_layers_of_their_own() -> None:
    run = [np.array([[0.0, 0, 0], [1, 0, 0]])]
    names = [
        "größe",
        "grüße",
        "left-camera-upper",
        "left-camera-lower",
        "ß" * 9,
        "ẞ" * 9,
        "GR__E_2",
    ]
    names += [f"left-camera-{i}" for i in range(12)]
    lines = Profiles(dict.fromkeys(names, run))
    data = write_dxf(None, ExportOptions(dxf_forms=("profiles",)), lines)
    document = read(io.StringIO(data.decode("ascii")))
    layers = {e.dxf.layer for e in document.modelspace().query("POLYLINE")}
    assert len(layers) == len(names)
    assert all(len(layer) <= 31 for layer in layers)
    assert {"TURNSCAN_PROFILES_LEFT-CAMER_MM", "TURNSCAN_PROFILES_LEFT-CAM_2_MM"} <= layers

"""Colours of vertices in every format that holds them, read by us and by others."""

from __future__ import annotations

import io
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.formats.parts import torus
from tests.needs import needs
from turnscan.errors import FormatError
from turnscan.formats import audit, export, read_mesh
from turnscan.mesh import Mesh

PLAIN = torus(12, 9)
COLOUR = np.random.default_rng(4).integers(0, 256, (len(PLAIN.vertices), 3)).astype(np.uint8)
PART = replace(PLAIN, colour=COLOUR)
MARKS = np.arange(len(PART.faces)) % 40 > 2
FILLED = replace(PART, measured=MARKS)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".3mf"])
@pytest.mark.parametrize("mesh", [PART, FILLED])
def test_colours_come_back(suffix: str, mesh: Mesh) -> None:
    data = export(mesh, suffix)
    assert not audit(data, mesh, suffix)
    read = read_mesh(data, suffix)
    assert read.colour is not None
    some = np.unique(mesh.faces if suffix != ".3mf" or mesh is PART else mesh.faces[MARKS])
    assert np.array_equal(read.colour[some], COLOUR[some])
    assert mesh is PART or (read.measured is not None and (~read.measured).sum() == (~MARKS).sum())
    assert read_mesh(export(PLAIN, suffix), suffix).colour is None
    other = replace(mesh, colour=COLOUR[::-1])
    assert "export.values" in [f.code for f in audit(data, other, suffix)]
    assert "export.values" in [f.code for f in audit(export(PLAIN, suffix), PART, suffix)]


@pytest.mark.parametrize("suffix", [".stl", ".dxf", ".xyz"])
def test_a_format_without_colours_says_that_they_are_lost(suffix: str) -> None:
    said = [f.code for f in audit(export(PART, suffix), PART, suffix)]
    assert said == ["export.no-colours"]
    assert not audit(export(PLAIN, suffix), PLAIN, suffix)


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_assimp_sees_the_same_colours(suffix: str, tmp_path: Path) -> None:
    needs("assimp")
    there, out = tmp_path / f"part{suffix}", tmp_path / "out.ply"
    there.write_bytes(export(PART, suffix))
    subprocess.run(["assimp", "export", there, out], check=True, capture_output=True, timeout=120)
    read = read_mesh(out.read_bytes(), ".ply")
    assert read.colour is not None
    for face, colours in zip(read.triangles[::7], read.colour[read.faces[::7]], strict=True):
        for corner, colour in zip(face, colours, strict=True):
            own = np.argmin(np.linalg.norm(PART.vertices - corner, axis=1))
            assert np.abs(COLOUR[own].astype(int) - colour).max() <= 1


def test_a_3mf_has_a_colour_group_as_the_standard_writes_it() -> None:
    with zipfile.ZipFile(io.BytesIO(export(FILLED, ".3mf"))) as file:
        model = ElementTree.fromstring(file.read("3D/3dmodel.model"))
    core = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    extra = "{http://schemas.microsoft.com/3dmanufacturing/material/2015/02}"
    group = model.find(f"{core}resources/{extra}colorgroup")
    assert group is not None
    shades = [c.get("color") for c in group]
    for k, face in enumerate(model.iter(f"{core}triangle")):
        if not MARKS[k]:
            assert (face.get("pid"), face.get("p1")) == ("1", "1"), "the material filled"
            continue
        assert face.get("pid") == group.get("id")
        for corner in "123":
            wanted = "#{:02X}{:02X}{:02X}".format(*COLOUR[int(face.get(f"v{corner}", ""))])
            assert shades[int(face.get(f"p{corner}", ""))] == wanted


def test_colours_that_are_none() -> None:
    text = export(PART, ".obj").decode()
    short = text.replace(next(line for line in text.splitlines() if line[:2] == "v "), "v 0 0 0", 1)
    assert read_mesh(short.encode(), ".obj").colour is None, "not every vertex has one"
    out = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(export(PART, ".3mf"))) as file,
        zipfile.ZipFile(out, "w") as new,
    ):
        for name in file.namelist():
            new.writestr(name, file.read(name).replace(b'p2="1"', b'p2="9999"'))
    with pytest.raises(FormatError, match="line"):
        read_mesh(out.getvalue(), ".3mf")

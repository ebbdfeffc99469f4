"""The same volume in programs that are not ours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.formats.parts import box_with_hole, torus
from tests.formats.readers import READERS, volume
from tests.needs import needs
from turnscan.formats import DxfForm, DxfVersion, ExportOptions, export
from turnscan.mesh import Mesh

TORUS = torus(60, 40)
PARTS = {
    "torus": TORUS,
    "box with hole": box_with_hole(),
    "partly filled": replace(TORUS, measured=np.arange(len(TORUS.faces)) % 7 > 1),
}


@pytest.fixture(params=READERS)
def reader(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    needs(name)
    return name


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("form", ["3dface", "polyface"])
@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_volume_as_others_read_it(
    reader: str, name: str, form: DxfForm, version: DxfVersion, tmp_path: Path
) -> None:
    part = PARTS[name]
    path = tmp_path / "part.dxf"
    path.write_bytes(
        export(part, ".dxf", options=ExportOptions(dxf_forms=(form,), dxf_version=version))
    )
    seen = READERS[reader](path)
    assert len(seen) == len(part.faces)
    assert volume(seen) == pytest.approx(part.volume, rel=1e-6)
    sides = np.ptp(seen.reshape(-1, 3), axis=0)  # assimp turns the part so that y is up
    np.testing.assert_allclose(np.sort(sides), np.sort(np.ptp(part.bounds, axis=0)), rtol=1e-5)


def test_several_polyfaces_as_others_read_them(reader: str, tmp_path: Path) -> None:
    part = torus(180, 100)
    path = tmp_path / "part.dxf"
    path.write_bytes(export(part, ".dxf", options=ExportOptions(dxf_forms=("polyface",))))
    seen = READERS[reader](path)
    assert len(seen) == len(part.faces)
    assert volume(seen) == pytest.approx(part.volume, rel=1e-6)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".3mf", ".glb"])
@pytest.mark.parametrize("text", [False, True])
def test_other_formats_in_assimp(suffix: str, text: bool, tmp_path: Path) -> None:
    needs("assimp")
    part: Mesh = PARTS["partly filled"]
    path = tmp_path / f"part{suffix}"
    path.write_bytes(export(part, suffix, options=ExportOptions(ascii=text)))
    seen = READERS["assimp"](path)
    unit = 1e-3 if suffix == ".glb" else 1.0  # glTF counts in metres, with y up
    assert volume(seen) == pytest.approx(part.volume * unit**3, rel=1e-6)
    sides = np.ptp(part.vertices, axis=0)[[0, 2, 1] if suffix == ".glb" else [0, 1, 2]]
    np.testing.assert_allclose(np.ptp(seen.reshape(-1, 3), axis=0), sides * unit, rtol=1e-6)

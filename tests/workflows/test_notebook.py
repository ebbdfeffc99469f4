"""What values show of themselves in a notebook, and meshes in other libraries."""

from __future__ import annotations

import base64
import importlib.util
import io
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image as Pillow

import turnscan as ts
from tests.analytic import make_rig
from tests.workflows.scans import write_can
from turnscan.calibrate import CalibrationQuality
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, Provenance
from turnscan.picture import Picture, brightened, coloured, png, shrunk
from turnscan.workflows import CalibratedRig

BOX = Mesh(
    np.array([(0.0, 0, 0), (10, 0, 0), (0, 20, 0), (0, 0, 30)]),
    np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
    Provenance(np.full(4, 0.02), np.zeros(4), np.arange(4), np.arange(4), ("left",)),
    np.arange(12).reshape(4, 3) * 20,
    np.array([True, True, True, False]),
)


@pytest.fixture(scope="module")
def can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_can(tmp_path_factory.mktemp("notebook") / "can.turnscan")


def _text(value: Any) -> str:
    """The words that a value shows; its HTML must be whole."""
    html = value._repr_html_().replace("&nbsp;", " ")
    html = re.sub(r"<(img[^>]*)>", r"<\1/>", html)
    return " ".join("".join(ElementTree.fromstring(html).itertext()).split())


def _picture(value: Any) -> np.ndarray:
    data = re.findall('data:image/png;base64,([^"]+)', value._repr_html_())
    assert len(data) == 1
    return np.asarray(Pillow.open(io.BytesIO(base64.b64decode(data[0]))))


def test_a_scan_and_its_frames(can: Path) -> None:
    with ts.open_scan(can) as scan:
        words = _text(scan)
        assert "24 in 24 steps, lasers L0" in words
        assert "320 × 240 uint8, grey" in words
        assert "0.00° to 345.00°" in words
        small = _picture(scan)
        shown = scan.frame(12).show()
    assert shown.shape == (240, 320)
    assert np.array_equal(np.asarray(Pillow.open(io.BytesIO(shown._repr_png_()))), shown.pixels)
    assert small.max() == 255
    assert np.median(small) < 120


def test_a_surface_its_grid_and_its_mesh(can: Path) -> None:
    part = ts.reconstruct(can, close=True)
    assert "surface" in _text(part).lower()
    assert "can.turnscan" in _text(part)
    assert "24, all the way round" in _text(part.grids[0])
    assert "mm" in _text(part.mesh)
    grid = _picture(part.grids[0])
    assert grid.shape[2] == 3
    for picture in (_picture(part), _picture(part.mesh)):
        assert picture.shape == (240, 320, 3)
        assert 0.1 < (picture < 250).any(axis=2).mean() < 0.9
    cut = part.sections(z=[10.0, 20.0])
    assert len(cut) == 2
    assert "z = 20 mm" in str(cut)
    assert "<svg" in cut._repr_html_()


def test_a_rig_is_drawn_with_its_lasers() -> None:
    rig = make_rig(elevation=0.1, lift=20.0)
    words = _text(rig)
    assert "from above" in words
    assert "L0" in words
    assert "° to the optical axis" in words
    assert "not known" in words


def test_a_calibration_shows_what_it_is_worth() -> None:
    figures = CalibrationQuality(
        0.11, 20, 0.8, {"L0": 0.2}, {"L0": 0.031}, {"L0": 9}, {}, 0.1, 0.02, {}, None, None,
        {"50 / 20 mm": 0.042}, {},
    )  # fmt: skip
    calibration: Any = SimpleNamespace(rig=make_rig(elevation=0.1, lift=20.0))
    finding = Finding("calibrate.few", "warning", "9 < 12 views")
    advice: Any = None
    done = CalibratedRig(
        Path("rig.json"), calibration.rig, calibration, figures, (), advice, (finding,)
    )
    words = _text(done)
    assert "Calibration rig.json" in words
    assert "0.110 px rms in 20 pictures" in words
    assert "± 0.042 mm (k = 2)" in words
    assert "9 < 12 views" in words
    assert done.rig is calibration.rig


def test_values_with_nothing_in_them_show_that(can: Path) -> None:
    assert "0" in _text(Mesh(np.zeros((0, 3)), np.zeros((0, 3))))
    grid = ts.reconstruct(can).grids[0]
    from dataclasses import replace

    empty = replace(
        grid, points=np.full(grid.points.shape, np.nan), sigma=np.full(grid.sigma.shape, np.nan)
    )
    assert "0 of" in _text(empty)


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (7, 4, 3)])
def test_a_png_holds_every_pixel(shape: tuple[int, ...], tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, shape).astype(np.uint8)
    assert np.array_equal(np.asarray(Pillow.open(io.BytesIO(png(pixels)))), pixels)
    Picture(pixels).save(tmp_path / "a.png")
    assert np.array_equal(np.asarray(Pillow.open(tmp_path / "a.png")), pixels)
    assert np.array_equal(np.asarray(Picture(pixels)), pixels)


def test_pictures_are_shrunk_and_brightened_without_losing_the_stripe() -> None:
    wide = np.zeros((40, 1000), np.uint16)
    wide[:, 501] = 4000
    small = shrunk(wide, 320)
    assert small.shape == (10, 250)
    assert (small.max(axis=1) == 4000).all()
    light = brightened(small)
    assert light.dtype == np.uint8
    assert light.max() > 240
    assert brightened(np.full((9, 9), 1, np.uint8)).max() < 60, "a dark picture stays dark"
    values = np.array([[0.0, 1.0, np.nan]])
    assert coloured(values).tolist()[0][2] == [255, 255, 255]
    assert coloured(values).tolist()[0][0] != coloured(values).tolist()[0][1]


def _stand_in(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a library is not installed, one that takes what it takes and keeps it."""
    if importlib.util.find_spec(name):
        return
    module = ModuleType(name)

    class PolyData:
        def __init__(self, points: Any, faces: Any) -> None:
            self.points, self.regular_faces = points, faces
            self.point_data: dict[str, Any] = {}
            self.cell_data: dict[str, Any] = {}

        @classmethod
        def from_regular_faces(cls, points: Any, faces: Any) -> Any:
            return cls(points, faces)

    class TriangleMesh:
        def __init__(self, vertices: Any, triangles: Any) -> None:
            self.vertices, self.triangles, self.vertex_colors = vertices, triangles, None

    parts = {
        "pyvista": {"PolyData": PolyData},
        "open3d": {
            "geometry": SimpleNamespace(TriangleMesh=TriangleMesh),
            "utility": SimpleNamespace(Vector3dVector=np.asarray, Vector3iVector=np.asarray),
        },
    }
    vars(module).update(parts[name])
    monkeypatch.setitem(sys.modules, name, module)


def test_a_mesh_for_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    _stand_in("pyvista", monkeypatch)
    there = BOX.to_pyvista()
    assert np.array_equal(there.points, BOX.vertices)
    assert np.array_equal(there.regular_faces, BOX.faces)
    assert there.point_data["sigma"].tolist() == [0.02] * 4
    assert there.cell_data["measured"].tolist() == [True, True, True, False]
    assert np.array_equal(there.point_data["colour"], BOX.colour)


def test_a_mesh_for_open3d(monkeypatch: pytest.MonkeyPatch) -> None:
    _stand_in("open3d", monkeypatch)
    there = BOX.to_open3d()
    assert np.array_equal(np.asarray(there.vertices), BOX.vertices)
    assert np.array_equal(np.asarray(there.triangles), BOX.faces)
    assert BOX.colour is not None
    assert np.allclose(np.asarray(there.vertex_colors) * 255, BOX.colour)


@pytest.mark.parametrize("name", ["trimesh", "open3d", "pyvista"])
def test_a_library_that_is_not_there_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=f"{name} is not installed") as caught:
        getattr(BOX, f"to_{name}")()
    assert f"turnscan[{name}]" in str(caught.value)

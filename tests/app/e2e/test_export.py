"""From the browser to CAD: what is downloaded is what was seen."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np

from tests.app.e2e.conftest import until
from tests.texture.painted import paint
from tests.texture.pillar import lathe
from turnscan.arrays import Floats
from turnscan.formats import read_mesh


def darker_upwards(points: Floats) -> Floats:
    """Grey levels of what is painted on the cup."""
    return np.asarray(180.0 - 2.0 * points[:, 2])


def painted(scan: Path) -> None:
    closed = lathe(np.array([18.0, 28.0, 1e-3]), np.array([0.0, 45.0, 45.0]), 90)
    paint(scan, closed, darker_upwards, every=9)


def test_formats_are_written_and_read_back_and_nothing_chosen_is_not(
    open_cup, picture, tmp_path: Path
):
    page = open_cup(painted)
    seen = page.evaluate("turnscan.faces")
    assert page.evaluate("turnscan.shades") == 0
    colours = page.get_by_role("combobox", name="Colours of the surface")
    colours.select_option("colours of the texture images")
    until(page, "turnscan.shades > 40")
    picture(page, "colour")
    page.get_by_role("button", name="Export", exact=True).click()
    for name in ("DXF", "3MF", "GLB"):
        suffix = f".{name.lower()}"
        page.get_by_role("radio", name=name).check()
        page.get_by_role("button", name=f"Export {name}").click()
        link = page.get_by_role("link", name=re.compile(rf"cup-\d+\{suffix}"))
        link.wait_for(timeout=120_000)  # the first export compiles its kernels
        if name == "DXF":
            picture(page, "export")
        with page.expect_download() as download:
            link.click()
        target = tmp_path / f"part{suffix}"
        download.value.save_as(target)
        mesh = read_mesh(target.read_bytes(), suffix)
        assert len(mesh.faces) == seen, name
        if name != "DXF":
            assert mesh.colour is not None
            off = mesh.colour[:, 0] - darker_upwards(mesh.vertices)
            assert np.median(np.abs(off)) < 3.0, name
    page.get_by_role("button", name="Export GLB").click()
    files = page.get_by_role("list", name="Exported files, the newest first").get_by_role("link")
    files.nth(3).wait_for(timeout=60_000)
    words = [
        re.search(r"cup-\d+(\S*?\.[a-z0-9]{3})\s*(\d\d:\d\d:\d\d)", text)
        for text in files.all_inner_texts()
    ]
    assert [w[1] for w in words if w] == ["-2.glb", ".glb", ".3mf", ".dxf"]
    assert sorted((w[2] for w in words if w), reverse=True) == [w[2] for w in words if w]
    page.get_by_role("radio", name="OBJ").check()
    page.get_by_role("checkbox", name="Colours also as a texture").check()
    page.get_by_role("button", name="Export OBJ").click()
    with page.expect_download(timeout=60_000) as download:
        page.get_by_role("link", name=re.compile(r"cup-\d+\.zip")).click(timeout=60_000)
    with zipfile.ZipFile(download.value.path()) as archive:
        ends = [name.removeprefix(archive.namelist()[1][:-4]) for name in archive.namelist()]
    assert ends == ["-texture.png", ".mtl", ".obj"]
    page.get_by_role("radio", name="DXF").check()
    page.get_by_role("checkbox", name="3DFACE").uncheck()
    assert page.get_by_role("button", name="Export DXF").is_disabled()
    page.get_by_role("radio", name="STL").check()
    assert page.get_by_role("button", name="Export STL").is_enabled()
    page.get_by_role("button", name="Edit", exact=True).click()
    until(page, f"turnscan.faces === {seen}")

"""From the browser to CAD: what is downloaded is what was seen."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.app.e2e.conftest import until
from turnscan.formats import read_mesh


def test_dxf_is_written_and_read_back(open_cup, picture, tmp_path: Path):
    page = open_cup()
    seen = page.evaluate("turnscan.faces")
    page.get_by_role("button", name="Export", exact=True).click()
    page.get_by_role("radio", name="DXF").check()
    page.get_by_role("button", name="Export DXF").click()
    link = page.get_by_role("link", name=re.compile(r"cup-\d+\.dxf"))
    link.wait_for(timeout=120_000)  # the first export compiles its kernels
    picture(page, "export")
    with page.expect_download() as download:
        link.click()
    target = tmp_path / "part.dxf"
    download.value.save_as(target)
    mesh = read_mesh(target.read_bytes(), ".dxf")
    assert len(mesh.faces) == seen
    page.get_by_role("button", name="Repair", exact=True).click()
    until(page, f"turnscan.faces === {seen}")


@pytest.mark.parametrize("name", ["3MF", "GLB"])
def test_other_formats_are_written_and_read_back(open_cup, name: str, tmp_path: Path):
    page = open_cup()
    seen, suffix = page.evaluate("turnscan.faces"), f".{name.lower()}"
    page.get_by_role("button", name="Export", exact=True).click()
    page.get_by_role("radio", name=name).check()
    page.get_by_role("button", name=f"Export {name}").click()
    link = page.get_by_role("link", name=re.compile(rf"cup-\d+\{suffix}"))
    link.wait_for(timeout=120_000)
    with page.expect_download() as download:
        link.click()
    target = tmp_path / f"part{suffix}"
    download.value.save_as(target)
    assert len(read_mesh(target.read_bytes(), suffix).faces) == seen


def test_nothing_chosen_cannot_be_written(open_cup):
    page = open_cup()
    page.get_by_role("button", name="Export", exact=True).click()
    page.get_by_role("checkbox", name="3DFACE").uncheck()
    assert page.get_by_role("button", name="Export DXF").is_disabled()
    page.get_by_role("radio", name="STL").check()
    assert page.get_by_role("button", name="Export STL").is_enabled()

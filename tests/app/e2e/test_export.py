"""From the browser to CAD: what is downloaded is what was seen."""

from __future__ import annotations

import re
from pathlib import Path

from tests.app.e2e.conftest import until
from turnscan.formats import read_mesh


def test_formats_are_written_and_read_back_and_nothing_chosen_is_not(
    open_cup, picture, tmp_path: Path
):
    page = open_cup()
    seen = page.evaluate("turnscan.faces")
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
        assert len(read_mesh(target.read_bytes(), suffix).faces) == seen, name
    page.get_by_role("radio", name="DXF").check()
    page.get_by_role("checkbox", name="3DFACE").uncheck()
    assert page.get_by_role("button", name="Export DXF").is_disabled()
    page.get_by_role("radio", name="STL").check()
    assert page.get_by_role("button", name="Export STL").is_enabled()
    page.get_by_role("button", name="Repair", exact=True).click()
    until(page, f"turnscan.faces === {seen}")

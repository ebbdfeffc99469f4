"""The start page, and the way from nothing to a DXF file: by visible labels, clicks counted."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from tests.app.e2e.conftest import OPENING, until
from turnscan.workflows import read_mesh_file

MOST_CLICKS = 12
LONG = OPENING * 1000
"""ms for what compiles kernels on a new machine."""


class Hand:
    """A person who clicks what can be seen, and counts."""

    def __init__(self, page: Page) -> None:
        self.page, self.clicks = page, 0

    def click(self, role: Any, name: str, exact: bool = True) -> None:
        self.page.get_by_role(role, name=name, exact=exact).click(timeout=LONG)
        self.clicks += 1


def test_from_nothing_to_a_dxf_file_and_what_is_done_with_scans(
    new_page, picture, folder: Path, tmp_path: Path
) -> None:
    page = new_page(width=1024, height=768)
    expect(page.get_by_text("There are no scans here yet.")).to_be_visible()
    picture(page, "start-empty")
    hand = Hand(page)
    hand.click("button", "Try the demo", exact=False)
    until(page, "turnscan.faces > 1000", OPENING)
    expect(page.get_by_role("banner").get_by_text("simulated", exact=True)).to_be_visible()
    picture(page, "start-demo")
    hand.click("button", "Export")
    hand.click("button", "Export DXF")
    with page.expect_download(timeout=LONG) as waiting:
        hand.click("link", "demo cup.dxf", exact=False)
    picture(page, "start-exported")
    assert hand.clicks <= MOST_CLICKS
    shutil.copy(waiting.value.path(), tmp_path / "cup.dxf")
    mesh = read_mesh_file(tmp_path / "cup.dxf")
    assert len(mesh.faces) == page.evaluate("turnscan.faces")

    # What is there can be renamed, copied, thrown away and taken back.
    page.get_by_role("button", name="turnscan").click()
    expect(page.get_by_role("listitem").filter(has_text="simulated")).to_have_count(1)
    page.get_by_role("button", name="Rename demo cup").click()
    page.get_by_role("textbox", name="New name of demo cup").fill("beaker")
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Duplicate beaker with its edits").click()
    page.get_by_role("button", name="beaker copy", exact=True).wait_for()
    page.get_by_role("button", name="Delete beaker copy: into the bin").click()
    expect(page.get_by_role("button", name="beaker copy", exact=True)).to_have_count(0)
    picture(page, "start")
    page.locator("summary", has_text="Bin").click()
    page.get_by_role("button", name="Restore", exact=True).click()
    page.get_by_role("button", name="beaker copy", exact=True).wait_for()
    assert sorted(p.name for p in folder.glob("*.turnscan")) == [
        "beaker copy.turnscan",
        "beaker.turnscan",
    ]
    # An image that could not be loaded has no size.
    until(page, "[...document.querySelectorAll('.look img')].every((i) => i.naturalWidth === 320)")

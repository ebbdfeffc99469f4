"""What tests of several rooms do with a page: connect a scanner, mark a point of a profile."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, steady, until


def mark(page: Any, step: int, line: int) -> dict[str, Any]:
    """Click a place in the scan grid; the surface turns to it."""
    settled(page)
    # The key under the grid takes room when it comes, and the grid moves.
    at = steady(page, f"turnscan.cell({step}, {line})")
    page.mouse.click(at["x"], at["y"])
    until(page, f"turnscan.mark?.step === {step}")
    found: dict[str, Any] = page.evaluate("turnscan.mark")
    assert abs(found["line"] - line) <= 1
    return found


def settled(page: Any) -> None:
    """Wait until the picture on the screen is the last one."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


WORKING = 300_000.0
"""ms that pictures of a board may take to be made and looked at, on a slow machine."""


def connect(
    page: Any, address: str = "sim:cup?steps=24&speckle=no", *, again: bool = False
) -> None:
    page.get_by_role("button", name="Setup", exact=True).click()
    if not again and page.get_by_role("button", name="Disconnect").is_enabled():
        disconnect(page)  # what a test that failed left connected shall fail no other test
    for field in ("Camera", "Turntable", "Lasers"):
        page.get_by_role("textbox", name=field).fill(address)
    page.get_by_role("button", name="Connect again" if again else "Connect", exact=True).click()
    page.get_by_role("button", name="Connect again").wait_for(timeout=WORKING)


def disconnect(page: Any) -> None:
    page.get_by_role("button", name="Disconnect").click()
    page.get_by_role("button", name="Connect", exact=True).wait_for(timeout=WORKING)


def click_at(page: Any, x: float, y: float, z: float) -> None:
    """Click on a place of the part, mm."""
    at = page.evaluate(f"turnscan.place([{x}, {y}, {z}])")
    page.mouse.click(at["x"], at["y"])


def rows(page: Any) -> Any:
    """The measurements of the Inspect room."""
    return page.get_by_role("list", name="Measurements").get_by_role("listitem")


def run_command(page: Any, words: str, title: str) -> None:
    """By the palette; what is done with files is in its list when the server has said it."""
    page.keyboard.press("Control+k")
    page.get_by_role("combobox", name="Search the commands").fill(words)
    chosen = page.get_by_role("listbox", name="Commands").get_by_role("option", selected=True)
    expect(chosen).to_contain_text(title, timeout=1000 * OPENING)
    page.keyboard.press("Enter")


def download_sizes(page: Any, name: str, path: Path) -> None:
    """The report of all sizes of a scan as PDF, in the Inspect room."""
    page.locator("summary", has_text=re.compile("^Report$")).click()
    report = page.locator("details[data-title=Report]")
    report.get_by_role("button", name="Report as PDF").click()
    with page.expect_download(timeout=1000 * OPENING) as waiting:
        report.get_by_role("link", name=f"{name} sizes.pdf").click(timeout=1000 * OPENING)
    shutil.copy(waiting.value.path(), path)
    assert path.read_bytes().startswith(b"%PDF")

"""From a zip of real pictures to sizes: calibrated, imported, reconstructed, reported as PDF."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import download_sizes, run_command
from tests.needs import needs_shared
from tests.web.uploads import zipped
from turnscan.workflows import measure

pytestmark = pytest.mark.slow
LONG = 1000 * OPENING


def _pictures(data: Path) -> dict[str, bytes]:
    """Some of the pictures, by their folders."""
    boards = sorted((data / "camera-boards").iterdir())[::5]
    lasers = sorted((data / "laser-boards").iterdir())[::6]
    table = [data / "empty-table" / f"step_num_table{n}.jpg" for n in range(1, 320, 40)]
    part = [data / "object" / f"step_num{n}.jpg" for n in range(1, 320, 10)]
    return {f"{p.parent.name}/{p.name}": p.read_bytes() for p in (*boards, *lasers, *table, *part)}


def test_a_zip_of_pictures_becomes_a_calibrated_measured_part(
    new_page, folder: Path, tmp_path: Path, picture
) -> None:
    data = needs_shared("turntable-mouse")
    page = new_page(height=1000)
    mouse = {"name": "mouse.zip", "mimeType": "application/zip", "buffer": zipped(_pictures(data))}
    page.get_by_label("Files", exact=True).set_input_files(mouse)
    dropped = page.get_by_role("region", name="What was dropped")
    expect(dropped.get_by_role("listitem")).to_have_count(4, timeout=LONG)

    boards = dropped.get_by_role("listitem").filter(has_text="camera-boards")
    boards.get_by_role("button", name="Calibrate from pictures").click()
    form = page.get_by_role("form", name="Calibrate from pictures")
    laser = form.get_by_role("group", name="Laser", exact=True)
    laser.get_by_role("checkbox", name=re.compile("laser-boards")).check()
    table = form.get_by_role("combobox", name="Table", exact=True)
    table.select_option(label="mouse/empty-table (8 pictures)")
    for label, text in (("Board", "chessboard:8x6:40"), ("Markers", "DICT_4X4_50:30"),
                        ("Name", "mouse rig")):  # fmt: skip
        form.get_by_label(label, exact=True).fill(text)
        form.get_by_label(label, exact=True).press("Tab")
    form.get_by_role("button", name="Calibrate from pictures").click()
    form.get_by_role("link", name="mouse rig.json").wait_for(timeout=LONG)
    expect(form.get_by_role("link", name="Open mouse rig-report.html")).to_be_visible()
    picture(page, "calibrate-pictures")

    page.get_by_role("button", name="All scans").click()
    part = dropped.get_by_role("listitem").filter(has_text="object")
    part.get_by_role("button", name="Import pictures").click()
    form = page.get_by_role("form", name="Import pictures")
    form.get_by_label("Angles").fill("markers")
    form.get_by_label("Angles").press("Tab")
    form.get_by_role("combobox", name="Rig").select_option(label="mouse rig.json (a rig)")
    form.get_by_label("Name", exact=True).fill("mouse")
    form.get_by_label("Name", exact=True).press("Tab")
    form.get_by_role("button", name="Import pictures").click()
    form.get_by_role("button", name="Open mouse.turnscan").click(timeout=LONG)
    until(page, "turnscan.faces > 1000", OPENING)

    page.get_by_role("button", name="Inspect", exact=True).click()
    # The box below the mouse: its width between two of its sides.
    run_command(page, "shapes …", "Shapes")
    page.get_by_role("button", name="Find shapes").click()
    sizes = page.get_by_role("table", name="All dimensions").get_by_role("row")
    width = sizes.filter(has_text=re.compile("^plane . to plane .distance"))
    width.first.wait_for(timeout=LONG)
    said = width.first.get_by_role("cell").all_inner_texts()
    assert 45.0 < float(said[2].split(" ±")[0]) < 60.0
    assert float(said[4]) < 1.5
    download_sizes(page, "mouse", tmp_path / "sizes.pdf")
    found = measure(folder / "mouse.turnscan", planes=True)
    sides = [s for s in found.figures["planes"] if abs(s["normal"][2]) < 0.2]
    assert len(sides) >= 3

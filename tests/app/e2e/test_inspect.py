"""A part against its CAD with tolerances, reports, and the same measurements on another scan."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import click_at, download_sizes, rows, run_command
from tests.poses.scenes import rig_for, write_scan
from tests.web.uploads import box
from turnscan.formats import export

LONG = OPENING * 1000
SIZE = np.array([40.0, 40.0, 56.0])
"""mm: the prism; its foot is hidden by the table."""


def _section_on_the_surface(page) -> None:
    """Its plane is moved by the handle and by the keyboard, and the outline follows."""
    page.get_by_role("button", name="Across z").click()
    outline = page.get_by_text(re.compile(r"^Outline of [\d.]+ mm$"))
    outline.wait_for()
    around = float(re.search(r"[\d.]+", outline.inner_text())[0])
    assert abs(around - 2 * (SIZE[0] + SIZE[1])) < 8.0
    distance = page.get_by_label("Distance from the origin")
    before = float(distance.input_value())
    slider = page.get_by_role("slider", name="Position in the part")
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    moved = float(distance.input_value())
    assert moved > before + 1.0
    # The disc is in the middle of the part, in the plane.
    at = page.evaluate(f"turnscan.place([0, 0, {moved}])")
    page.mouse.move(at["x"], at["y"])
    page.mouse.down()
    page.mouse.move(at["x"], at["y"] - 30, steps=4)
    page.mouse.up()
    until(
        page, f"Number(document.querySelector('#{distance.get_attribute('id')}').value) > {moved}"
    )
    distance.fill("20")
    distance.press("Enter")
    page.get_by_role("button", name="Draw only this").click()
    expect(page.get_by_label("Planes")).to_have_value("z=20")


def test_a_part_is_compared_with_cad_reported_and_measured_the_same_on_another_scan(
    new_page, folder: Path, tmp_path: Path, picture
) -> None:
    rig = rig_for("prism")
    spread = np.full(len(rig.parameter_names), 1e-5)
    known = replace(rig, covariance=np.diag(spread**2))
    for seed, name in enumerate(("block", "block 2")):
        write_scan(folder / f"{name}.turnscan", "prism", seed, known)
    drawn = box(1.0)
    drawn = replace(drawn, vertices=drawn.vertices * SIZE + (100.0, 50.0, 0.0))
    inches = replace(drawn, vertices=drawn.vertices / 25.4)
    (tmp_path / "drawn.stl").write_bytes(export(inches, ".stl"))
    page = new_page(height=1250)
    page.get_by_role("button", name="block", exact=True).click()
    until(page, "turnscan.faces > 0", OPENING)
    page.get_by_role("button", name="Inspect", exact=True).click()

    # Measured by hand: the budget has what the calibration leaves open.
    page.get_by_role("button", name="Distance").click()
    until(page, "turnscan.pictures > 0")
    for at in ((-10.0, -20.0, 20.0), (10.0, -20.0, 40.0)):
        click_at(page, *at)
    rows(page).first.wait_for(timeout=LONG)
    rows(page).first.get_by_role("button", name="±").click()
    page.get_by_label("Name", exact=True).fill("diagonal")
    page.get_by_label("Name", exact=True).press("Enter")
    rows(page).filter(has_text="diagonal").wait_for()
    budget = page.get_by_role("table", name="Uncertainty budget")
    expect(budget.get_by_role("row", name="Calibration")).to_contain_text(re.compile(r"0\.\d+ mm"))

    # What it is made of, on the surface and in a list, and a section of it as a drawing.
    run_command(page, "shapes", "Shapes")
    page.get_by_role("button", name="Find shapes").click()
    found_shapes = page.get_by_role("list", name="Shapes of the part").get_by_role("listitem")
    found_shapes.first.wait_for(timeout=LONG)
    expect(found_shapes).to_have_count(5)
    expect(found_shapes.first).to_contain_text("plane")
    picture(page, "shapes")
    page.get_by_text("Sections", exact=True).click()
    _section_on_the_surface(page)
    picture(page, "section")
    page.get_by_role("button", name="Section as SVG").click()
    page.get_by_role("link", name="block section.svg").wait_for(timeout=LONG)
    assert "<svg" in (folder / "block section.svg").read_text()

    # Compared with the part as it is drawn, which lies elsewhere.
    page.get_by_text("Deviation from a reference").click()
    page.get_by_label("From this computer").set_input_files(tmp_path / "drawn.stl")
    page.get_by_label("Features and their sizes").check()
    page.get_by_label("Of every size").fill("±0.3")
    page.get_by_label("Of profiles").fill("0.8")
    page.get_by_role("button", name="Compare", exact=True).click()
    asked = page.get_by_role("alert").filter(has_text="In which unit is it drawn?")
    asked.wait_for(timeout=LONG)
    picture(page, "compare-unit")
    asked.get_by_role("button", name="Drawn in inch").click()
    page.get_by_text("aligned by shape: turned").wait_for(timeout=LONG)
    page.get_by_text(re.compile(r"it fits in \d+ other ways? as well")).wait_for()
    sizes = page.get_by_role("list", name="Sizes of the reference").get_by_role("listitem")
    across = sizes.filter(has_text="nominal 40,").first
    found = re.search(r"([\d.]+) ± ([\d.]+) mm", across.inner_text())
    assert found
    assert abs(float(found[1]) - 40.0) < 2 * float(found[2]) < 0.3
    expect(across).to_contain_text("passes")
    features = page.get_by_role("list", name="Features of the reference").get_by_role("listitem")
    expect(features).to_have_count(5)
    page.get_by_text("aligned by shape: turned").evaluate("e => e.scrollIntoView()")
    assert page.evaluate("scrollTo(0, 999), scrollY") == 0, "STOP stays on the page"
    picture(page, "compare-cad")
    page.get_by_role("button", name="Report as HTML").first.click()
    page.get_by_role("link", name="block comparison-report.html").wait_for(timeout=LONG)
    assert "aligned by shape" in (folder / "block comparison-report.html").read_text()

    download_sizes(page, "block", tmp_path / "sizes.pdf")

    # Another scan of the part is measured the same.
    page.get_by_role("button", name="Measure the same on another scan …").click()
    page.get_by_label("Scan of the same part").select_option(label="block 2")
    page.get_by_role("button", name="Measure there").click()
    until(page, "turnscan.faces > 0", OPENING)
    there = rows(page).filter(has_text="diagonal")
    there.wait_for(timeout=LONG)
    value = re.search(r"([\d.]+) ± ([\d.]+) mm", there.inner_text())
    assert value
    assert abs(float(value[1]) - 20 * np.sqrt(2)) < 1.0

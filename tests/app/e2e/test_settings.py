"""Settings in the Edit room: tried before they are applied, kept by name, and side by side."""

from __future__ import annotations

import re

from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import mark, settled

WAIT = 1000 * OPENING
"""ms: on a new machine kernels are compiled first."""


def section(page, title):
    return page.locator(f"details[data-title='{title}']")


def unfold(page, title):
    """A section of the panel, unfolded."""
    found = section(page, title)
    if found.get_attribute("open") is None:
        found.locator("summary").click()
    return found


def test_settings_are_tried_kept_by_name_undone_and_compared(open_cup, picture):
    page = open_cup()
    mark(page, 20, 110)
    page.get_by_role("tab", name="Settings").click()
    before = page.evaluate("turnscan.digest")
    every = page.get_by_role("spinbutton", name="Every", exact=True)
    every.fill("2")
    every.press("Enter")
    patch = page.get_by_role("region", name="Patch, as typed")
    expect(patch.get_by_text(re.compile(r"[1-9][\d ]* triangles"))).to_be_visible(timeout=WAIT)
    profiles = page.get_by_role("region", name="Profiles with both settings")
    expect(profiles.get_by_text(re.compile(r"\d+ → \d+ points"))).to_be_visible()
    assert page.evaluate("turnscan.digest") == before, "a trial changes nothing"
    picture(page, "settings")
    sets = unfold(page, "Set of settings")
    sets.get_by_role("textbox", name="Name").fill("coarse")
    sets.get_by_role("textbox", name="Name").press("Enter")
    sets.get_by_role("button", name="Save", exact=True).click()
    until(page, "turnscan.edits === 1")
    page.get_by_role("button", name="Discard").click()
    expect(patch).to_have_count(0)
    sets.get_by_role("combobox", name="Set").select_option("coarse")
    expect(every).to_have_value("2")
    compare = unfold(page, "Compare two settings")
    compare.get_by_role("combobox", name="Second").select_option("coarse")
    compare.get_by_role("button", name="Compare", exact=True).click()
    figures = compare.get_by_role("definition")
    expect(figures.filter(has_text="cm² → ")).to_be_visible(timeout=WAIT)
    expect(page.get_by_role("region", name="Settings coarse")).to_be_visible()
    picture(page, "settings-compared")
    compare.get_by_role("button", name="End the comparison").click()
    page.get_by_role("button", name="Apply").click()
    until(page, f"turnscan.edits === 2 && turnscan.digest !== '{before}'", OPENING)
    page.keyboard.press("Control+z")
    until(page, f"turnscan.digest === '{before}'", OPENING)
    page.keyboard.press("Control+z")
    expect(sets.get_by_role("option", name="coarse")).to_have_count(0)


def test_the_working_volume_is_dragged_and_typed(open_cup):
    page = open_cup()
    page.get_by_role("tab", name="Settings").click()
    highest = page.get_by_role("spinbutton", name="Z max")
    settled(page)
    top = page.evaluate("turnscan.handle('top')")
    page.mouse.move(top["x"], top["y"])
    page.mouse.down()
    page.mouse.move(top["x"], top["y"] + 60, steps=4)
    page.mouse.up()
    expect(highest).not_to_have_value("")
    shown = float(highest.input_value())
    after = page.evaluate("turnscan.handle('top')")
    assert abs(after["y"] - top["y"] - 60) < 4, "the handle stays under the cursor"
    highest.fill(str(shown - 10))
    highest.press("Enter")
    until(page, f"turnscan.handle('top').y > {after['y'] + 5}")
    lowest = page.get_by_role("spinbutton", name="Z min")
    lowest.fill(str(shown + 30))
    lowest.press("Enter")
    alert = page.get_by_role("region", name="Profiles with both settings").get_by_role("alert")
    expect(alert).to_contain_text("no height between", timeout=WAIT)
    page.get_by_role("button", name="Discard").click()
    expect(highest).to_have_value("")


def test_settings_that_make_no_surface_say_why_at_their_field(open_cup):
    page = open_cup()
    mark(page, 20, 110)
    page.get_by_role("tab", name="Settings").click()
    every = page.get_by_role("spinbutton", name="Every", exact=True)
    every.fill("1000")
    every.press("Enter")
    points = section(page, "Points")
    expect(points.get_by_role("alert")).to_have_text(
        "1 profile is left, and a surface needs two beside each other: in use is “every 1”",
        timeout=WAIT,
    )
    patch = page.get_by_role("region", name="Patch, as typed")
    expect(patch.get_by_text("a surface needs two")).to_be_visible()
    every.fill("1")
    every.press("Enter")
    expect(points.get_by_role("alert")).to_have_count(0)
    threshold = page.get_by_role("spinbutton", name="Threshold")
    threshold.fill("5000")
    threshold.press("Enter")
    stripes = section(page, "Stripes")
    expect(stripes.get_by_role("alert")).to_contain_text(
        "no stripe above the threshold", timeout=WAIT
    )
    expect(patch.get_by_text("no stripe above the threshold")).to_be_visible()

"""Repairing a scan as a person does: by clicks on what is seen."""

from __future__ import annotations

import re
import shutil
from typing import Any

import pytest

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.cup import (
    GHOST_LINES,
    GHOST_STEPS,
    HOLE_LINES,
    HOLE_STEPS,
    SPIKE_LINE,
    SPIKE_STEP,
)
from tests.app.e2e.pages import mark, settled


def state(page: Any) -> tuple[int, int, int]:
    """Living faces, edits in the list, edits in use."""
    now = page.evaluate("[turnscan.faces, turnscan.edits, turnscan.cursor]")
    return (now[0], now[1], now[2])


def lasso(page: Any, centre: list[float], radius: float) -> None:
    """Draw round a point of the part, back to where the line began."""
    at = page.evaluate(f"turnscan.place({centre})")
    corners = [(1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7), (-1, 0), (-0.7, -0.7), (0, -1), (0.7, -0.7)]
    page.mouse.move(at["x"] + radius, at["y"])
    page.mouse.down()
    for x, y in [*corners[1:], corners[0]]:
        page.mouse.move(at["x"] + radius * x, at["y"] + radius * y, steps=2)
    page.mouse.up()


def test_hole_is_filled_with_preview_undone_and_redone(open_cup, picture):
    page = open_cup()
    scanned = state(page)
    page.keyboard.press("h")
    until(page, "turnscan.holes >= 3")
    holes = page.evaluate("turnscan.holes")
    # The black patch is about 14 mm by 18 mm.
    listed = page.get_by_role("list", name="Holes, the largest first")
    row = listed.get_by_role("listitem").filter(has_text=re.compile(r"2[34]\.\d+ mm"))
    row.get_by_role("button").click()
    assert row.get_by_role("checkbox").is_checked()
    page.get_by_role("button", name="Preview", exact=True).click()
    page.get_by_role("button", name="Discard the preview").wait_for()
    assert state(page) == scanned, "a preview stores nothing"
    picture(page, "fill")
    page.get_by_role("button", name="Fill", exact=True).click()
    until(page, "turnscan.edits === 1")
    until(page, f"turnscan.holes === {holes - 1}")
    filled = state(page)
    assert filled[0] > scanned[0] + 50
    page.get_by_role("button", name=re.compile("fill a hole .* 1 of 1")).click()
    page.get_by_role("tab", name="History", selected=True).wait_for()
    page.keyboard.press("Control+z")
    until(page, "turnscan.cursor === 0")
    until(page, f"turnscan.faces === {scanned[0]}")
    page.keyboard.press("Control+Shift+Z")
    until(page, "turnscan.cursor === 1")
    until(page, f"turnscan.faces === {filled[0]}")


def test_lasso_takes_a_spike_and_nothing_behind_it(open_cup):
    page = open_cup()
    before = state(page)
    tip = mark(page, SPIKE_STEP, SPIKE_LINE)["point"]
    settled(page)
    page.keyboard.press("l")
    lasso(page, tip, 60)
    seen = page.evaluate("turnscan.selected")
    assert seen > 20
    assert page.evaluate("turnscan.selectedAway") == 0
    page.keyboard.press("n")
    lasso(page, tip, 60)
    through = page.evaluate("turnscan.selected")
    assert through > seen, "without the limit the far wall is selected too"
    assert page.evaluate("turnscan.selectedAway") > 0
    page.keyboard.press("n")
    lasso(page, tip, 60)
    assert page.evaluate("turnscan.selected") == seen
    page.keyboard.press("Delete")
    until(page, "turnscan.edits === 1")
    gone = before[0] - state(page)[0]
    assert seen <= gone < seen + 20, "a delete may take faces that would hang in a corner"
    assert page.evaluate("turnscan.selected") == 0
    page.keyboard.press("Control+z")
    until(page, f"turnscan.faces === {before[0]}")


def test_ghost_leads_to_its_picture_and_the_other_candidate_is_picked(open_cup, picture):
    page = open_cup()
    step, line = GHOST_STEPS[3], (GHOST_LINES.start + GHOST_LINES.stop) // 2
    ghost = mark(page, step, line)
    settled(page)
    # On the surface the same point, clicked, leads to the same row of the same picture.
    at = page.evaluate(f"turnscan.place({ghost['point']})")
    page.mouse.click(at["x"] + 2, at["y"] + 2)
    until(page, "turnscan.mark !== null")
    found = page.evaluate("turnscan.mark")
    assert (found["step"], found["line"]) == (step, line)
    page.keyboard.press("z")
    picture(page, "repair")
    radius = _radius(ghost["point"])
    assert radius > 33, "the ghost stands outside"
    faces = state(page)[0]
    others = page.get_by_role("list", name="Candidates in this line").get_by_role(
        "button", pressed=False
    )
    for edits, k in enumerate(GHOST_STEPS, start=1):
        mark(page, k, line)
        until(page, f"turnscan.profile?.step === {k}")
        others.first.click()
        until(page, f"turnscan.edits === {edits}")
    until(page, f"turnscan.faces !== {faces}")
    repaired = mark(page, step, line)["point"]
    cone = 18 + 10 * repaired[2] / 45
    assert _radius(repaired) == pytest.approx(cone, abs=0.4), "the cup is where it is"


def _radius(point: list[float]) -> float:
    return float((point[0] ** 2 + point[1] ** 2) ** 0.5)


def test_profile_can_be_left_out_and_points_set_and_deleted(open_cup):
    page = open_cup()
    scanned = state(page)[0]
    mark(page, 30, 110)
    page.get_by_role("button", name="Profile off").click()
    until(page, "turnscan.edits === 1")
    until(page, f"turnscan.faces !== {scanned}")
    page.get_by_text("This profile is disabled").wait_for()
    step = page.evaluate("turnscan.mark.step")
    page.keyboard.press("PageDown")
    until(page, f"turnscan.mark.step === {step + 1}")
    page.keyboard.press("PageUp")
    until(page, f"turnscan.mark.step === {step - 1}")
    page.keyboard.press("Control+z")
    until(page, f"turnscan.faces === {scanned} && turnscan.cell({step}, 110)")
    until(page, "turnscan.cursor === 0")  # else the wait for the next edit is over at once
    page.keyboard.press("PageDown")
    until(page, f"turnscan.mark.step === {step}")
    place = page.get_by_label("Place in the picture")
    place.wait_for()
    was = float(place.input_value())
    place.fill(f"{was + 1.5:.2f}")
    place.press("Enter")
    until(page, "turnscan.cursor === 1")
    page.get_by_text("a place set by hand").wait_for()
    page.get_by_role("button", name="Point", exact=True).click()
    until(page, "turnscan.cursor === 2")
    page.get_by_text("Missing because").wait_for()
    again = page.locator("details", has=page.get_by_text("Detect again", exact=True).first)
    again.locator("summary").click()
    again.get_by_label("Threshold").fill("140")
    again.get_by_label("Threshold").press("Enter")
    again.get_by_label("Strategy").select_option("centroid")
    again.get_by_role("button", name="Detect again").click()
    until(page, "turnscan.cursor === 3")
    page.get_by_text("Detected again: 1 of the profiles").wait_for()


def test_everything_is_as_before_after_a_reload_and_seen_by_a_second_viewer(open_cup):
    page = open_cup()
    viewer = open_cup()
    assert viewer.get_by_text("watching").is_visible()
    mark(page, HOLE_STEPS.stop + 2, HOLE_LINES.start)
    page.keyboard.press("b")
    at = page.evaluate("turnscan.place(turnscan.mark.point)")
    page.mouse.move(at["x"], at["y"])
    page.mouse.down()
    page.mouse.move(at["x"] + 40, at["y"], steps=4)
    page.mouse.up()
    assert page.evaluate("turnscan.selected") > 4
    page.keyboard.press("Delete")
    until(page, "turnscan.edits === 1")
    after = state(page)
    until(viewer, f"turnscan.faces === {after[0]} && turnscan.cursor === 1")
    viewer.keyboard.press("Control+z")
    viewer.get_by_role("log").get_by_text("operator").first.wait_for()
    assert state(page) == after, "who watches changes nothing"
    page.reload()
    until(page, "'turnscan' in window && turnscan.faces > 0")
    until(page, "turnscan.edits === 1")
    assert state(page) == after
    assert page.evaluate("turnscan.vertices") == viewer.evaluate("turnscan.vertices")


def test_cut_with_a_cap_leaves_less_and_closes_the_wound(open_cup):
    page = open_cup()
    faces, holes = state(page)[0], None
    page.keyboard.press("k")
    distance = page.get_by_label("Distance from the origin")
    distance.fill("10")
    distance.press("Enter")
    page.get_by_role("button", name="Cut", exact=True).click()
    until(page, "turnscan.edits === 1")
    until(page, f"turnscan.faces !== {faces}")
    page.keyboard.press("h")
    until(page, "turnscan.holes !== null")
    holes = page.get_by_role("list", name="Holes, the largest first").inner_text()
    assert "37.5" not in holes, "the open foot, 37.6 mm wide, is closed by the cap"
    page.keyboard.press("Control+z")
    until(page, f"turnscan.faces === {faces}")


def test_every_repair_is_an_edit_that_can_be_stepped_over(open_cup):
    page = open_cup(script="localStorage.setItem('turnscan.level', 'expert')")
    scanned = state(page)[0]

    def edited(n: int) -> None:
        until(page, f"turnscan.edits === {n} && turnscan.cursor === {n}")

    def panel(title: str) -> Any:
        section = page.locator("details", has=page.get_by_text(title, exact=True))
        section.locator("summary").click()
        return section

    page.keyboard.press("Control+a")
    panel("Smooth").get_by_role("button", name="Selection").click()
    edited(1)
    assert state(page)[0] == scanned, "smoothing moves vertices, and takes none"
    page.keyboard.press("Escape")
    panel("Spikes").get_by_role("button", name="Remove").click()
    page.get_by_role("log").get_by_text("nothing matched").first.wait_for()
    edited(1)
    fewer = panel("Decimate")
    fewer.get_by_label("Tolerance").fill("")
    fewer.get_by_label("Tolerance").press("Enter")
    fewer.get_by_label("Down to").fill("6000")
    fewer.get_by_label("Down to").press("Enter")
    fewer.get_by_role("button", name="Decimate").click()
    edited(2)
    until(page, "turnscan.faces <= 6000")
    panel("Make watertight").get_by_role("button", name="Close", exact=True).click()
    edited(3)
    page.locator(".pane.surface").get_by_text("closed").wait_for()
    page.keyboard.press("y")
    page.get_by_role("checkbox", name=re.compile("fewer|decimate", re.IGNORECASE)).uncheck()
    until(page, "turnscan.faces > 8000")
    page.get_by_role("button", name="As scanned").click()
    until(page, f"turnscan.cursor === 0 && turnscan.faces === {scanned}")
    assert page.evaluate("turnscan.edits") == 3


def test_selecting_by_what_is_known_of_the_faces(open_cup):
    page = open_cup(script="localStorage.setItem('turnscan.level', 'expert')")
    section = page.locator("details", has=page.get_by_text("Select by …", exact=True))
    section.locator("summary").click()
    by = section.get_by_label("By", exact=True)
    select = section.get_by_role("button", name="Select")

    by.select_option(label="steps")
    section.get_by_label("From step").fill("20")
    section.get_by_label("From step").press("Enter")
    section.get_by_label("To step").fill("29")
    section.get_by_label("To step").press("Enter")
    select.click()
    until(page, "turnscan.selected > 0")
    steps = page.evaluate("turnscan.selected")
    assert steps / state(page)[0] == pytest.approx(10 / 72, rel=0.15)
    page.keyboard.press("+")
    grown = page.evaluate("turnscan.selected")
    page.keyboard.press("-")
    assert grown > page.evaluate("turnscan.selected") >= steps
    page.keyboard.press("Control+i")
    inverted = page.evaluate("turnscan.selected")
    assert 0 < inverted < state(page)[0] - steps + 1
    by.select_option(label="quality mark")
    section.get_by_label("Mark").select_option(label="several candidates")
    select.click()
    until(page, f"turnscan.selected !== {inverted} && turnscan.selected > 0")
    ghost = (len(GHOST_STEPS) - 1) * 2 * (GHOST_LINES.stop - GHOST_LINES.start - 1)
    assert 0.5 * ghost < page.evaluate("turnscan.selected") < 2 * ghost


def test_history_is_a_tree_with_names_and_pictures_and_edits_go_to_another_scan(
    open_cup, picture, folder, cup
):
    shutil.copy(cup, folder / "second cup.turnscan")
    page = open_cup()
    scanned = state(page)[0]
    tip = mark(page, SPIKE_STEP, SPIKE_LINE)["point"]
    settled(page)
    page.keyboard.press("l")
    lasso(page, tip, 60)
    page.keyboard.press("Delete")
    until(page, "turnscan.edits === 1")
    cleaned = state(page)[0]
    page.keyboard.press("y")
    tree = page.get_by_role("list", name="Edits, the first one first")
    tree.get_by_role("button", name=re.compile("^Name: delete")).click()
    tree.get_by_role("textbox", name="Name of this edit").fill("spike deleted")
    tree.get_by_role("textbox", name="Name of this edit").press("Enter")
    tree.get_by_role("button", name=re.compile("^spike deleted")).wait_for()
    tree.get_by_role("button", name="As scanned").click()
    until(page, f"turnscan.cursor === 0 && turnscan.faces === {scanned}")
    page.get_by_role("tab", name="Repair", exact=True).click()
    page.keyboard.press("Control+a")
    section = page.locator("details", has=page.get_by_text("Smooth", exact=True))
    section.locator("summary").click()
    section.get_by_role("button", name="Selection").click()
    until(page, "turnscan.edits === 1 && turnscan.cursor === 1")
    page.get_by_label("Colours of the surface").select_option(label="edits by hand")
    page.locator(".legend").get_by_text("smoothed").wait_for()
    page.keyboard.press("y")
    branch = tree.get_by_role("list", name="Branch spike deleted")
    # As scanned, smoothed, and the branch: each has its picture.
    until(page, "[...document.querySelectorAll('.tree img')].filter((i) => i.complete "
          "&& i.naturalWidth > 50).length === 3")  # fmt: skip
    page.keyboard.press("Escape")
    picture(page, "history")
    branch.get_by_role("button", name=re.compile("^spike deleted")).click()
    until(page, f"turnscan.faces === {cleaned}")
    tree.get_by_role("list", name="Branch of 1 other edits").wait_for()
    page.get_by_role("button", name="Copy edits to another scan …").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("To", exact=True).select_option(label="second cup")
    dialog.get_by_role("button", name="Copy 1 edit").click()
    dialog.get_by_text("all of them fit").wait_for(timeout=1000 * OPENING)
    dialog.get_by_role("button", name="Open that scan").click()
    until(page, f"turnscan.edits === 1 && turnscan.faces === {cleaned}", OPENING)

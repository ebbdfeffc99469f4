"""What holds in every room: reach by keyboard, roles, small windows, browsers that lack things."""

from __future__ import annotations

import io
import signal
import time

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from tests.app.e2e.conftest import DEADLINE, OPENING, steady, until
from tests.app.e2e.cup import write_whole_cup
from tests.app.e2e.pages import connect, disconnect, run_command, settled

NO_WEBGL = """
const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest);
};
"""


def test_without_webgl_the_rest_of_the_room_works(open_cup):
    page = open_cup(script=NO_WEBGL)
    page.get_by_role("alert").get_by_text("cannot draw in 3-D").wait_for()
    at = steady(page, "turnscan.cell(20, 110)")
    page.mouse.click(at["x"], at["y"])
    until(page, "turnscan.profile?.step === 20")
    page.get_by_role("button", name="Profile off").click()
    until(page, "turnscan.edits === 1")
    page.get_by_role("tab", name="Holes").click()
    until(page, "turnscan.holes > 0")


def test_everything_is_reached_by_keyboard(open_cup):
    page = open_cup()
    run_command(page, "select all", "Select all")
    until(page, "turnscan.selected === turnscan.faces")
    page.keyboard.press("Escape")
    assert page.evaluate("turnscan.selected") == 0
    page.keyboard.press("?")
    assert page.get_by_role("dialog").get_by_text("Ctrl+Shift+Z").is_visible()
    page.keyboard.press("Escape")
    assert page.get_by_role("dialog").count() == 0
    page.keyboard.press("5")
    until(page, "turnscan.camera.elevation > 1.5")
    names = []
    for _ in range(60):
        page.keyboard.press("Tab")
        names.append(
            page.evaluate(
                "document.activeElement.getAttribute('aria-label')"
                " ?? document.activeElement.textContent.trim()"
            )
        )
    assert {"STOP", "Lasso", "Colours of the surface", "Edit"} <= set(names)


def test_stop_is_above_any_dialog_and_a_frozen_server_is_told(new_page, server, picture):
    page = new_page("#rig")
    connect(page)
    page.get_by_text("server online").wait_for()
    page.keyboard.press("Control+k")
    page.get_by_role("dialog").wait_for()
    page.get_by_role("button", name="STOP", exact=True).click()
    page.get_by_text("Stopped: lasers dark").wait_for()
    assert page.get_by_role("dialog").is_visible()
    server.process.send_signal(signal.SIGSTOP)
    try:
        page.get_by_role("alert").get_by_text("laser state unknown").wait_for()
        page.get_by_text("no answer: laser state unknown").wait_for()
        page.keyboard.press("Control+.")
        picture(page, "frozen")
    finally:
        server.process.send_signal(signal.SIGCONT)
    page.get_by_text("server online").wait_for()
    page.keyboard.press("Escape")
    assert page.get_by_role("dialog").count() == 0
    disconnect(page)


def test_a_light_page_has_a_light_surface(open_cup):
    page = open_cup()
    place = page.locator(".surface-host").bounding_box()
    corner = {"x": place["x"] + 4, "y": place["y"] + 40, "width": 4, "height": 4}
    for dark in (True, False, True):
        end = time.monotonic() + DEADLINE
        while (_pixels(page.screenshot(clip=corner)).max() < 80) != dark:
            assert time.monotonic() < end, f"not {'dark' if dark else 'light'}"
        page.get_by_role("button", name="Dark or light").click()


@pytest.mark.parametrize("room", ["rig", "scan"])
def test_at_200_percent_rooms_are_one_column(new_page, room):
    page = new_page(f"#{room}", width=640, height=400)
    view = page.get_by_role("region", name="Camera")
    view.wait_for()
    assert view.bounding_box()["width"] == pytest.approx(640, abs=20)
    assert view.bounding_box()["height"] < 400
    assert page.evaluate("document.documentElement.scrollWidth") <= 640


def test_one_browser_invites_another(new_page, browser):
    page = new_page()
    page.get_by_role("button", name="Invite another browser").click()
    link = page.get_by_role("textbox", name="Link").input_value()
    context = browser.new_context()
    other = context.new_page()
    other.goto(link)
    other.wait_for_url(lambda url: "login" not in url)
    until(other, "'turnscan' in window && turnscan.connection === 'open'")
    other.get_by_text("watching").wait_for()
    context.close()


def test_a_page_that_is_left_is_the_operator_no_more(new_page):
    """Browsers keep a page that was left, and its socket, for whoever goes back."""
    left = new_page()
    left.get_by_text("operator").wait_for()
    other = new_page()
    other.get_by_text("watching").wait_for()
    other.get_by_role("button", name="Setup", exact=True).click()
    other.get_by_role("button", name="Take control here").click()
    other.get_by_text("operator", exact=False).first.wait_for()
    left.get_by_text("Another browser is the operator now.").wait_for()
    left.get_by_role("button", name="Setup", exact=True).click()
    left.get_by_role("button", name="Take control here").click()
    other.get_by_role("button", name="Take control here").wait_for()
    left.evaluate("dispatchEvent(new PageTransitionEvent('pagehide', { persisted: true }))")
    until(left, "turnscan.connection === 'lost'")
    until(left, "turnscan.connection === 'open'")  # as for who goes back


PRESSABLE = """
() => [...document.querySelectorAll("main button, main summary")]
  .filter((e) => e.checkVisibility())
  .map((e) => e.getAttribute("aria-label")
    ?? (e.localName === "summary" ? e.firstChild : e).textContent.replace(/\\s+/g, " ").trim())
  .filter((name) => name)
"""
"""The names of all that can be pressed in a room."""


def test_everything_that_can_be_pressed_is_in_the_list_of_commands(open_cup):
    page = open_cup()
    box = page.get_by_role("combobox", name="Search the commands")
    rooms = ("Setup", "Scan", "Inspect", "Export", "Edit")
    tabs = ("Point", "Holes", "History", "Settings", "Repair")
    lacking = []
    for room, tab in [*((room, "") for room in rooms), *(("Edit", tab) for tab in tabs)]:
        page.get_by_role("button", name=room, exact=True).click()
        if tab:
            page.get_by_role("tab", name=tab).click()
        settled(page)
        wanted = page.evaluate(PRESSABLE)
        page.keyboard.press("Control+k")
        listed = page.get_by_role("listbox", name="Commands").get_by_role("option")
        names = set(listed.locator("span").all_inner_texts())
        page.keyboard.press("Escape")
        box.wait_for(state="detached")
        lacking += [
            f"{room} {tab}: {name}"
            for name in wanted
            if not names & {name, f"{name} …", f"Export as {name.split(' ')[0]}"}
        ]
    assert lacking == []
    # From another room a command leads there, and does it.
    run_command(page, "compare two", "Compare two settings")
    page.get_by_role("tab", name="Settings", selected=True).wait_for()
    page.get_by_role("button", name="Export", exact=True).click()
    run_command(page, "search again", "Search again")
    page.get_by_role("region", name="Camera").wait_for()


UNDER = """
() => {
  const log = document.querySelector("[role=log]");
  if (!log.textContent) return ["no message is shown"];
  const controls = document.querySelectorAll("main button, main input, main select, main a");
  return [...controls].filter((e) => e.checkVisibility()).filter((e) => {
    e.scrollIntoView({ block: "nearest" });
    const box = e.getBoundingClientRect();
    const seen = document.elementFromPoint(box.x + box.width / 2, box.bottom - 2);
    return seen === null || log.contains(seen);
  }).map((e) => e.getAttribute("aria-label") || e.textContent);
}
"""
"""Controls that are outside the window or under the messages, however one scrolls."""


@pytest.mark.parametrize(("width", "height"), [(1280, 500), (950, 500), (640, 400)])
def test_a_message_covers_no_control(new_page, folder, picture, width, height):
    (folder / "broken.turnscan").write_bytes(b"not a scan at all")
    page = new_page(width=width, height=height)
    for place in ("", "rig", "scan", "do-import", "do-section", "do-compare"):
        page.evaluate("location.hash = ''")
        page.get_by_role("button", name="broken", exact=True).click()
        page.get_by_role("log").get_by_role("alert").first.wait_for()
        page.evaluate(f"location.hash = '{place}'")
        settled(page)
        page.get_by_role("main").get_by_role("button").first.wait_for()
        assert page.evaluate(UNDER) == [], place
        picture(page, f"message-{place or 'start'}-{width}")
        while page.get_by_role("button", name="Close this message").count():
            page.get_by_role("button", name="Close this message").first.click()


def test_no_file_and_an_old_link_are_told_in_words(new_page, server, folder):
    (folder / "broken.turnscan").write_bytes(b"not a scan at all")
    page = new_page()
    page.get_by_role("button", name="broken", exact=True).click()
    message = page.get_by_role("log").get_by_role("alert")
    message.wait_for()
    assert "scan file" in message.inner_text()
    page.get_by_role("heading", name="Scans").wait_for()
    page.goto(server.address + "#repair/nothing-of-the-kind")
    page.get_by_role("heading", name="Scans").wait_for()


def test_a_large_scan_is_looked_at_before_the_whole_of_it_is_there(new_page, folder, picture):
    write_whole_cup(folder / "large.turnscan", 340, 1)
    page = new_page()
    held = []
    page.route("**/mesh", lambda route: held.append(route))
    page.get_by_role("button", name="large", exact=True).click()
    said = page.get_by_role("status").get_by_text("Preview of one profile in 4, as scanned")
    said.wait_for(timeout=1000 * OPENING)
    until(page, "turnscan.drawnFaces > 0 && turnscan.drawnFaces === turnscan.firstFaces", OPENING)
    assert page.evaluate("turnscan.faces") == 0
    picture(page, "preview")
    end = time.monotonic() + OPENING
    while not held:  # the server is ready; the surface is on its way
        assert time.monotonic() < end
        page.wait_for_timeout(50)
    page.keyboard.press("Control+a")
    assert page.evaluate("turnscan.selected") == 0
    page.keyboard.press("5")
    until(page, "turnscan.camera.elevation > 1.5")
    held[0].continue_()
    until(page, "turnscan.faces > 50000 && turnscan.drawnFaces === turnscan.faces")
    assert page.evaluate("turnscan.camera.elevation") > 1.5, (
        "whoever has turned it looks the same way"
    )
    assert not said.is_visible()
    delete = page.get_by_role("button", name="Delete", exact=True)
    before = delete.bounding_box()
    page.keyboard.press("Control+a")
    until(page, "turnscan.selected === turnscan.faces")
    expect(page.get_by_test_id("selected")).not_to_have_text("0")
    assert delete.bounding_box() == before, "a number that grows moves no button"


def test_picture_comes_back_after_the_graphics_card_was_taken_away(open_cup):
    page = open_cup()
    page.keyboard.press("l")
    place = page.locator(".surface-host").bounding_box()
    clip = {k: place[k] for k in ("x", "y", "width", "height")}
    page.mouse.move(5, 5)
    page.keyboard.press("Control+a")
    until(page, "turnscan.selected > 0")
    page.wait_for_timeout(300)
    before = _pixels(page.screenshot(clip=clip))
    assert before.std() > 20, "there is a cup to be seen"
    page.evaluate(
        """() => {
        const gl = document.querySelector('.surface-canvas').getContext('webgl2');
        const card = gl.getExtension('WEBGL_lose_context');
        card.loseContext();
        setTimeout(() => card.restoreContext(), 200);
    }"""
    )
    page.get_by_text("The graphics card was unavailable").wait_for()
    until(page, "!document.querySelector('.surface-canvas').getContext('webgl2').isContextLost()")
    page.wait_for_timeout(600)
    after = _pixels(page.screenshot(clip=clip))
    assert np.abs(after - before).max() <= 3


def _pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float)

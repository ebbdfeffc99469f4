"""What holds in every room: reach by keyboard, roles, small windows, browsers that lack things."""

from __future__ import annotations

import io
import signal
import time

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
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


ROOMS = {
    "projects": "Scans", "rig": "Rig", "scan": "Scan", "repair": "Repair", "measure": "Inspect",
    "export": "Export", "do-compare": "Files", "do-join": "Files", "calibrate": "Calibrate",
}  # fmt: skip
"""What is in the address, and the name of the room's main region."""
CUT = """
() => [...document.querySelectorAll(
    "button, label, h1, h2, h3, summary, legend, dt, dd, th, .chip, .key span, .about," +
    " .with-unit span")]
  .filter((e) => e.checkVisibility() && !e.closest(".sr-only") && e.textContent.trim())
  .filter((e) => {
    const box = e.getBoundingClientRect();
    if (box.right > innerWidth + 1 || box.left < -1) return true;
    if (e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1) return true;
    for (let up = e.parentElement; up; up = up.parentElement) {
      if (getComputedStyle(up).overflowX === "visible") continue;
      const room = up.getBoundingClientRect();
      if (box.right > room.right + 1 || box.left < room.left - 1) return true;
    }
    return false;
  })
  .map((e) => `${e.localName} “${e.textContent.trim().slice(0, 40)}”`)
"""
CUT_IN_FIELDS = """
() => [...document.querySelectorAll("input[type=number], input[type=text], input[type=search]")]
  .filter((e) => e.checkVisibility() && !e.closest(".sr-only"))
  .filter((e) => {
    const style = getComputedStyle(e);
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    const wide = pen.measureText(e.value || e.placeholder).width;
    const [left, right] = [parseFloat(style.paddingLeft), parseFloat(style.paddingRight)];
    const unit = e.parentElement.querySelector(":scope > span")?.getBoundingClientRect();
    const end = e.getBoundingClientRect().right - right;
    return wide > e.clientWidth - left - right + 1 || (unit && unit.left < end - 1);
  })
  .map((e) => `field “${e.value || e.placeholder}” of ${e.labels[0]?.textContent}`)
"""


def cut(page) -> list[str]:
    """Labels, texts and fields of which a part is not seen."""
    return [*page.evaluate(CUT), *page.evaluate(CUT_IN_FIELDS)]


def serious(page) -> list[str]:
    found = Axe().run(page).response["violations"]
    return [
        f"{v['id']}: {v['nodes'][0]['html'][:160]}"
        for v in found
        if v["impact"] in ("serious", "critical")
    ]


def test_in_every_room_no_label_is_cut_and_nothing_is_wrong_for_screen_readers(open_cup, picture):
    """In both themes, at 1 024 px, and at 640 px, which is 1 280 px at 200 % zoom."""
    page = open_cup(width=1024)
    scan = page.evaluate("location.hash.split('/')[1]")
    wrong = []
    for room, name in ROOMS.items():
        page.evaluate(f"location.hash = '{room}/{scan}'")
        page.locator(f"main[aria-label='{name}']").wait_for(state="attached")
        if room == "repair":
            page.get_by_role("tab", name="History").click()
        if room == "measure":
            page.get_by_text("Sections", exact=True).click()
            page.get_by_role("button", name="Across z").click()
        for width, height in ((640, 400), (1024, 700)):
            page.set_viewport_size({"width": width, "height": height})
            settled(page)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, room
            wrong += [f"{room} at {width} px: {label}" for label in cut(page)]
        for theme in ("light", "dark"):
            page.get_by_role("button", name="Dark or light").click()
            settled(page)
            picture(page, f"{room}-{theme}")
            wrong += [f"{room}, {theme}: {one}" for one in serious(page)]
    page.evaluate(f"location.hash = 'repair/{scan}'")
    page.get_by_role("tab", name="Settings").click()
    page.locator("details[data-title='Compare two settings'] summary").click()
    every = page.get_by_role("spinbutton", name="Every", exact=True)
    every.fill("2")
    every.press("Enter")
    page.get_by_role("region", name="Patch, as typed").wait_for(timeout=1000 * OPENING)
    wrong += [f"settings: {one}" for one in serious(page)]
    for width, height in ((1024, 700), (1280, 800)):
        page.set_viewport_size({"width": width, "height": height})
        settled(page)
        wrong += [f"settings at {width} px: {label}" for label in cut(page)]
    page.keyboard.press("Escape")
    page.locator("body").click(position={"x": 2, "y": 2})
    for keys in ("?", "Control+k"):
        page.keyboard.press(keys)
        page.get_by_role("dialog").wait_for()
        for width, height in ((640, 400), (1024, 700)):
            page.set_viewport_size({"width": width, "height": height})
            settled(page)
            wrong += [f"{keys} at {width} px: {one}" for one in (*serious(page), *cut(page))]
        page.keyboard.press("Escape")
    assert wrong == []


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
    assert {"STOP", "Lasso", "Colours of the surface", "Repair"} <= set(names)


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

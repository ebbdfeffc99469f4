"""From devices to a part: connect, look, scan, mend."""

from __future__ import annotations

import re
from typing import Any

from tests.app.e2e.conftest import until


def connect(page: Any, address: str = "sim:cup?steps=24&speckle=no") -> None:
    page.get_by_role("button", name="Rig", exact=True).click()
    for field in ("Camera", "Turntable", "Lasers"):
        page.get_by_role("textbox", name=field).fill(address)
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_role("button", name="Connect again").wait_for()


def disconnect(page: Any) -> None:
    page.get_by_role("button", name="Disconnect").click()
    page.get_by_role("button", name="Connect", exact=True).wait_for()


def test_a_live_picture_shows_the_stripe_and_lasers_as_they_are(new_page, picture):
    page = new_page()
    connect(page)
    chip = page.locator(".chip", has_text="right")
    assert "dark" in chip.inner_text()
    page.get_by_role("checkbox", name="Laser right").check()
    page.get_by_role("button", name="Look", exact=True).click()
    page.get_by_text(re.compile(r"right lit · stripe in \d{2,3} lines")).wait_for()
    picture(page, "rig")
    page.get_by_role("button", name="End", exact=True).click()
    page.locator(".chip", has_text="right: dark").wait_for()
    disconnect(page)


def test_a_scan_grows_pauses_goes_on_and_is_mended(new_page, picture):
    page = new_page()
    connect(page)
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill("grown")
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text(re.compile(r"(9|1\d) of 24 steps")).wait_for()
    page.keyboard.press("Space")
    page.get_by_text("Paused: lasers dark").wait_for()
    picture(page, "scan")
    page.get_by_role("button", name="Go on").click()
    page.get_by_text("24 of 24 steps").wait_for()
    points = page.get_by_role("region", name="Points").locator(".about")
    assert int(points.inner_text().replace(" ", "").replace("\u2009", "")) > 3000
    page.get_by_role("button", name="Mend it").click()
    until(page, "turnscan.faces > 3000")
    page.get_by_role("button", name="Rig", exact=True).click()
    disconnect(page)


def test_an_address_that_is_none_is_refused_in_words(new_page):
    page = new_page()
    page.get_by_role("button", name="Rig", exact=True).click()
    page.get_by_role("textbox", name="Camera").fill("sim:nothing")
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_role("alert").filter(has_text="camera, turntable and lasers in one").wait_for()


def test_a_camera_that_goes_while_previewing_is_told_and_the_laser_is_dark(new_page):
    page = new_page()
    connect(page, "sim:cup?drop=1")
    page.get_by_role("checkbox", name="Laser right").check()
    page.get_by_role("button", name="Look", exact=True).click()
    gone = page.get_by_role("region", name="Camera").get_by_role("alert")
    gone.filter(has_text="picture").wait_for()
    page.locator(".chip", has_text="right: dark").wait_for()
    disconnect(page)


def test_calibration_shows_what_is_covered_and_why_a_picture_is_not_used(new_page, picture):
    page = new_page()
    connect(page, "sim:charuco?seed=3")
    page.locator("summary", has_text="Calibration").click()
    page.get_by_role("button", name="Begin", exact=True).click()
    calibration = page.locator("details", has=page.locator("summary", has_text="Calibration"))
    calibration.get_by_role("spinbutton", name="Exposure").fill("4000")
    page.get_by_role("button", name="Picture of the board").click()
    views = page.get_by_role("list", name="Pictures of the calibration").get_by_role("listitem")
    views.filter(has_text=re.compile(r"board \d+ corners")).wait_for()
    covered = page.get_by_role("img", name="of the picture has seen the board")
    assert int(covered.get_attribute("aria-label").split()[0]) > 5
    assert page.get_by_role("button", name="Calibrate", exact=True).is_disabled()
    picture(page, "calibrate")
    page.get_by_role("textbox", name="Board").fill("chessboard:9x7:10")
    page.get_by_role("button", name="Begin anew").click()
    page.get_by_role("button", name="Picture of the board").click()
    views.filter(has_text="no chessboard of 9x7 inner corners").wait_for()
    disconnect(page)

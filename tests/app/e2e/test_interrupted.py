"""Scans that are interrupted and taken to their end; one of a camera that lies on its side."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.app.e2e.conftest import OPENING, Server, until
from tests.app.e2e.pages import WORKING, connect, disconnect, mark
from turnscan.scan import Scan, rig_for

BENCH = "sim:cup?seed=7&speckle=no"
STEPS = 16
SOME = re.compile(rf"^([2-9]|1\d) of {STEPS} steps$")
PAUSE = "[...document.querySelectorAll('button')].find((b) => b.innerText === 'Pause')?.click()"
"""The button goes when the scan ends, so it is not waited for."""
ATTEMPTS = 5


def begin(page: Any, name: str) -> None:
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill(name)
    page.get_by_role("button", name="Start", exact=True).click()


def halt(page: Any, name: str) -> str:
    """Begin scans until one is paused amid its steps; its name.

    A machine that stalls may let a scan come to its end before it hears of the pause.
    """
    paused = page.get_by_text("Paused: lasers dark", exact=True)
    ended = page.get_by_text("Complete", exact=True)
    for k in range(ATTEMPTS):
        begin(page, f"{name}-{k}")
        ended.wait_for(state="detached", timeout=WORKING)  # of the scan before
        page.get_by_text(SOME).wait_for(timeout=WORKING)
        page.evaluate(PAUSE)
        paused.or_(ended).wait_for(timeout=WORKING)
        if paused.is_visible():
            return f"{name}-{k}"
    pytest.fail(f"{ATTEMPTS} scans of {STEPS} steps ended before they were paused")


def resume(page: Any, name: str) -> None:
    """Take what is missing, and see that the list of what is interrupted is empty after that."""
    interrupted = page.get_by_role("list", name="Interrupted scans")
    row = interrupted.get_by_role("listitem").filter(has_text=name)
    row.get_by_role("button", name="Resume").click()
    page.get_by_text("Complete", exact=True).wait_for(timeout=WORKING)
    interrupted.wait_for(state="detached", timeout=WORKING)
    page.get_by_role("button", name="Edit it").click()
    until(page, "turnscan.faces > 3000", OPENING)


def check_whole(path: Path) -> None:
    """Each step is there once, at its own angle."""
    with Scan.open(path) as scan:
        assert scan.complete
        angles = [scan.frame(k, "right").commanded for k in range(STEPS)]
    assert np.allclose(angles, 2 * np.pi * np.arange(STEPS) / STEPS)


def test_a_scan_that_was_aborted_is_taken_to_its_end(new_page, folder):
    page = new_page()
    connect(page, f"{BENCH}&steps={STEPS}")
    name = halt(page, "halved")
    page.get_by_role("button", name="Stop scan").click()
    page.get_by_text("Stopped by you").wait_for(timeout=WORKING)
    with Scan.open(folder / f"{name}.turnscan") as scan:
        assert 2 <= len(scan) < STEPS
    page.get_by_role("list", name="Interrupted scans").get_by_text("steps missing").wait_for()
    resume(page, name)
    check_whole(folder / f"{name}.turnscan")
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)


def test_a_scan_whose_server_was_killed_is_taken_to_its_end(new_page, server: Server, folder):
    page = new_page()
    connect(page, f"{BENCH}&steps={STEPS}")
    name = halt(page, "killed")
    page.context.close()  # its link breaks, which is no mistake of the page
    server.power_cut()
    page = new_page()
    listed = page.get_by_role("list", name="Scans").get_by_role("listitem").filter(has_text=name)
    listed.get_by_text(re.compile(r"\d+ steps missing")).wait_for()
    listed.get_by_role("button", name="Resume").click()
    page.get_by_role("button", name="Connect", exact=True).wait_for()  # first the devices
    connect(page, f"{BENCH}&steps={STEPS}")
    page.get_by_role("button", name="Scan", exact=True).click()
    resume(page, name)
    check_whole(folder / f"{name}.turnscan")
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)


def test_a_camera_on_its_side_scans_and_its_pictures_lead_to_the_surface(new_page, folder):
    page = new_page()
    connect(page, f"{BENCH}&steps=12&lying=yes&lasers=2")
    page.get_by_role("combobox", name="Stripe").select_option("lying")
    page.get_by_role("checkbox", name="Laser right").check()
    page.get_by_role("button", name="Start live view").click()
    # The cup is 240 columns high in a picture of 480: upright lines would find the platter's rim.
    seen = page.get_by_text(re.compile(r"480 × 640 · right lit · stripe in [23]\d\d lines"))
    seen.wait_for(timeout=WORKING)
    page.get_by_role("button", name="Stop live view").click()
    page.get_by_role("button", name="Scan", exact=True).click()
    page.locator("summary", has_text="More").click()
    page.get_by_role("spinbutton", name="Texture image").fill("20")
    # The panel is drawn anew while somebody types, as a message of the server would do.
    page.get_by_role("checkbox", name="right is a lamp").evaluate("box => box.click()")
    page.get_by_role("spinbutton", name="Texture image").press("Enter")
    page.get_by_role("spinbutton", name="Every N steps").wait_for()
    page.get_by_role("checkbox", name="left is a lamp").check()
    page.get_by_text("Choose a laser.").wait_for()
    assert page.get_by_role("button", name="Start", exact=True).is_disabled()
    page.get_by_role("checkbox", name="right is a lamp").uncheck()
    page.get_by_role("checkbox", name="Laser left").wait_for(state="detached")
    name = f"lying-{time.time_ns()}"  # its own, also when it is tried again
    begin(page, name)
    page.get_by_text("Complete", exact=True).wait_for(timeout=WORKING)
    with Scan.open(folder / f"{name}.turnscan") as scan:
        assert scan.plan.orientation == "horizontal"
        assert scan.plan.lasers == ("right",)
        dark = scan.frame(0, "right").dark
        assert dark is not None
        assert scan.texture(0).lit.max() > dark.max() + 30, "the lamp burns in the plain picture"
        camera, T = rig_for(scan).camera, rig_for(scan).T_camera_table
    page.get_by_role("button", name="Edit it").click()
    until(page, "turnscan.faces > 3000", OPENING)
    found = mark(page, 3, 240)
    turned = np.array(found["point"]) @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    u, _ = camera.project(T.apply(turned[None]))[0]
    assert u == pytest.approx(found["line"], abs=1), "a line is a column of the picture"
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)

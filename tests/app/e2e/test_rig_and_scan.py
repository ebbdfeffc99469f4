"""From devices to a part: connect, look, scan, repair."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Locator, Page

from tests.app.e2e.conftest import until
from tests.app.e2e.pages import WORKING, connect, disconnect
from turnscan.calibrate import measured_uncertainty
from turnscan.rig import Rig, rig_from_json
from turnscan.scan import Scan
from turnscan.simulate import Simulated, simulated


def test_a_live_picture_shows_the_stripe_and_lasers_as_they_are(new_page, picture):
    page = new_page()
    connect(page)
    chip = page.locator(".chip", has_text="right")
    assert "dark" in chip.inner_text()
    page.get_by_role("checkbox", name="Laser right").check()
    page.get_by_role("button", name="Start live view").click()
    seen = page.get_by_text(re.compile(r"right lit · stripe in \d{2,3} lines"))
    seen.wait_for(timeout=WORKING)  # on a new machine the kernels are compiled first
    picture(page, "rig")
    page.get_by_role("button", name="Stop live view").click()
    page.locator(".chip", has_text="right: dark").wait_for()
    disconnect(page)


def test_a_scan_grows_pauses_goes_on_and_is_repaired(new_page, picture):
    page = new_page()
    # So many steps that a page which stands still for a second on a busy machine misses none of
    # those in which it is to be paused.
    connect(page, "sim:cup?steps=72&speckle=no")
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill("grown")
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text(re.compile(r"(9|[1-5]\d) of 72 steps")).wait_for(timeout=WORKING)
    page.keyboard.press("Space")
    page.get_by_text("Paused: lasers dark").wait_for()
    picture(page, "scan")
    page.get_by_role("button", name="Resume").click()
    page.get_by_text("72 of 72 steps").wait_for(timeout=WORKING)
    points = page.get_by_role("region", name="Points").locator(".about")
    assert int(points.inner_text().replace(" ", "").replace("\u2009", "")) > 3000
    page.get_by_role("button", name="Edit it").click()
    until(page, "turnscan.faces > 3000")
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)


def test_an_address_that_is_none_is_refused_in_words(new_page):
    page = new_page()
    page.get_by_role("button", name="Setup", exact=True).click()
    page.get_by_role("textbox", name="Camera").fill("")
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_role("alert").get_by_text("An address is needed here, like uvc:0").wait_for()
    page.get_by_role("textbox", name="Camera").fill("sim:nothing")
    page.get_by_role("button", name="Connect", exact=True).click()
    page.get_by_role("alert").filter(has_text="camera, turntable and lasers in one").wait_for()


def test_a_camera_that_goes_while_previewing_is_told_and_the_laser_is_dark(new_page):
    page = new_page()
    connect(page, "sim:cup?drop=1")
    page.get_by_role("checkbox", name="Laser right").check()
    page.get_by_role("button", name="Start live view").click()
    gone = page.get_by_role("region", name="Camera").get_by_role("alert")
    gone.filter(has_text="picture").wait_for()
    page.locator(".chip", has_text="right: dark").wait_for()
    disconnect(page)


ARTEFACT = """\
format = "turnscan-artefact"
version = 1
kind = "sphere"
name = "ball of 40"
measured = "a simulated part is what it is said to be"
diameter_mm = 40.0
diameter_U_mm = 0.001
form_mm = 0.001
[limits_mm]
size = 1.0
"""


class Wizard:
    """A person who calibrates by what can be seen."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.panel = page.get_by_role("complementary", name="Calibration")

    def step(self, name: str) -> None:
        steps = self.page.get_by_role("navigation", name="Steps of the calibration")
        steps.get_by_role("button", name=name).click()

    def fill(self, **fields: object) -> None:
        for label, value in fields.items():
            field = self.panel.get_by_role("spinbutton", name=label.replace("_", " "), exact=True)
            field.fill(str(value))
            field.press("Enter")

    def views(self, text: str) -> Locator:
        listed = self.page.get_by_role("list", name="Pictures of the calibration")
        return listed.get_by_role("listitem").filter(has_text=text)

    def take(self, name: str, kind: str, count: int) -> None:
        """Take pictures to the end of their job."""
        self.panel.get_by_role("button", name=name).click()
        self.views(kind).nth(count - 1).wait_for(timeout=WORKING)
        self.panel.get_by_role("button", name="Cancel").wait_for(state="detached", timeout=WORKING)


def test_a_new_user_calibrates_with_what_is_there_scans_and_verifies(
    new_page, picture, folder, tmp_path
):
    """From an empty folder to a rig that is right within what it says of itself."""
    bench = "sim:sphere?seed=7&speckle=no"
    page = new_page(width=1024, height=768)
    connect(page, bench + "&hand=charuco")
    page.get_by_role("button", name="Calibrate …").click()
    hand = Wizard(page)
    with page.expect_download() as target:
        page.get_by_role("link", name="Target as PDF").click()
    assert Path(target.value.path()).read_bytes().startswith(b"%PDF")
    hand.fill(Ruler_across=100, Ruler_down=98)
    page.get_by_role("button", name="Begin with this board").click()
    page.get_by_role("alert").filter(has_text="100 mm one way and 98 mm the other").wait_for()
    # The simulated board stands 10 mm up, leans, and has squares of 12 mm.
    hand.fill(Ruler_down=100, Height_of_lowest_board_corner=22.2)
    picture(page, "calibrate-target")
    page.get_by_role("button", name="Begin with this board").click()
    page.get_by_role("button", name="Start live view").click()
    page.get_by_text(re.compile(r"^\d+ corners of the board")).wait_for(timeout=WORKING)
    picture(page, "calibrate-live")
    page.get_by_role("button", name="Stop live view").click()
    page.get_by_role("button", name="Start live view").wait_for(timeout=WORKING)
    hand.fill(Pictures=8, One_every=0)
    hand.take("Take pictures of the board", "board", 8)
    covered = page.get_by_text(re.compile(r"corners seen: \d+ % of the picture"))
    assert int(re.sub(r"\D", "", covered.inner_text())) > 30
    page.get_by_text("Would help most").wait_for()
    page.get_by_text("Undetermined: ").wait_for()
    hand.views("px rms").first.get_by_title("Show this picture").click()
    page.get_by_role("button", name="Back to the live picture").wait_for()
    picture(page, "calibrate")
    hand.step("Calibrate")
    assert page.get_by_role("button", name="Calibrate", exact=True).is_disabled()
    hand.step("Lasers")
    hand.fill(Pictures=10)  # each second time the hand holds the board into the light
    hand.take("Take pictures with each laser", "laser right", 10)
    hand.views("no stripe of laser right on the board").first.wait_for()
    hand.step("Turntable")
    hand.fill(Stops=9)
    hand.take("Turn the table and take", "on the table", 9)
    page.get_by_text("Enough pictures of each kind are there.").wait_for()
    before = re.compile(r"From the side: boards from \d+ to \d+ mm before the camera")
    page.get_by_role("img", name=before).wait_for()
    page.get_by_text("axis of the table").wait_for()
    picture(page, "calibrate-space")
    page.get_by_text("(k = 2)").wait_for()
    hand.step("Calibrate")
    page.get_by_role("button", name="Calibrate", exact=True).click()
    verdict = page.get_by_role("status", name="Verdict")
    verdict.get_by_text(re.compile(r"Usable, with warnings|Good: ")).wait_for(timeout=WORKING)
    said = r"camera 0\.\d+ px rms, coverage \d+ %; at .* ± 0\.\d+ mm \(k = 2\)"
    assert re.search(said, verdict.inner_text())
    picture(page, "calibrate-verdict")
    with page.context.expect_page() as opened:
        verdict.get_by_role("link", name="Open the report").click()
    opened.value.get_by_text("Uncertainty of what is measured").wait_for()
    opened.value.close()
    check_rig(rig_from_json((folder / "rig.json").read_text(), "rig"), simulated(bench))
    page.get_by_role("button", name="Leave the wizard").click()
    connect(page, bench + "&steps=12", again=True)
    page.get_by_role("combobox", name="Rig in use").filter(has_text="rig.json").wait_for()
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill("calibrated")
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text("12 of 12 steps").wait_for(timeout=WORKING)
    page.get_by_text("Complete", exact=True).wait_for()
    with Scan.open(folder / "calibrated.turnscan") as scan:
        assert scan.rig is not None
        assert scan.rig.covariance is not None
    verifies(page, hand, picture, tmp_path / "ball.toml")
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)


def verifies(page: Page, hand: Wizard, picture: Callable[[Any, str], None], path: Path) -> None:
    """Compare the scan with the ball as it is: the rig's own uncertainty covers the difference."""
    path.write_text(ARTEFACT)
    page.get_by_role("button", name="Setup", exact=True).click()
    page.get_by_role("button", name="Calibrate …").click()
    hand.step("Verify")
    page.get_by_text("No verification yet.").wait_for()
    page.get_by_role("combobox", name="Scan").select_option("calibrated")
    page.get_by_label("Artefact’s file", exact=True).set_input_files(path)
    page.get_by_role("combobox", name="Artefact").filter(has_text="ball.toml").wait_for()
    page.get_by_role("button", name="Verify", exact=True).click()
    history = page.get_by_role("region", name="Verifications with ball of 40")
    size = history.get_by_role("img", name="size")
    size.wait_for(timeout=WORKING)
    found = re.search(r"1 runs, last (-?\d+) µm, noise ± \d+ µm", size.get_attribute("aria-label"))
    assert found
    assert abs(int(found[1])) < 1000
    picture(page, "calibrate-verify")


def check_rig(found: Rig, bench: Simulated) -> None:
    """Places on the sheet come out where they are, within five of the uncertainties told.

    How the hand holds the board follows from how many live pictures there were, anew in each run:
    with three, one run in fifty would fail. ``bench calibration`` holds the uncertainties to more.
    """
    true = bench.world.bench.rig
    sheet, T = true.sheet("right"), true.T_camera_table
    normal, centre = T.inverse().turn(sheet.normal), T.inverse().apply(sheet.centre)
    towards = np.cross(normal, (0.0, 0.0, 1.0))
    towards *= np.sign(towards[0]) / np.linalg.norm(towards)
    for radius in (15.0, 40.0):
        for height in (10.0, 60.0):
            at = centre + radius * towards
            at[2] = height
            assert abs(normal @ (at - centre)) < 1e-9
            pixel = true.camera.project(T.apply(at))[None]
            seen = found.sheet("right").intersect(found.camera.rays(pixel))
            x, y, z = found.T_camera_table.inverse().apply(seen)[0]
            sigma_radius, sigma_height = measured_uncertainty(found, "right", radius, height)
            assert sigma_radius < 0.3
            assert sigma_height < 0.1
            assert abs(np.hypot(x, y) - np.hypot(at[0], at[1])) < 5 * sigma_radius
            assert abs(z - height) < 5 * sigma_height


def test_calibration_says_why_a_picture_is_not_used_and_ends_when_cancelled(new_page):
    page = new_page()
    connect(page, "sim:cylinder?hand=charuco")
    page.get_by_role("button", name="Calibrate …").click()
    hand = Wizard(page)
    page.get_by_role("textbox", name="Board").fill("chessboard:9x7:10")
    page.get_by_role("button", name=re.compile("(Begin|Start again) with this board")).click()
    hand.fill(One_every=1)
    hand.panel.get_by_role("button", name="Take pictures of the board").click()
    hand.views("no chessboard of 9x7 inner corners").first.wait_for(timeout=WORKING)
    hand.panel.get_by_role("button", name="Cancel").click()
    hand.panel.get_by_role("button", name="Cancel").wait_for(state="detached", timeout=WORKING)
    assert hand.views("board").count() < 8
    hand.page.get_by_role("button", name="Leave the wizard").click()
    disconnect(page)

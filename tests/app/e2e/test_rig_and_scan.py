"""From devices to a part: connect, look, scan, repair."""

from __future__ import annotations

import re

import numpy as np

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
    page.get_by_role("button", name="Look", exact=True).click()
    seen = page.get_by_text(re.compile(r"right lit · stripe in \d{2,3} lines"))
    seen.wait_for(timeout=WORKING)  # on a new machine the kernels are compiled first
    picture(page, "rig")
    page.get_by_role("button", name="End", exact=True).click()
    page.locator(".chip", has_text="right: dark").wait_for()
    disconnect(page)


def test_a_scan_grows_pauses_goes_on_and_is_repaired(new_page, picture):
    page = new_page()
    connect(page)
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill("grown")
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text(re.compile(r"(9|1\d) of 24 steps")).wait_for()
    page.keyboard.press("Space")
    page.get_by_text("Paused: lasers dark").wait_for()
    picture(page, "scan")
    page.get_by_role("button", name="Resume").click()
    page.get_by_text("24 of 24 steps").wait_for()
    points = page.get_by_role("region", name="Points").locator(".about")
    assert int(points.inner_text().replace(" ", "").replace("\u2009", "")) > 3000
    page.get_by_role("button", name="Repair it").click()
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


def test_a_new_user_calibrates_with_what_is_there_and_scans_with_it(new_page, picture, folder):
    """From an empty folder to a rig that is right within what it says of itself."""
    bench = "sim:cylinder?seed=7&speckle=no"
    page = new_page()
    connect(page, bench + "&hand=charuco")
    calibration = page.locator("details", has=page.locator("summary", has_text="Calibration"))
    page.locator("summary", has_text="Calibration").click()

    def fill(**fields: object) -> None:
        for label, value in fields.items():
            field = calibration.get_by_role("spinbutton", name=label.replace("_", " "), exact=True)
            field.fill(str(value))
            field.press("Enter")

    def take(name: str, said: str) -> None:
        calibration.get_by_role("button", name=name).click()
        calibration.get_by_role("status").filter(has_text=re.compile(said)).wait_for(
            timeout=WORKING
        )

    fill(Lowest_corner=22.2)  # the simulated board stands 10 mm up, leans, and has squares of 12 mm
    calibration.get_by_role("button", name="Begin", exact=True).click()
    fill(Pictures=8, One_every=0)
    take("Take pictures of the board", r"^8 of 8 pictures can be used")
    covered = page.get_by_role("img", name="of the picture has seen the board")
    assert int(covered.get_attribute("aria-label").split()[0]) > 30
    assert page.get_by_role("button", name="Calibrate", exact=True).is_disabled()
    fill(Pictures=10)  # each second time the hand holds the board into the light
    take("Take pictures with each laser", r"^([5-9]|10) of 10 pictures can be used")
    views = page.get_by_role("list", name="Pictures of the calibration").get_by_role("listitem")
    views.filter(has_text="no stripe of laser right on the board").first.wait_for()
    fill(Stops=9)
    take("Turn the table and take", r"^9 of 9 pictures can be used")
    calibration.get_by_role("button", name="Take pictures of the board").evaluate(
        "e => e.scrollIntoView({block: 'start'})"
    )
    picture(page, "calibrate")
    take(
        "Calibrate", r"rig\.json: camera 0\.\d+ px rms, coverage \d+ %; at .* ± 0\.\d+ mm \(k = 2\)"
    )
    check_rig(rig_from_json((folder / "rig.json").read_text(), "rig"), simulated(bench))
    connect(page, bench + "&steps=8", again=True)
    page.get_by_role("combobox", name="In use").filter(has_text="rig.json").wait_for()
    page.get_by_role("button", name="Scan", exact=True).click()
    page.get_by_role("textbox", name="Name").fill("calibrated")
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text("8 of 8 steps").wait_for(timeout=WORKING)
    page.get_by_text("Complete", exact=True).wait_for()
    with Scan.open(folder / "calibrated.turnscan") as scan:
        assert scan.rig is not None
        assert scan.rig.covariance is not None
    page.get_by_role("button", name="Rig", exact=True).click()
    disconnect(page)


def check_rig(found: Rig, bench: Simulated) -> None:
    """Places on the sheet come out where they are, within three of the uncertainties told."""
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
            assert abs(np.hypot(x, y) - np.hypot(at[0], at[1])) < 3 * sigma_radius
            assert abs(z - height) < 3 * sigma_height


def test_calibration_says_why_a_picture_is_not_used_and_ends_when_cancelled(new_page):
    page = new_page()
    connect(page, "sim:cylinder?hand=charuco")
    page.locator("summary", has_text="Calibration").click()
    page.get_by_role("textbox", name="Board").fill("chessboard:9x7:10")
    page.get_by_role("button", name=re.compile("^Begin")).click()
    page.get_by_role("spinbutton", name="One every").fill("1")
    page.get_by_role("spinbutton", name="One every").press("Enter")
    page.get_by_role("button", name="Take pictures of the board").click()
    views = page.get_by_role("list", name="Pictures of the calibration").get_by_role("listitem")
    why = views.filter(has_text="no chessboard of 9x7 inner corners").first
    why.wait_for(timeout=WORKING)
    calibration = page.locator("details", has=page.locator("summary", has_text="Calibration"))
    calibration.get_by_role("button", name="Cancel").click()
    calibration.get_by_role("button", name="Cancel").wait_for(state="detached", timeout=WORKING)
    assert views.count() < 8
    disconnect(page)

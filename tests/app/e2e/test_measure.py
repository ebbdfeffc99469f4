"""Measuring by clicks: within its uncertainty, and kept with the scan."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import click_at, rows
from tests.shapes.tubes import cylinder
from turnscan.formats import write_ply
from turnscan.mesh import Mesh


def towards_the_eye(page: Any, height: float) -> tuple[float, float, float]:
    """A point of the cup's wall at this height that the camera sees, beside the hole."""
    side = page.evaluate("turnscan.camera.azimuth") - 0.5
    radius = 18.0 + 10.0 * height / 45.0
    return (radius * math.cos(side), radius * math.sin(side), height)


def test_a_diameter_is_right_has_limits_and_is_kept(open_cup, tmp_path, picture):
    page = open_cup(height=1100)
    page.get_by_role("button", name="Inspect", exact=True).click()
    page.get_by_role("button", name="Diameter").click()
    until(page, "turnscan.pictures > 0")
    click_at(page, *towards_the_eye(page, 30.0))
    page.get_by_text("1 of 1 points").wait_for()
    page.get_by_role("button", name="Measure it").click()
    rows(page).first.wait_for(timeout=1000 * OPENING)
    row = rows(page).first.get_by_role("button", name="±")
    found = re.search(r"([\d.]+) ± ([\d.]+) mm", row.inner_text())
    assert found
    text = row.get_attribute("title")
    height = re.search(r"z = ([\d.]+) mm", text)
    assert height, text
    value, uncertainty = float(found[1]), float(found[2])
    truth = 2 * (18.0 + 10.0 * float(height[1]) / 45.0)
    assert 0.001 < uncertainty < 0.3
    assert abs(value - truth) < uncertainty
    row.click()
    for label, text, shown in (
        ("Name", "wall", "wall"),
        ("Nominal", "49.3", "· 49.3 mm"),
        ("Upper limit", "0.4", "± 0.4"),
    ):
        page.get_by_label(label, exact=True).fill(text)
        page.get_by_label(label, exact=True).press("Enter")
        rows(page).filter(has_text=shown).wait_for()
    rows(page).filter(has_text="passes").wait_for()
    budget = page.get_by_role("table", name="Uncertainty budget")
    expect(budget.get_by_role("row", name="Noise of the points")).to_contain_text("mm")
    # The rig of this scan says nothing of how well it is calibrated: that is not counted as nought.
    expect(budget.get_by_role("row", name="Calibration")).to_contain_text("not known")
    page.get_by_text("U is that of the noise alone").wait_for()
    deviates(page, tmp_path / "drawn.ply")
    picture(page, "inspect")
    page.reload()
    until(page, "'turnscan' in window && turnscan.faces > 0")
    rows(page).filter(has_text=found[1]).filter(has_text="wall").wait_for()


def deviates(page: Any, path: Path) -> None:
    """Compare with the cup as it is drawn: a probe of its wall reads noise and the tessellation."""
    drawn = cylinder(1.0, 45.0, n=128)
    wide = 18.0 + 10.0 * drawn.vertices[:, 2:] / 45.0
    vertices = np.hstack([drawn.vertices[:, :2] * wide, drawn.vertices[:, 2:]])
    path.write_bytes(write_ply(Mesh(vertices, drawn.faces)))
    page.get_by_text("Deviation from a reference").click()
    page.get_by_label("From this computer").set_input_files(path)
    page.get_by_label("Align").select_option(label="not at all")
    page.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_text("Root mean square").wait_for(timeout=1000 * OPENING)
    page.get_by_label("Map to ±").fill("0.1")
    page.get_by_label("Map to ±").press("Enter")
    page.locator(".legend").filter(has_text="0.1 mm").wait_for()
    click_at(page, *towards_the_eye(page, 20.0))
    probes = page.get_by_role("list", name="Probes").get_by_role("listitem")
    probes.first.wait_for()
    read = re.match(r"([+−]?)(\d\.\d{3}) mm", probes.first.inner_text())
    assert read
    assert float(read[2]) < 0.1


def test_a_distance_is_taken_with_the_second_click_and_forgotten(open_cup):
    page = open_cup()
    page.get_by_role("button", name="Inspect", exact=True).click()
    page.get_by_role("button", name="Distance").click()
    until(page, "turnscan.pictures > 0")
    low, high = towards_the_eye(page, 12.0), towards_the_eye(page, 32.0)
    click_at(page, *low)
    page.get_by_text("1 of 2 points").wait_for()
    click_at(page, *high)
    rows(page).first.wait_for()
    found = re.search(r"([\d.]+) (?:± [\d.]+ )?mm", rows(page).first.inner_text())
    assert found
    # A click hits a pixel, of about a quarter of a millimetre.
    assert abs(float(found[1]) - math.dist(low, high)) < 1.0
    page.get_by_role("button", name="Delete it").click()
    page.get_by_text("None yet.").wait_for()


def test_a_distance_is_measured_by_keyboard_alone(open_cup):
    page = open_cup()
    page.keyboard.press("Alt+4")
    page.get_by_role("button", name="Distance").wait_for()
    points = []
    for k in range(2):
        page.keyboard.press("PageDown")
        until(page, f"turnscan.mark?.step === {k} && turnscan.mark.point")
        points.append(page.evaluate("turnscan.mark"))
        page.keyboard.press("m")
        if not k:
            page.get_by_text("1 of 2 points").wait_for()
    rows(page).first.wait_for()
    found = re.search(r"([\d.]+) (?:± [\d.]+ )?mm", rows(page).first.inner_text())
    assert found
    assert float(found[1]) == pytest.approx(math.dist(points[0]["point"], points[1]["point"]), 1e-3)

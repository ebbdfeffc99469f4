"""Measuring by clicks: within its uncertainty, and kept with the scan."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from tests.app.e2e.conftest import OPENING, until


def click_at(page: Any, x: float, y: float, z: float) -> None:
    at = page.evaluate(f"turnscan.place([{x}, {y}, {z}])")
    page.mouse.click(at["x"], at["y"])


def towards_the_eye(page: Any, height: float) -> tuple[float, float, float]:
    """A point of the cup's wall at this height that the camera sees, beside the hole."""
    side = page.evaluate("turnscan.camera.azimuth") - 0.5
    radius = 18.0 + 10.0 * height / 45.0
    return (radius * math.cos(side), radius * math.sin(side), height)


def rows(page: Any) -> Any:
    return page.get_by_role("list", name="Measurements").get_by_role("listitem")


def test_a_diameter_is_right_has_limits_and_is_kept(open_cup, cup, picture):
    page = open_cup()
    page.get_by_role("button", name="Inspect", exact=True).click()
    page.get_by_role("button", name="Diameter").click()
    until(page, "turnscan.pictures > 0")
    click_at(page, *towards_the_eye(page, 30.0))
    page.get_by_text("1 of 1 points").wait_for()
    page.get_by_role("button", name="Measure it").click()
    rows(page).first.wait_for()
    picture(page, "measure")
    text = rows(page).first.inner_text()
    found = re.search(r"([\d.]+) ± ([\d.]+) mm", text)
    height = re.search(r"z = ([\d.]+) mm", text)
    assert found, text
    assert height, text
    value, uncertainty = float(found[1]), float(found[2])
    truth = 2 * (18.0 + 10.0 * float(height[1]) / 45.0)
    assert 0.001 < uncertainty < 0.3
    assert abs(value - truth) < uncertainty
    rows(page).first.get_by_role("button", name=found[0]).click()
    for label, text in (("Name", "bore"), ("Nominal", f"{value:.3f}"), ("Upper limit", "0.4")):
        page.get_by_label(label, exact=True).fill(text)
        page.get_by_label(label, exact=True).press("Enter")
        until(page, "turnscan.requests === 0")
    rows(page).filter(has_text="passes").filter(has_text="± 0.4").wait_for()
    page.get_by_role("table", name="Uncertainty budget").wait_for()
    deviates(page, cup)
    picture(page, "inspect")
    page.reload()
    until(page, "'turnscan' in window && turnscan.faces > 0")
    rows(page).filter(has_text=found[1]).filter(has_text="bore").wait_for()


def deviates(page: Any, cup: Path) -> None:
    """Compare with the same scan: nothing deviates, and a probe says so."""
    page.get_by_text("Deviation from a reference").click()
    page.get_by_label("From this computer").set_input_files(cup)
    page.get_by_role("button", name="Compare", exact=True).click()
    page.get_by_text("Root mean square").wait_for(timeout=1000 * OPENING)
    click_at(page, *towards_the_eye(page, 20.0))
    page.get_by_role("list", name="Probes").get_by_text("0.000 mm").wait_for()


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

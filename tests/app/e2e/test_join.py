"""Two poses of a part are joined in the browser by points picked in both."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, steady
from tests.poses.scenes import STANDS, write_scan
from turnscan.formats import read_about, read_mesh

LONG = OPENING * 1000
TURN = 0.2
"""Radians by which the knob's block is turned."""
PICKS = ((-11.0, -12.0), (11.0, -8.0), (0.0, 15.0))
"""Along and up the flank of the block, mm from its middle; it is seen in both poses."""


def flank(along: float, up: float) -> tuple[float, float, float]:
    """A place on the flank, in the frame of the part."""
    c, s = np.cos(TURN), np.sin(TURN)
    return (2 + 24 * c - along * s, 24 * s + along * c, 20 + up)


def click(page: Any, pose: str, name: str, at: tuple[float, float, float]) -> None:
    x, y, z = STANDS[name].apply(np.array([at]))[0]
    where = steady(page, f"turnscan.placeIn('Pose {pose}', [{x}, {y}, {z}])")
    page.mouse.click(where["x"], where["y"])


def read(form: Any, folder: Path, name: str) -> tuple[float, dict[str, Any]]:
    """The rms of the overlap as the page shows it, and what the file says of its making."""
    overlap = form.get_by_role("table", name="Overlaps").get_by_role("row").nth(1)
    expect(overlap).to_contain_text("up", timeout=LONG)
    cells = overlap.get_by_role("cell").all_inner_texts()
    assert cells[:2] == ["up", "lying"]
    data = (folder / name).read_bytes()
    low, high = read_mesh(data, ".ply").bounds
    # The foot is only in the lying pose, and what stands on the platter in neither.
    assert abs(low[2]) < 0.7
    assert abs(high[2] - 55.0) < 0.4
    return float(cells[4]), dict(read_about(data))


def test_two_poses_are_joined_by_picked_points(new_page, folder: Path, picture) -> None:
    for seed, (file, name) in enumerate((("up", "knob"), ("lying", "knob lying"))):
        write_scan(folder / f"{file}.turnscan", name, seed)
    page = new_page(width=1280, height=1100)
    page.get_by_role("button", name="Join poses").click()
    form = page.get_by_role("form", name="Join poses")
    begin = form.get_by_role("button", name="Join poses")
    form.get_by_role("checkbox", name="up (a scan)").check()
    expect(form.get_by_role("button", name="Pick points")).to_have_count(0)
    form.get_by_role("checkbox", name="lying (a scan)").check()
    form.get_by_role("button", name="Pick points in both poses").click()
    expect(form.get_by_text("click point 1")).to_have_count(2, timeout=LONG)
    form.get_by_role("img", name="Pose up").scroll_into_view_if_needed()
    rows = form.get_by_role("list", name="Picked points").get_by_role("listitem")
    for k, pick in enumerate(PICKS):
        for pose, name in (("up", "knob"), ("lying", "knob lying")):
            click(page, pose, name, flank(*pick))
            typed = rows.nth(k).get_by_role("textbox", name=pose)
            expect(typed).to_have_value(re.compile(r"\d, "))
            there = np.array([float(x) for x in typed.input_value().split(",")])
            truth = STANDS[name].apply(np.array([flank(*pick)]))[0]
            assert np.linalg.norm(there - truth) < 1.0
    form.get_by_text("Joined by 3 picked points").wait_for()
    fit = form.get_by_role("status", name="Fit of the picked points")
    off = re.search(r"fit to ([\d.]+) mm", fit.inner_text())
    assert off
    assert float(off[1]) < 1.0
    # Both places of a point stand in one line, and are read whole.
    typed = [rows.nth(0).get_by_role("textbox", name=pose) for pose in ("up", "lying")]
    assert len({round(one.bounding_box()["y"]) for one in typed}) == 1
    room = "e => e.clientWidth - parseFloat(getComputedStyle(e).paddingRight)"
    for one in typed:
        one.evaluate("e => e.scrollTo(1000, 0)")
        assert one.evaluate("e => e.scrollLeft") == 0, one.evaluate(room)
    form.get_by_role("img", name="Pose up").evaluate("e => e.scrollIntoView({block: 'center'})")
    picture(page, "join-points")
    begin.click()
    form.get_by_role("link", name="up join.ply").wait_for(timeout=LONG)
    by_points, about = read(form, folder, "up join.ply")
    assert about["source"] == "up.turnscan + lying.turnscan"
    assert set(json.loads(json.dumps(about["rig_sha256"]))) == {"up", "lying"}
    expect(form.get_by_role("img", name="Surface of up join.ply")).to_be_visible()
    form.get_by_text("lying L0", exact=True).wait_for()
    page.set_viewport_size({"width": 1280, "height": 1000})
    picture(page, "join")
    form.get_by_role("button", name="Delete all points").click()
    form.get_by_text("Joined by shape alone").wait_for()
    assert 0.02 < by_points < 0.25

"""Calibrating from the browser: every picture says what it is good for, or why it is not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.calibrate.world import World, true_rig
from tests.web.running import Browser, Running
from turnscan.calibrate import BoardView, LaserPicture, TablePicture
from turnscan.calibrate._board import Chessboard
from turnscan.rig import Pose, rig_from_json, rotation_from_vector, rotation_z

BOARD = "charuco:9x6:12:9:DICT_5X5_100"
CORNERS = 40


def _connect(browser: Browser, device: str) -> None:
    answer = browser.ask("connect", camera=device, turntable=device, lasers=device)
    assert answer["kind"] == "done", answer


def _capture(browser: Browser, **asked: object) -> str:
    """Take pictures to their end; what the job says of it."""
    job = browser.ask("capture", **asked)["job"]
    done = browser.once("job", lambda m: m["job"] == job and m["state"] != "running")
    assert done["state"] == "done", done
    return str(done["text"])


def test_pictures_are_counted_or_say_why_not(server: Running, folder: Path) -> None:
    with Browser(server) as one:
        assert one.ask("capture", stage="camera")["text"] == "no calibration has been started"
        bad = one.ask("calibrate_begin", board="chessboard:2x2:1", table=BOARD)
        assert "expected 3 to 200" in bad["text"]
        assert one.ask("calibrate_begin", board=BOARD, table=BOARD)["kind"] == "done"
        assert one.ask("capture", stage="laser")["text"] == "no devices are connected"
        _connect(one, "sim:sphere?seed=3&speckle=no")
        assert _capture(one, stage="camera") == "0 of 1 pictures can be used"
        told = one.once("calibration", lambda m: len(m["views"]) == 1)
        assert told["views"][0]["failure"] == "none of its DICT_5X5_100 markers is readable"
        assert told["coverage"] == 0
        assert len(told["missing"]) == 3
        _connect(one, "sim:sphere?seed=3&speckle=no&hand=charuco")
        assert _capture(one, stage="camera") == "1 of 1 pictures can be used"
        text = _capture(one, stage="laser", count=3)
        told = one.once("calibration", lambda m: len(m["views"]) == 5)
        seen = [v for v in told["views"] if v["stage"] == "laser"]
        missed = [v for v in seen if v["failure"]]
        assert text == f"{3 - len(missed)} of 3 pictures can be used"
        assert len(missed) < 3
        assert all(v["failure"] == "no stripe of laser right on the board" for v in missed)
        good = [v for v in told["views"] if v["corners"]]
        assert all(6 <= v["corners"] <= CORNERS for v in good)
        assert sum(told["cells"]) == sum(v["corners"] for v in good)
        assert 0 < told["coverage"] < 1
        assert len(told["cells"]) == told["columns"] * told["rows"]
        assert one.ask("forget_view", view=told["views"][0]["view"])["kind"] == "done"
        assert one.ask("forget_view", view=999)["kind"] == "refused"
        text = _capture(one, stage="table", count=4, range_deg=(0, 360))
        assert text == "1 of 4 pictures can be used"  # its back is white
        assert one.ask("calibrate_finish", name="mine")["kind"] == "started"
        failed = one.once("job", lambda m: m["state"] == "failed")
        assert failed["text"]
        assert failed["hint"]
        assert not list(folder.glob("*.json"))


def test_a_series_is_cancelled_between_two_pictures_lasers_dark(server: Running) -> None:
    with Browser(server) as one:
        one.ask("calibrate_begin", board=BOARD, table=BOARD)
        _connect(one, "sim:cylinder?seed=3&speckle=no")
        job = one.ask("capture", stage="laser", count=400, every=0.5)["job"]
        busy = one.ask("capture", stage="camera")["job"]
        waiting = one.once("job", lambda m: m["job"] == busy and m["state"] == "failed")
        assert waiting["text"] == "calibration pictures are being taken"
        assert one.ask("cancel", job=job)["kind"] == "done"
        one.once("job", lambda m: m["job"] == job and m["state"] == "cancelled")
        assert server.workshop.rig.connected.hardware.lasers.states[0].lit is False


def test_a_calibration_becomes_the_rig_in_use(server: Running, folder: Path) -> None:
    world = World(true_rig(), np.random.default_rng(21), 0.1)
    small = Chessboard(7, 5, 12.0)
    T_tb = Pose(rotation_from_vector([-np.pi / 2, 0, 0]), np.array([-30.0, 12.0, 70.0]))
    T = world.rig.T_camera_table
    room = server.workshop.calibration
    with Browser(server) as one:
        one.ask(
            "calibrate_begin", board="chessboard:8x6:20", table="chessboard:7x5:12", lowest_mm=22
        )
        live = room._live
        assert live is not None
        held = world.board_poses(10)
        for k, pose in enumerate(held):
            live._camera[k] = world.board_view(pose, name=f"c{k}")
        for k, pose in enumerate(world.board_poses(8)):
            view = world.board_view(pose, name=f"l{k}")
            live._lasers[100 + k] = "laser", LaserPicture(view, world.board_stripe(pose).pixels)
        blind = np.zeros((0, 2)), np.zeros(0, np.int32)
        live._camera[50] = BoardView(live._camera[0].board, *blind, (640, 480), "bad", "covered")
        for k, a in enumerate(np.radians(np.arange(-50, 51, 10.0))):
            px = world.rig.camera.project(T.apply(T_tb.apply(small.points) @ rotation_z(a).T))
            seen = BoardView(
                small, world.noisy(px), np.arange(35, dtype=np.int32), (640, 480), f"t{k}"
            )
            live._table[200 + k] = TablePicture(seen, {}, f"t{k}", float(k))
        room.tell()
        told = one.until("calibration", lambda m: len(m["views"]) > 20)
        assert told["missing"] == []
        assert one.ask("calibrate_finish", name="../mine.json")["kind"] == "started"
        done = one.once("job", lambda m: m["what"] == "calibrate" and m["state"] != "running")
        assert done["state"] == "done", done
        found = re.search(r"camera (\d\.\d+) px rms", done["text"])
        assert found
        assert 0.07 < float(found[1]) < 0.13  # the noise that was put in is 0.1 px
        space = one.once("calibration", lambda m: len(m["reach"]) == 2)
        x, y, z, view = space["arrays"]["placed"].T
        assert set(view) == {*range(10), *range(100, 108)}
        for k, pose in enumerate(held):
            at = np.stack([x, y, z], -1)[view == k]
            off = np.linalg.norm(at - pose.apply(live._camera[k].points), axis=1)
            assert off.max() < 0.01 * z[view == k].max()
        assert np.linalg.norm(np.array(space["axis"][:3]) - T.translation) < 10
        assert np.array(space["axis"][3:]) @ T.rotation[:, 2] > 0.999
        unused = [f for f in done["findings"] if f["code"] == "calibrate.not-used"]
        assert [(f["where"], f["text"]) for f in unused] == [("camera: bad", "covered")]
        file = next(folder.glob("*.json"))
        rig = rig_from_json(file.read_text(), "rig")
        lean = float(rig.T_camera_table.rotation[:, 2] @ T.rotation[:, 2])
        assert np.degrees(np.arccos(min(1.0, lean))) < 0.5
        devices = one.once("devices", lambda m: m["rig_name"] == file.name)
        assert devices["rig"]
        assert devices["rigs"] == [file.name]
        assert one.ask("use_rig", name=file.name)["kind"] == "done"
        assert one.ask("use_rig", name="../x.json")["text"] == "no such rig file"
        (folder / "bad.json").write_text("{}")
        assert one.ask("use_rig", name="bad.json")["code"] == "format-error"


@pytest.mark.parametrize(
    "text", ["markers:DICT_4X4_50", "markers:DICT_4X4_50:x", "markers:NO:30", "x"]
)
def test_what_rides_on_the_table_is_said_rightly_or_refused(server: Running, text: str) -> None:
    with Browser(server) as one:
        answer = one.ask("calibrate_begin", board=BOARD, table=text)
        assert answer["kind"] == "refused"
        assert answer["text"]

"""Lasers behind the browser's door: who may light them, and when they go dark."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.web.running import Browser, Running, serving
from turnscan.app import _hub, _rig_room, _socket
from turnscan.app._watched import WatchedLasers
from turnscan.arrays import Image
from turnscan.errors import DeviceDisconnected, LaserStateUnknown
from turnscan.scan import Scan
from turnscan.simulate import World

DEVICE = "sim:sphere?seed=3"


def _connected(browser: Browser) -> World:
    """The simulated bench behind the server."""
    answer = browser.ask("connect", camera=DEVICE, turntable=DEVICE, lasers=DEVICE)
    assert answer["kind"] == "done", answer
    _, bench = browser.server.workshop.rig.connected
    world = bench.hardware.turntable._world  # type: ignore[attr-defined]
    assert isinstance(world, World)
    return world


def _becomes(true: Callable[[], bool], seconds: float = 20.0) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if true():
            return True
        time.sleep(0.02)
    return true()


def _dark_for(world: World, seconds: float) -> bool:
    """Whether nothing burns, and the camera takes nothing, for a while."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if world.burning:
            return False
        time.sleep(0.002)
    return True


@pytest.mark.parametrize("allowed", [False, True])
def test_lasers_from_another_computer_need_a_flag(
    folder: Path, monkeypatch: pytest.MonkeyPatch, allowed: bool
) -> None:
    monkeypatch.setattr(_socket, "is_loopback", lambda address: False)
    with serving(folder, remote_lasers=allowed) as server, Browser(server) as far:
        assert far.hello["lasers_allowed"] is allowed
        world = _connected(far)
        name = next(iter(b.name for b in world.bench.beams))
        asked = (
            far.ask("look", on=True, lit=[name], seconds=0.04),
            far.ask("look", on=False),
            far.ask("doctor", still=True),
        )
        said = [a.get("code", a["kind"]) for a in asked]
        assert said == (
            ["done", "done", "started"] if allowed else ["no-lasers", "done"] + ["no-lasers"]
        )
        if not allowed:
            assert far.ask("scan", plan={"name": "x"})["code"] == "no-lasers"
            assert far.ask("go_on")["code"] == "no-lasers"
            assert not world.burning
            assert world.moves == 0
            assert far.ask("look", on=True)["kind"] == "done"
            assert far.until("frame")["lit"] == []
        assert far.ask("stop")["kind"] == "done"
        file = far.ask("connect", camera="folder:/etc", turntable="manual:", lasers="manual:")
        assert file["code"] == "not-remote"


def test_lasers_go_dark_when_the_operator_is_gone(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_rig_room, "ALONE_SECONDS", 0.5)
    with Browser(server) as viewer_later:
        with Browser(server) as one:
            one.ask("take_control")
            world = _connected(one)
            name = world.bench.beams[0].name
            one.ask("look", on=True, lit=[name], seconds=0.04)
            one.until("frame")
            assert _becomes(lambda: bool(world.burning))
        assert _becomes(lambda: not server.workshop.rig._looking.is_set(), 5.0)
        assert _becomes(lambda: _dark_for(world, 0.5), 5.0)
        told = viewer_later.until("devices", lambda m: not m["looking"])
        assert all(laser["lit"] is False for laser in told["lasers"])


def test_an_operator_who_does_nothing_counts_as_gone(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_rig_room, "IDLE_SECONDS", 0.5)
    with Browser(server) as one:
        world = _connected(one)
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.04)
        one.until("devices", lambda m: not m["looking"])  # live pictures are shown meanwhile
        assert _dark_for(world, 0.5)


def test_a_scan_goes_on_without_its_operator(server: Running, folder: Path) -> None:
    with Browser(server) as one:
        _connected(one)
        one.ask("scan", plan={"name": "alone", "steps": 12})
        one.once("scanning")
    with Browser(server) as two:
        assert two.hello["operator"] == two.hello["client"]
        assert _becomes(lambda: not server.workshop.rig.busy, 60.0)
    with Scan.open(folder / "alone.turnscan") as scan:
        assert scan.complete
    with Browser(server) as late:
        assert {e["name"] for e in late.hello["scans"]} == {"ball", "alone"}


def test_anybody_may_stop(server: Running) -> None:
    with Browser(server) as one, Browser(server) as two:
        world = _connected(one)
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.04)
        one.until("frame")
        assert two.ask("stop")["kind"] == "done"
        assert _becomes(lambda: _dark_for(world, 0.3), 5.0)


def test_a_camera_that_disappears_while_looking_is_said_in_words(server: Running) -> None:
    with Browser(server) as one:
        world = _connected(one)
        _, bench = server.workshop.rig.connected
        left = [3]

        def grab(timeout: float) -> Image:
            left[0] -= 1
            if left[0] < 0:
                raise DeviceDisconnected("uvc:0: the camera is gone", hint="plug it in again")
            return np.zeros((60, 80), np.uint8)

        bench.hardware.camera.grab = grab  # type: ignore[method-assign]
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.01)
        told = one.until("devices", lambda m: m["camera"]["state"] == "failed")
        assert told["camera"]["text"] == "uvc:0: the camera is gone → plug it in again"
        assert told["looking"] is False
        assert not world.burning


def test_unknown_is_not_dark() -> None:
    class Stubborn:
        names = ("left", "right")
        fail = False

        def light(self, lit: frozenset[str], lease: float) -> None:
            if self.fail:
                raise LaserStateUnknown("no answer")

        renew = off = lambda self, *_: self.light(frozenset(), 1.0)

    inner = Stubborn()
    lasers = WatchedLasers(inner)  # type: ignore[arg-type]
    assert [s.lit for s in lasers.states] == [None, None]
    lasers.light(frozenset({"left"}), 1.0)
    assert [s.lit for s in lasers.states] == [True, False]
    lasers.off()
    assert [s.lit for s in lasers.states] == [False, False]
    inner.fail = True
    with pytest.raises(LaserStateUnknown):
        lasers.off()
    assert [s.lit for s in lasers.states] == [None, None]
    time.sleep(0.05)
    assert lasers.states[0].age_seconds >= 0.05


def test_a_slow_browser_is_told_the_latest_only() -> None:
    client = _hub.Client(remote=False)
    for k in range(1000):
        client.put("devices ", f"d{k}")
    client.put("", "reply")
    assert [m for _, m in client._waiting] == ["d999", "reply"]
    for k in range(_hub.QUEUE):
        client.put("", f"r{k}")
    assert client.lost

"""Lasers behind the browser's door: who may light them, and when they go dark."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.metronome import Metronome
from tests.web.running import PATIENCE, Browser, Running, serving
from turnscan.app import Library, Workshop, _hub, _rig_session, _socket
from turnscan.app._requests import Look
from turnscan.arrays import Image
from turnscan.devices import Sweeping
from turnscan.errors import DeviceDisconnected, DeviceRefused, LaserStateUnknown
from turnscan.scan import Scan
from turnscan.simulate import World
from turnscan.workflows import Opened
from turnscan.workflows._scanning._watched import WatchedLasers, watched

DEVICE = "sim:sphere?seed=3&speckle=no"
BOARD = "charuco:7x5:30:22:DICT_4X4_50"


def _connected(browser: Browser) -> World:
    """The simulated rig behind the server."""
    answer = browser.ask("connect", camera=DEVICE, turntable=DEVICE, lasers=DEVICE)
    assert answer["kind"] == "done", answer
    bench = browser.server.workshop.rig.connected
    world = bench.hardware.turntable._world  # type: ignore[attr-defined]
    assert isinstance(world, World)
    return world


def _becomes(true: Callable[[], bool], seconds: float = PATIENCE) -> bool:
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
    server: Running, monkeypatch: pytest.MonkeyPatch, metronome: Metronome
) -> None:
    monkeypatch.setattr(_rig_session, "ALONE_SECONDS", 0.5)
    with Browser(server) as viewer_later:
        with Browser(server) as one:
            one.ask("take_control")
            world = _connected(one)
            name = world.bench.beams[0].name
            one.ask("look", on=True, lit=[name], seconds=0.04)
            one.until("frame")
            assert _becomes(lambda: bool(world.burning))
        gone = time.monotonic()
        assert _becomes(lambda: not server.workshop.rig._looking.is_set())
        assert metronome.served(gone, time.monotonic()) < 5.0
        assert _becomes(lambda: _dark_for(world, 0.5))
        assert metronome.served(gone, time.monotonic()) < 10.0
        told = viewer_later.until("devices", lambda m: not m["looking"])
        assert all(laser["lit"] is False for laser in told["lasers"])


def test_an_operator_who_does_nothing_counts_as_gone(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_rig_session, "IDLE_SECONDS", 0.5)
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
        assert _becomes(lambda: not server.workshop.rig.busy)
    with Scan.open(folder / "alone.turnscan") as scan:
        assert scan.complete
    with Browser(server) as late:
        assert {e["name"] for e in late.hello["scans"]} == {"ball", "alone"}


class Orders:
    """Writes down what lights and what turns; a move lasts until it is stopped, or a while."""

    def __init__(self, server: Running) -> None:
        devices = server.workshop.rig._devices
        assert devices is not None
        lasers = devices.lasers
        self.given: list[str] = []
        self._light, table = lasers.light, devices.switch._turntable
        self._move, self._stop, self._stopped = table.move_to, table.stop, threading.Event()
        lasers.light = self.light  # type: ignore[method-assign]
        table.move_to, table.stop = self.move_to, self.stop  # type: ignore[method-assign]

    def light(self, lit: frozenset[str], lease: float) -> None:
        if lit:
            self.given.append("light")
        self._light(lit, lease)

    def move_to(self, angle: float, timeout: float) -> float:
        self.given.append("turn")
        self._stopped.clear()
        if self._stopped.wait(0.3):
            raise DeviceRefused("stopped")
        return self._move(angle, timeout)

    def stop(self) -> None:
        self._stopped.set()
        self._stop()


BEGIN: dict[str, dict[str, Any]] = {
    "look": {"on": True, "seconds": 0.04},
    "turn": {"angle_deg": 90.0},
    "doctor": {},
    "capture": {"stage": "laser", "count": 20, "every": 0.05, "seconds": 0.04},
    "scan": {"plan": {"name": "part", "steps": 40}},
}


@pytest.mark.parametrize("orders", [1, 4])
@pytest.mark.parametrize("what", list(BEGIN))
def test_stop_by_anybody_ends_whatever_is_under_way(
    server: Running, what: str, orders: int
) -> None:
    """The first orders of a scan prepare it, the fourth takes it."""
    with Browser(server) as one, Browser(server) as two:
        world = _connected(one)
        given, asked = Orders(server), dict(BEGIN[what])
        if what == "look":
            asked["lit"] = [world.bench.beams[0].name]
        if what == "capture":
            one.ask("calibrate_begin", board=BOARD, table=BOARD)
        one.send(what, **asked)
        enough = 1 if what == "turn" else orders
        assert _becomes(lambda: len(given.given) >= enough)
        assert two.ask("stop")["kind"] == "done"
        until_stop = list(given.given)
        assert not world.burning
        assert _becomes(lambda: not server.workshop.rig._using.locked()), "it does not end"
        time.sleep(0.3)
        assert given.given == until_stop
        assert not world.burning
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.04)
        one.until("frame")  # and then it obeys again


def test_stop_waits_for_no_other_request(server: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    """More searches for devices than the server has threads for, none of which comes to an end."""
    go_on = threading.Event()
    none_ends = lambda: (go_on.wait(PATIENCE), ([], []))[1]  # noqa: E731
    monkeypatch.setattr("turnscan.workflows._scanning._devices.find_cameras", none_ends)
    with Browser(server) as one, Browser(server) as two:
        world = _connected(one)
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.04)
        one.until("frame")
        for _ in range(24):
            one.send("find_devices", probe=False)
        try:
            assert two.ask("stop")["kind"] == "done"
            assert not world.burning
            assert one.until("stopped")["confirmed"]
            with server.http() as web:  # as a page does whose socket is not open
                assert web.post("/api/stop").status_code == 204
            assert one.until("stopped")["client"] is None
        finally:
            go_on.set()


def test_the_end_says_that_a_laser_may_be_lit(folder: Path) -> None:
    """And what else is open is closed all the same."""

    def close() -> None:
        raise LaserStateUnknown("no answer")

    with serving(folder) as server:
        with Browser(server) as one:
            _connected(one)
        server.workshop.rig._stack.callback(close)
    assert isinstance(server.workshop.unsafe, LaserStateUnknown)
    with pytest.raises(RuntimeError, match="shutdown"):
        server.workshop._pool.submit(int)


def test_lasers_drawn_by_a_mirror_still_check_their_exposure() -> None:
    class Mirror:
        names = ("left",)
        light = renew = off = lambda self, *_: None

        def check_exposure(self, seconds: float) -> None:
            raise DeviceRefused(f"{seconds:g} s")

    seen = watched(Mirror())
    assert isinstance(seen, Sweeping)
    with pytest.raises(DeviceRefused, match=r"^0\.1 s"):
        seen.check_exposure(0.1)


def test_a_camera_that_disappears_while_looking_is_said_in_words(server: Running) -> None:
    with Browser(server) as one:
        world = _connected(one)
        bench = server.workshop.rig.connected
        left = [3]

        def grab(timeout: float) -> Image:
            left[0] -= 1
            if left[0] < 0:
                raise DeviceDisconnected(
                    "uvc:0: the camera has disconnected", hint="plug it in again"
                )
            return np.zeros((60, 80), np.uint8)

        bench.hardware.camera.grab = grab  # type: ignore[method-assign]
        one.ask("look", on=True, lit=[world.bench.beams[0].name], seconds=0.01)
        told = one.until("devices", lambda m: m["camera"]["state"] == "failed")
        assert told["camera"]["text"] == "uvc:0: the camera has disconnected → plug it in again"
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
    assert lasers.states[0].age >= 0.05


def test_what_is_told_last_of_devices_is_how_they_are(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    workshop, held, go = server.workshop, threading.Event(), threading.Event()
    rigs = workshop.library.rigs

    def slow() -> dict[str, Path]:
        found = rigs()
        if threading.current_thread().name == "late":
            held.set()
            assert go.wait(PATIENCE)
        return found

    with Browser(server) as browser:
        _connected(browser)
        monkeypatch.setattr(workshop.library, "rigs", slow)
        late = threading.Thread(target=workshop.rig.tell, name="late")
        late.start()
        assert held.wait(PATIENCE)
        assert browser.ask("disconnect")["kind"] == "done"
        go.set()
        late.join(PATIENCE)
        browser.ask("list_files")  # answered after all that was told before
        assert [m["addresses"] for m in browser.heard if m["kind"] == "devices"][-1] == []


def test_live_pictures_that_are_ended_while_they_begin_do_not_begin(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, held, go = server.workshop.rig, threading.Event(), threading.Event()
    there = rig._there

    def slow() -> Opened:
        held.set()
        assert go.wait(PATIENCE)
        return there()

    with Browser(server) as browser:
        _connected(browser)
        monkeypatch.setattr(rig, "_there", slow)
        on = threading.Thread(target=rig.look, args=(Look(id=1, on=True, lit=("right",)),))
        off = threading.Thread(target=rig.look_off)
        on.start()
        assert held.wait(PATIENCE)
        off.start()
        off.join(0.3)  # in its turn, not before
        go.set()
        for thread in (on, off):
            thread.join(PATIENCE)
        assert not rig._looking.is_set()


def test_a_slow_browser_is_told_the_latest_only() -> None:
    client = _hub.Client(remote=False, browser="")
    for k in range(1000):
        client.put("devices ", f"d{k}")
    client.put("", "reply")
    assert [m for _, m in client._waiting] == ["d999", "reply"]
    for k in range(_hub.QUEUE):
        client.put("", f"r{k}")
    assert client.lost


def test_stop_reaches_devices_that_are_being_let_go(tmp_path: Path) -> None:
    pressed: list[bool] = []
    workshop = Workshop(Library(tmp_path))
    devices = SimpleNamespace(
        switch=SimpleNamespace(press=lambda: pressed.append(True), release=lambda: None),
        opened=SimpleNamespace(at=None, rig=None),
        lasers=SimpleNamespace(states=[]),
    )
    workshop.rig._devices = devices  # type: ignore[assignment]
    workshop.rig._stack.callback(workshop.stop)  # while they close
    workshop.rig.disconnect()
    assert pressed == [True]
    workshop.stop()
    assert pressed == [True], "they are gone"
    workshop.close()

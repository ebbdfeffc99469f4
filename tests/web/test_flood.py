"""A flood of messages leaves the scan that is being taken its processor.

It is judged by how many messages the server reads, not by times: other programs on this computer
change those more than a flood does.
"""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import pytest

from tests.web.running import Browser, Running
from turnscan.app import _socket
from turnscan.app._limits import BURST, RATE
from turnscan.arrays import Image
from turnscan.devices import Camera

PAUSE = 0.05
"""s that the camera takes for a picture."""
PICTURES = 40
"""That the scan takes while the flood lasts."""
PATIENCE = 120.0
"""s that they, and so the flood, may take."""
FLOOD = """
import sys, time
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
base, cookie, until = sys.argv[1], sys.argv[2], time.monotonic() + float(sys.argv[3])
print("begun", flush=True)
while time.monotonic() < until:
    try:
        with connect(base.replace("http", "ws") + "/ws", origin=base, close_timeout=0.1,
                     additional_headers={"Cookie": cookie}) as link:
            while time.monotonic() < until:
                link.send('{"kind": "ack", "number": 1}')
    except (ConnectionClosed, OSError):
        time.sleep(0.05)
"""


class Paced:
    """A camera that takes its time without work, and counts its pictures."""

    def __init__(self, camera: Camera) -> None:
        self._camera, self.taken = camera, 0
        self.picture: Image | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._camera, name)

    def grab(self, timeout: float) -> Image:
        """A picture, later."""
        time.sleep(PAUSE)
        self.taken += 1
        if self.picture is None:
            return self._camera.grab(timeout)
        return self.picture.copy()

    def go_on(self) -> float:
        """Seconds in which so many pictures are taken."""
        first, begun = self.taken, time.monotonic()
        while self.taken < first + PICTURES:
            assert time.monotonic() < begun + PATIENCE, "the scan stands still"
            time.sleep(PAUSE / 5)
        return time.monotonic() - begun


def test_a_flood_of_messages_is_not_read_while_a_scan_goes_on(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[Any] = []
    parse = _socket._parse
    monkeypatch.setattr(_socket, "_parse", lambda data: (read.append(data), parse(data))[1])
    device = "sim:sphere?seed=3"
    with Browser(server) as one:
        one.ask("connect", camera=device, turntable=device, lasers=device)
        rig = server.workshop.rig
        devices = rig._devices
        assert devices is not None
        bench = devices.opened
        camera = Paced(bench.hardware.camera)
        opened = replace(bench, hardware=replace(bench.hardware, camera=camera))
        rig._devices = replace(devices, opened=opened)
        one.ask("scan", plan={"name": "long", "steps": 3000})
        one.once("scanning", lambda m: m["done"] >= 3)
        camera.picture = bench.hardware.camera.grab(1.0)  # what it renders costs too much here
        flood = subprocess.Popen(
            [sys.executable, "-c", FLOOD, server.base, one.cookie, str(PATIENCE)],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert flood.stdout is not None
            assert flood.stdout.readline() == "begun\n"
            read.clear()
            while len(read) < 10 and flood.poll() is None:
                time.sleep(0.01)
            seconds = camera.go_on()
            messages = len(read)
            assert flood.poll() is None, "the flood lasted as long as it was measured"
        finally:
            flood.kill()
            flood.communicate()
        # However often it comes again: one burst, and then so many a second. A tenth is for the
        # scan's own browser.
        assert BURST / 2 < messages < 1.1 * (BURST + RATE * seconds), (messages, seconds)
        assert one.ask("stop")["kind"] == "done"
        one.once("scanning", lambda m: m["state"] == "aborted")

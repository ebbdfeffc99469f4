"""A flood of messages leaves the scan that is being taken its processor.

It is judged by the processor time that the server uses for each picture, not by pictures a second:
other programs on this computer change that more than a flood does.
"""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

from tests.web.running import Browser, Running
from turnscan.arrays import Image
from turnscan.devices import Camera

PAUSE = 0.05
"""s that the camera takes for a picture."""
PICTURES = 40
PATIENCE = 120.0
"""s in which pictures are counted."""
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

    def cost(self) -> float:
        """Processor seconds of the whole server for each picture, from one picture to another."""
        first, used = self.taken, time.process_time()
        until = time.monotonic() + PATIENCE
        while self.taken < first + PICTURES:
            assert time.monotonic() < until, "the scan stands still"
            time.sleep(PAUSE / 5)
        return (time.process_time() - used) / (self.taken - first)


def test_a_flood_of_messages_does_not_slow_a_scan(server: Running) -> None:
    device = "sim:sphere?seed=3"
    with Browser(server) as one:
        one.ask("connect", camera=device, turntable=device, lasers=device)
        rig = server.workshop.rig
        bench = rig._bench
        assert bench is not None
        camera = Paced(bench.hardware.camera)
        rig._bench = replace(bench, hardware=replace(bench.hardware, camera=camera))
        one.ask("scan", plan={"name": "long", "steps": 3000})
        one.once("scanning", lambda m: m["done"] >= 3)
        camera.picture = bench.hardware.camera.grab(1.0)  # what it renders costs too much here
        calm = camera.cost()
        flood = subprocess.Popen(
            [sys.executable, "-c", FLOOD, server.base, one.cookie, str(PATIENCE)],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert flood.stdout is not None
            assert flood.stdout.readline() == "begun\n"
            under = camera.cost()
            assert flood.poll() is None, "the flood lasted as long as it was measured"
        finally:
            flood.kill()
            flood.communicate()
        # 1.2 to 1.6 times, by how busy the computer is; 3 and more where every message is read.
        assert under < 2.2 * calm, (calm, under)
        assert one.ask("stop")["kind"] == "done"
        one.once("scanning", lambda m: m["state"] == "aborted")

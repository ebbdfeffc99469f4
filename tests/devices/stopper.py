"""A process that has turnscan in memory and forks: each child is one command, stopped on request.

Run as ``python -m tests.devices.stopper``. An order is a line of JSON on standard input: ``argv``
of the command line, ``said`` (the file for what it prints) and, if it is to be stopped, ``how``
(SIGINT, SIGKILL, disk, alarm), in which ``phase`` (turning, settling, lit, storing), at which
``count`` of it and how many seconds after it began (``delay``). A line on standard output tells the
exit code of an order that has ended, or that its alarm is due now.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import select
import signal
import sqlite3
import sys
import tempfile
import threading
import time
from functools import cache
from typing import Any

import numpy as np

from tests.devices.boards import firmware
from turnscan.acquire._capture import Shooter
from turnscan.arrays import Image
from turnscan.cli import main
from turnscan.devices import CameraTraits, _cameras, _guard_client, _registry
from turnscan.devices._guard_client import GuardedLink
from turnscan.scan import _database as database
from turnscan.simulate.controllers import Socket

EXPOSURE = 0.01
MOVES = (b"G1 X", b"G1X", b"G02", b"T A")


class Camera:
    """Sees a stripe while a laser is lit."""

    traits = CameraTraits()
    lit = False

    def __init__(self, address: str) -> None:
        self._dice = np.random.default_rng(3)

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return seconds, gain

    def grab(self, timeout: float) -> Image:
        picture = self._dice.normal(6.0, 1.0, (48, 64))
        if Camera.lit:
            picture += 150.0 * np.exp(-0.5 * ((np.arange(64) - 30.0) / 1.5) ** 2)
        time.sleep(EXPOSURE)
        return picture.clip(0, 255).astype(np.uint8)


class Entry:
    """Its entry point."""

    name, value = "fake", "tests.devices.stopper:Camera"

    @staticmethod
    def load() -> type[Camera]:
        return Camera


class Stop:
    """Stops the process at its moment."""

    def __init__(self, order: dict[str, Any]) -> None:
        self.order, self.seen = order, 0

    def phase(self, name: str) -> None:
        if name != self.order.get("phase"):
            return
        self.seen += 1
        if self.seen == self.order["count"]:
            threading.Thread(target=self._stop, daemon=True).start()

    def _stop(self) -> None:
        how = self.order["how"]
        time.sleep(self.order["delay"])
        if how == "alarm":
            os.write(self.order["tell"], json.dumps({"alarm": self.order["id"]}).encode() + b"\n")
        elif how != "disk":
            os.kill(os.getpid(), getattr(signal, how))


def instrument(stop: Stop) -> None:
    write, light, settle, insert = (
        GuardedLink.write, GuardedLink.light, Shooter.settle, database.insert,
    )  # fmt: skip

    def writes(self: GuardedLink, data: bytes, darks: int | None = None) -> None:
        write(self, data, darks)
        if data.startswith(MOVES):
            stop.phase("turning")

    def lights(self: GuardedLink, mask: int, lease: float) -> None:
        light(self, mask, lease)
        Camera.lit = bool(mask)
        if mask:
            stop.phase("lit")

    def settles(self: Shooter) -> None:
        stop.phase("settling")
        settle(self)

    def inserts(*args: Any) -> int:
        stop.phase("storing")
        if stop.order.get("how") == "disk" and stop.seen >= stop.order["count"]:
            full = sqlite3.OperationalError("database or disk is full")
            full.sqlite_errorname = "SQLITE_FULL"
            raise full
        return insert(*args)

    GuardedLink.write = writes  # type: ignore[method-assign]
    GuardedLink.light = lights  # type: ignore[method-assign]
    Shooter.settle = settles  # type: ignore[method-assign]
    database.insert = inserts


def child(order: dict[str, Any]) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    out = os.open(order["said"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    order["tell"] = os.dup(1)
    os.dup2(out, 1)
    os.dup2(out, 2)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    instrument(Stop(order))
    sys.argv = ["turnscan", *order["argv"]]
    code = 1
    try:
        main()
        code = 0
    except SystemExit as e:
        code = e.code if isinstance(e.code, int) else 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def load() -> None:
    """All that a command would load for itself: half a second in each child, and numba in it."""
    for name in ("cli._scan", "cli._resume", "cli._devices", "scanner",
                 "workflows._scanning._scan", "workflows._scanning._devices",
                 "devices._board", "plugins"):  # fmt: skip
        importlib.import_module(f"turnscan.{name}")
    for dialect in ("fabscan", "grbl", "horus", "sardauscan"):
        importlib.import_module(f"turnscan.devices._{dialect}")
    importlib.import_module("serial")
    # The drivers that are installed: to list them anew takes a third of a command.
    _registry._entries = cache(_registry._entries)
    first_scan()
    gc.collect()
    gc.freeze()


def first_scan() -> None:
    """Kernels and all that is imported late, here and not in each child."""
    instrument(Stop({}))
    with (
        tempfile.TemporaryDirectory() as folder,
        open(os.devnull, "w") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
        Socket(firmware("grbl"), scale=10.0) as socket,
        contextlib.suppress(SystemExit),
    ):
        path = os.path.join(folder, "first.turnscan")
        sys.argv = [
            "turnscan", "scan", path, "--camera", "fake:", "--turntable",
            f"grbl:{socket.path}?lasers=a", "--steps", "2", "--range-deg", "0:5",
            "--exposure", "0.01", "--settle", "0.02", "--threshold", "40",
        ]  # fmt: skip
        main()
    assert threading.active_count() == 1, "what forks has one thread"


def serve() -> None:
    _cameras._known = lambda: {"fake": Entry()}  # type: ignore[assignment,dict-item]
    load()
    # Deadlines are those of a real board; these boards only turn faster.
    assert _guard_client.Deadlines().acknowledge == 2.0
    running: dict[int, int] = {}
    orders = b""
    while True:
        ready, _, _ = select.select([0], [], [], 0.01 if running else 1.0)
        if ready:
            more = os.read(0, 65536)
            if not more:
                return
            orders += more
        while b"\n" in orders:
            line, orders = orders.split(b"\n", 1)
            order = json.loads(line)
            pid = os.fork()
            if pid == 0:
                child(order)
            running[pid] = order["id"]
        while running:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                break
            code = os.waitstatus_to_exitcode(status)
            os.write(1, json.dumps({"id": running.pop(pid), "code": code}).encode() + b"\n")


if __name__ == "__main__":
    serve()

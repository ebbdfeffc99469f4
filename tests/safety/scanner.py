"""A scanner that forks: each child scans a little and ends, at a given moment, in a given way.

Run as a script; an order is a line of JSON on standard input, the answer a line on standard output.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import json
import math
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from turnscan.devices._guard_client import GuardedLink
from turnscan.devices._registry import board
from turnscan.errors import TurnscanError

SIGNALS = {
    "SIGINT": [signal.SIGINT], "SIGINT x2": [signal.SIGINT] * 2, "SIGINT x3": [signal.SIGINT] * 3,
    "SIGTERM": [signal.SIGTERM], "SIGHUP": [signal.SIGHUP], "SIGKILL": [signal.SIGKILL],
    "SIGSEGV": [signal.SIGSEGV], "SIGABRT": [signal.SIGABRT], "SIGSTOP": [signal.SIGSTOP],
}  # fmt: skip


class Moment:
    """Counts what the scan does and ends it at the n-th."""

    def __init__(self, order: dict[str, Any]) -> None:
        self.order, self.count = order, 0

    def tick(self, exposing: bool = False) -> None:
        """``moment`` is a number, or "lit": the first moment of an exposure."""
        self.count += 1
        if self.count == self.order["moment"] or (exposing and self.order["moment"] == "lit"):
            self.order["moment"] = 0
            say({"now": time.monotonic()})
            self.end(self.order["how"])

    def end(self, how: str) -> None:
        if how in SIGNALS:
            for number in SIGNALS[how]:
                try:
                    os.kill(os.getpid(), number)
                    time.sleep(0.005)
                except KeyboardInterrupt:
                    if number is SIGNALS[how][-1]:
                        raise
        elif how == "exception":
            raise RuntimeError("on purpose")
        elif how == "MemoryError":
            raise MemoryError
        elif how == "sys.exit":
            sys.exit(1)
        elif how == "_exit":
            os._exit(1)
        elif how == "deadlock":
            lock = threading.Lock()
            with lock:
                lock.acquire(timeout=30.0)
        elif how == "GIL":
            ctypes.PyDLL(None).sleep(30)
        elif how != "end":
            raise AssertionError(how)


def say(answer: dict[str, Any]) -> None:
    os.write(1, json.dumps(answer).encode() + b"\n")


def instrument(moment: Moment) -> None:
    """Every exchange with the guard is a moment, before and after it."""
    for name in ("write", "read", "light"):
        inner = getattr(GuardedLink, name)

        def wrapped(*args: Any, _inner: Any = inner) -> Any:
            moment.tick()
            result = _inner(*args)
            moment.tick()
            return result

        setattr(GuardedLink, name, wrapped)


def scan(order: dict[str, Any]) -> None:
    moment = Moment(order)
    options: dict[str, Any] = {}
    if order.get("script"):
        options["script"] = Path(order["script"])
    if order.get("while_connecting"):
        instrument(moment)
    table = board(order["address"], **options)
    try:
        if table.alarm:  # an earlier scan was ended in the middle of a move
            table.acknowledge()
        if not order.get("while_connecting"):
            instrument(moment)
        for step in range(order.get("steps", 2)):
            table.move_to(2 * math.pi * step / 40, 5.0)
            for name in table.names:
                table.light(frozenset({name}), order.get("lease", 2.0))
                for _ in range(8):  # an exposure
                    moment.tick(exposing=True)
                    time.sleep(0.002)
                table.light(frozenset(), 1.0)
    finally:
        if order.get("tidy", True):
            table.close()
    say({"count": moment.count})


def main() -> None:
    for name in ("fabscan", "grbl", "horus", "sardauscan"):  # here, and not in each child
        importlib.import_module(f"turnscan.devices._{name}")
    importlib.import_module("serial")
    gc.collect()
    gc.freeze()
    for line in sys.stdin:
        order = json.loads(line)
        pid = os.fork()
        if pid == 0:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            for ends in (signal.SIGTERM, signal.SIGHUP):  # whatever `nohup` has left ignored
                signal.signal(ends, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, ())
            code = 1
            try:
                scan(order)
                code = 0
            except TurnscanError as e:
                say({"error": str(e)})
            except BaseException:
                code = 1
            finally:
                os._exit(code)
        say({"pid": pid})
        os.waitpid(pid, 0)
        say({"done": True})


if __name__ == "__main__":
    main()

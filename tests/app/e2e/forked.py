"""A process that has loaded what a server of the app loads, and forks: one child, one server.

Run as ``python -m tests.app.e2e.forked``. An order is a line of JSON on standard input: ``argv`` of
the command line and ``said``, the file for what it prints. The answer is a line on standard output,
the child's number.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import signal
import sys

from turnscan.cli import main

LOADED = (
    "app", "calibrate", "detection", "drawings", "edit", "formats", "gridding", "meshing", "scan",
    "shapes", "simulate",
)  # fmt: skip
"""Rooms of turnscan that nearly every server comes to. They start no threads."""


def _serve(argv: list[str], said: str) -> None:
    """As a command of its own: with its own output, its own input, and the signals as usual."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.argv = ["turnscan", *argv]
    code: object = 0
    try:
        main()
    except SystemExit as e:
        code = e.code
    finally:
        with contextlib.suppress(ValueError, OSError):
            sys.stdout.flush()
        os._exit(code if isinstance(code, int) else 1)


if __name__ == "__main__":
    for room in LOADED:
        importlib.import_module(f"turnscan.{room}")
    gc.collect()
    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children that ended leave nothing behind
    for line in sys.stdin:
        order = json.loads(line)
        child = os.fork()
        if not child:
            _serve(order["argv"], order["said"])
        print(child, flush=True)

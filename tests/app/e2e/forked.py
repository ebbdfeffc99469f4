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
from pathlib import Path
from typing import Any

import turnscan
from turnscan.cli import main

LOADED = (
    "app", "calibrate", "detection", "drawings", "edit", "formats", "gridding", "meshing", "scan",
    "shapes", "simulate",
)  # fmt: skip
"""Rooms of turnscan that nearly every server comes to. They start no threads."""
DRAWING = (
    "matplotlib.backends.backend_agg", "matplotlib.backends.backend_pdf", "scipy.ndimage",
)  # fmt: skip
"""What these rooms load once somebody asks for a report."""
COMPILED = tuple(f"turnscan.{room}." for room in ("mesh", "points", "scan", "stripes", "surface"))
"""Rooms whose kernels nearly every server runs."""


def _load_kernels() -> None:
    """Machine code that lies on the disk, which each server would read and link by itself.

    Nothing is run: a kernel that is not there yet is compiled by the server that needs it.
    """
    package = Path(turnscan.__path__[0])
    for path in package.rglob("*_kernels.py"):
        name = ".".join(path.relative_to(package.parent).with_suffix("").parts)
        if name.startswith(COMPILED):
            importlib.import_module(name)
    for name, module in list(sys.modules.items()):
        if name.startswith(COMPILED):
            for kernel in [one for one in vars(module).values() if _is_kernel_of(name, one)]:
                for signature, *_ in kernel._cache._cache_file._load_index():
                    kernel.compile(signature)


def _is_kernel_of(module: str, one: Any) -> bool:
    return hasattr(getattr(one, "_cache", None), "_cache_file") and one.__module__ == module


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
    for library in DRAWING:
        importlib.import_module(library)
    _load_kernels()
    gc.collect()
    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children that ended leave nothing behind
    for line in sys.stdin:
        order = json.loads(line)
        child = os.fork()
        if not child:
            _serve(order["argv"], order["said"])
        print(child, flush=True)

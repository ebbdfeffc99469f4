"""Runs the laser guard as a program of its own: ``python -I _run_guard.py SETTINGS``.

The guard's modules come from the folder of this file, under their usual names but without the
packages above them, whose imports would cost half a second and much that could fail. Nothing in
that folder can take the place of a module of the standard library.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType

if __name__ == "__main__":
    for name in ("turnscan", "turnscan.devices"):
        bare = ModuleType(name)
        bare.__path__ = [str(Path(__file__).resolve().parent)]
        sys.modules[name] = bare

    from turnscan.devices._guard import main

    os._exit(main(sys.argv[1]))

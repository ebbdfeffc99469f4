"""What a test needs beyond Python's packages, and the only way to do without it.

Where it is missing the test is skipped; in CI (``CI`` of any truthy value) it fails, but for the
few things that no package manager installs by name. Those that CI may skip are counted against
`BUDGET` at the end of the run (tests/conftest.py).
"""

from __future__ import annotations

import importlib
import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from turnscan.devices import aravis_library

SHARED = Path(__file__).parents[2] / "shared" / "data"
"""Real pictures and scans made by others: beside turnscan, not part of it."""
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser")
"""Chromium without windows first: it makes a page with a quarter of the processor time."""
TESTS_OF_SHARED_DATA = 60
"""No more tests than these may need `SHARED`."""


def in_ci() -> bool:
    """Whether a run stands for the project: then nothing is left out silently."""
    return os.environ.get("CI", "").strip().lower() not in ("", "0", "false", "no", "off")


def budget() -> int:
    """The largest number of tests that may be skipped in CI."""
    return 0 if SHARED.is_dir() else TESTS_OF_SHARED_DATA


@dataclass(frozen=True)
class Need:
    """A thing that may be missing."""

    missing: Callable[[], str]
    """What is missing, in words; nothing where all is there."""
    remedy: str = "make system installs it (Debian, as root)"
    may_skip_in_ci: bool = False


def program(*names: str) -> Callable[[], str]:
    """One of these programs must be there."""
    return lambda: "" if any(map(shutil.which, names)) else f"no program {' or '.join(names)}"


def modules(*names: str) -> Callable[[], str]:
    """All these modules must load."""

    def missing() -> str:
        try:
            for name in names:
                importlib.import_module(name)
        except ImportError as e:
            return str(e)
        return ""

    return missing


def _aravis() -> str:
    try:
        aravis_library()
    except (ImportError, OSError, ValueError) as e:
        return str(e)
    return ""


def _shared() -> str:
    return "" if SHARED.is_dir() else "no ../shared/data (real data made by others)"


def _posix() -> str:
    return "" if os.name == "posix" else f"{os.name} has neither fork nor POSIX signals"


def _linux() -> str:
    return "" if sys.platform.startswith("linux") else f"{sys.platform} is not Linux"


NEEDS = {
    "assimp": Need(program("assimp")),
    "dime": Need(program("dxf2vrml")),
    "gdal": Need(program("ogr2ogr")),
    "chromium": Need(program(*BROWSERS)),
    "C compiler": Need(program("cc")),
    "fake GigE camera": Need(program("arv-fake-gv-camera-0.8")),
    "Aravis": Need(_aravis, "make drivers installs it (Debian, as root)"),
    "GenICam": Need(modules("genicam", "harvesters"), "make drivers installs it"),
    "OpenCASCADE": Need(
        modules("OCP.gp"),
        "make drivers installs it",
        may_skip_in_ci=platform.machine().lower() not in ("x86_64", "amd64", "arm64", "aarch64"),
    ),
    "Embree": Need(
        modules("embreex.rtcore_scene"),
        "there are wheels for x86-64 alone",
        may_skip_in_ci=platform.machine().lower() not in ("x86_64", "amd64"),
    ),
    "POSIX": Need(_posix, "run the tests on Linux or macOS"),
    "Linux": Need(_linux, "run the tests on Linux"),
    "shared data": Need(_shared, "put the data beside turnscan's folder", may_skip_in_ci=True),
}


def needs(*names: str) -> None:
    """Skip the test that is running where one of these is missing; fail it in CI."""
    for name in names:
        need = NEEDS[name]
        if missing := need.missing():
            reason = f"needs {name}: {missing} → {need.remedy}"
            if in_ci() and not need.may_skip_in_ci:
                pytest.fail(reason, pytrace=False)
            pytest.skip(reason)


def needs_shared(*parts: str) -> Path:
    """A file or folder of `SHARED`; skips where the data are absent, fails where it alone is."""
    needs("shared data")
    path = SHARED.joinpath(*parts)
    assert path.exists(), f"{path} is missing from the data"
    return path

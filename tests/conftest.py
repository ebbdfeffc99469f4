"""What all tests share: where the real data of others lies, when it is there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

REAL_TIME = ("acquire", "app", "crash", "devices", "safety", "web")
"""Rooms whose tests talk to other processes, which keep deadlines. On a starved machine one may
pass that the code at fault did not miss, so what fails there is tried twice more and pytest's
summary says so (``RERUN``); what is broken fails each time."""
# A property is not judged by a clock, and a run says the same each time; TURNSCAN_EXPLORE=1 looks
# at examples never seen before.
settings.register_profile(
    "turnscan",
    deadline=None,
    derandomize="TURNSCAN_EXPLORE" not in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("turnscan")
SHARED = Path(__file__).parents[2] / "shared" / "data"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).parts[0] in REAL_TIME:
            item.add_marker(pytest.mark.flaky(reruns=2))


@pytest.fixture
def shared_data() -> Path:
    """The folder of real pictures and scans made by others; skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("../shared/data is not here (real data made by others, not part of turnscan)")
    return SHARED

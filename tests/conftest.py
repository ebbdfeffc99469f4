"""What all tests share: where the real data of others lies, when it is there."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture
def shared_data() -> Path:
    """The folder of real pictures and scans made by others; skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("../shared/data is not here (real data made by others, not part of turnscan)")
    return SHARED

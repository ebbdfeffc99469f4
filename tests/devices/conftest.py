"""What the tests of real drivers need, and when they may do without it."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

Need = Callable[[Callable[[], object]], None]


@pytest.fixture(scope="session")
def need() -> Need:
    """``need(load)``: skip the test where ``load()`` says that something is missing; fail in CI."""

    def check(load: Callable[[], object]) -> None:
        try:
            load()
        except (ImportError, OSError, ValueError) as e:
            if os.environ.get("CI", "").lower() in ("1", "true"):
                pytest.fail(f"CI runs every driver's tests, but: {e}")
            pytest.skip(str(e))

    return check

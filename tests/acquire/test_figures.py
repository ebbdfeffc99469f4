"""What a scan costs: room and time, and that storing holds nothing up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bench.acquire import scan

from tests.acquire.rig import Rig, plan_of
from turnscan.acquire import look
from turnscan.errors import InputError


def test_a_scan_is_small_and_storing_quick(tmp_path: Path) -> None:
    """A tenth of 400 steps with two lasers, 640×480; `python -m bench acquire` prints all of it."""
    found = scan(tmp_path, steps=40)
    assert len(found.stored) == 80
    assert 0.2e6 < found.size < 4e6, "under 40 MB for 400 steps"
    assert np.median(found.worked) < 0.010, "s of the processor"
    assert found.overlapped > 30, "the table moves while a frame is stored"


@pytest.mark.parametrize(
    ("threshold", "said"),
    [(452.6, "threshold 452.6 grey levels, and the pixels"), (255.0, "end at 255")],
)
def test_a_threshold_beyond_the_depth_of_the_pixels_is_refused(threshold: float, said: str) -> None:
    rig = Rig()
    with pytest.raises(InputError, match=said):
        look(plan_of(2), rig.hardware, threshold=threshold)
    assert look(plan_of(2), rig.hardware, threshold=254.0).scan_plan.threshold == 254.0

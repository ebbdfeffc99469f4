"""The doctor sees by the markers on the platter whether it has moved against the rig."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tests.calibrate.boards import marker_picture, with_markers
from turnscan.arrays import Image
from turnscan.scanner._doctor import _platter
from turnscan.scanner._examine import Examination

BLANK = np.full((480, 640), 128, np.uint8)


@pytest.mark.parametrize(
    ("picture", "aside", "said"),
    [
        (marker_picture(0.4), 0.0, []),
        (marker_picture(0.4), 3.0, ["warning scan.rig-moved"]),
        (BLANK, 0.0, ["note doctor.no-markers"]),
        (BLANK[:100], 0.0, ["error doctor.other-camera"]),
    ],
)
def test_a_platter_that_moved_is_seen(picture: Image, aside: float, said: list[str]) -> None:
    look = cast("Examination", SimpleNamespace(picture=lambda: picture))
    found = _platter(look, with_markers(aside))
    assert [f"{f.severity} {f.code}" for f in found] == said
    assert all(f.remedy for f in found)

"""Markers that stand beside where the rig puts them are told when pictures are imported."""

from __future__ import annotations

import numpy as np
import pytest

from tests.calibrate.boards import marker_picture, with_markers
from turnscan.workflows._importing._look import check_turn
from turnscan.workflows._options._import import EvenSteps


@pytest.mark.parametrize(("aside", "said"), [(0.0, []), (3.0, ["scan.rig-moved"])])
def test_steps_that_agree_do_not_hide_a_platter_that_moved(aside: float, said: list[str]) -> None:
    seen = [(k, f"{k}.png", marker_picture(float(np.radians(20.0 * k)))) for k in range(4)]
    found = check_turn(EvenSteps(20.0), with_markers(aside), seen, 1)
    assert [f.code for f in found] == said

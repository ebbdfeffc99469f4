"""Two lasers on one part tell which way and how far its table turned."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.calibrate.bodies import Body, cylinder, prism, sphere, swept, two_lasers
from turnscan.calibrate import Outline, contradicted_step, outlines_of

BODIES: dict[str, Body] = {
    "hexagon": prism((5.0, 2.0), 40.0),
    "square": prism((1.0, 0.0), 40.0, 4),
    "eccentric cylinder": cylinder((6.0, 1.0), 15.0),
    "sphere": sphere((12.0, 3.0, 22.0), 18.0),
}
ALIKE: dict[str, Body] = {
    "hexagon about the axis": prism((0.0, 0.0), 40.0),
    "cylinder about the axis": cylinder((0.0, 0.0), 15.0),
}


@cache
def seen(name: str, step_deg: float, count: int = 60) -> list[Outline]:
    body = (BODIES | ALIKE)[name]
    rig, turned = two_lasers(), np.radians(step_deg) * np.arange(count)
    stripes = []
    for s in rig.sheets:
        sweep = swept(rig, s.name, body, turned, turned, 1, every=6)
        rays = rig.camera.rays(sweep.pixels)
        X = rig.T_camera_table.inverse().apply(rig.sheet(s.name).intersect(rays))
        stripes.append((np.arange(count), [X[sweep.step == k] for k in range(count)]))
    return outlines_of(stripes)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("step_deg", [6.0, -6.0])
def test_the_other_way_is_named(body: str, step_deg: float) -> None:
    outlines = seen(body, step_deg)
    assert contradicted_step(outlines, np.radians(step_deg)) == ()
    assert contradicted_step(outlines, -np.radians(step_deg)) == (np.radians(step_deg),)


@pytest.mark.parametrize("body", ["hexagon", "sphere"])
def test_another_size_is_named(body: str) -> None:
    right = contradicted_step(seen(body, 6.0), np.radians(9.0))
    assert np.degrees(right) == pytest.approx([6.0], rel=0.01)


def test_a_part_alike_from_six_sides_names_no_single_step() -> None:
    right = contradicted_step(seen("hexagon about the axis", 6.0), np.radians(4.8))
    assert len(right) > 1


@pytest.mark.parametrize("step_deg", [6.0, -6.0, 5.0])
def test_a_round_part_and_one_laser_say_nothing(step_deg: float) -> None:
    centred = seen("cylinder about the axis", 6.0)
    assert contradicted_step(centred, np.radians(step_deg)) == ()
    assert contradicted_step(seen("hexagon", 6.0)[:1], np.radians(step_deg)) == ()


@pytest.mark.parametrize(
    ("step_deg", "count", "closes"),
    [
        (6.0, 60, True),  # the right one
        (-6.0, 60, True),  # the mirror image closes as well
        (10.0, 60, False),  # what is passed twice is not alike
        (360 / 51, 51, False),  # a whole turn in words, nine steps short of one in truth
        (5.0, 60, None),  # less than a turn
    ],
)
def test_one_laser_sees_whether_a_turn_closes(
    step_deg: float, count: int, closes: bool | None
) -> None:
    outline = seen("hexagon", 6.0)[0]
    some = Outline(outline.step[:count], outline.radius[:count], outline.azimuth[:count])
    off = some.open_seam(np.radians(step_deg), count)
    assert (None if off is None else off == 0.0) == closes
    round_part = seen("cylinder about the axis", 6.0)[0]
    assert round_part.open_seam(np.radians(step_deg), count) is None

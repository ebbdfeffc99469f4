"""C13: a controller that restarted is not believed, at any step, by the real driver."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from pathlib import Path

import pytest

from tests.acquire.rig import Rig, plan_of
from tests.devices.boards import firmware, near
from turnscan.acquire import Hardware, check_angle, look, reindexed, run
from turnscan.errors import AngleLost
from turnscan.scan import Scan

STEPS = 6
PLAN = plan_of(STEPS, step_deg=Fraction(6), lasers=("a",), blind_steps=0)


def test_after_a_reboot_at_any_step_the_angle_is_lost(tmp_path: Path) -> None:
    rng = random.Random(13)
    refused = believed = 0
    for trial in range(100):
        step = rng.randrange(0, STEPS - 1)
        path = tmp_path / f"{trial}.turnscan"
        board = firmware("grbl")
        table, _ = near("grbl", board)
        camera = Rig(names=("a",))
        hardware = Hardware(camera, table, camera)
        first = look(PLAN, hardware)
        with Scan.create(path, first.scan_plan) as scan:
            # Taken as far as this step, and perhaps already on the way to the next.
            short = plan_of(step + 1, step_deg=Fraction(6), lasers=("a",), blind_steps=0)
            run(short, hardware, scan, first=first)
            assert math.degrees(scan.last_angle) == pytest.approx(6 * step, abs=0.06)
        if trial % 2:
            table.move_to(PLAN.angle(step + 1), 20.0)
        rebooted, _ = near("grbl", firmware("grbl"))
        with Scan.open(path) as scan:
            with pytest.raises(AngleLost, match="restarted"):
                check_angle(PLAN, scan, rebooted)
            refused += 1
            again, _ = near("grbl", board)
            if step > 0 or trial % 2:
                check_angle(PLAN, scan, again)
                believed += 1
    assert refused == 100
    assert believed > 80


def test_a_person_says_where_it_stands_and_the_scan_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    camera = Rig(names=("a",))
    table, _ = near("grbl", firmware("grbl"))
    plan = plan_of(6, step_deg=Fraction(6), lasers=("a",))
    first = look(plan, Hardware(camera, table, camera))
    with Scan.create(path, first.scan_plan) as scan:
        run(plan_of(3, step_deg=Fraction(6), lasers=("a",)), Hardware(camera, table, camera), scan,
            first=first)  # fmt: skip
    rebooted, _ = near("grbl", firmware("grbl"))
    with Scan.resume(path) as scan:
        shifted = reindexed(rebooted, math.radians(12.0))
        run(plan, Hardware(camera, shifted, camera), scan)
        angles = [math.degrees(f.angle) for f in scan.frames()]
    assert angles == pytest.approx([0, 6, 12, 18, 24, 30], abs=0.06)
    assert math.degrees(rebooted.angle) == pytest.approx(18.0, abs=0.06)

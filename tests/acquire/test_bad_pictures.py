"""A whole scan with a camera whose pictures go wrong: none of them gets into the file (D5)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.acquire.rig import HEIGHT, Rig, plan_of
from turnscan.acquire import Event, Hardware, Missing, Taken, look, run
from turnscan.arrays import Image
from turnscan.devices import CameraTraits, Steady
from turnscan.errors import DeviceRefused, DeviceTimeout
from turnscan.scan import Scan

KINDS = ("dropped", "frozen", "torn", "blank", "wrong size", "saturated")


class Spoiled:
    """The camera of a `Rig`, some of whose pictures are spoiled."""

    traits = CameraTraits(instant=True)

    def __init__(self, rig: Rig, script: Iterator[str | None], seed: int) -> None:
        self.rig, self.script = rig, script
        self.rng = np.random.default_rng(seed)
        self.good: set[tuple[float, frozenset[str], bytes]] = set()
        self.spoiled = 0
        self.last: Image | None = None

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return self.rig.configure(seconds, gain)

    def grab(self, timeout: float) -> Image:
        kind = next(self.script, None)
        image, last = self.rig.grab(timeout).copy(), self.last
        row = int(self.rng.integers(8, HEIGHT - 8))
        if kind is None or last is None:
            self.good.add((self.rig.at, self.rig.lit, image.tobytes()))
            self.last = image
            return image
        self.spoiled += 1
        if kind == "dropped":
            raise DeviceTimeout("no picture")
        if kind == "frozen":
            return last
        if kind == "torn":
            image[row:] = last[row:]
        elif kind == "blank":
            image[row:] = 0
        elif kind == "wrong size":
            return image[::2, ::2].copy()
        elif kind == "saturated":
            image[:] = 255
        return image


def script(share: float, burst: int, seed: int) -> Iterator[str | None]:
    rng = np.random.default_rng(seed)
    while True:
        if rng.uniform() < share:
            for _ in range(int(rng.integers(1, burst + 1))):
                yield str(rng.choice(KINDS))
        yield None


@pytest.mark.parametrize(("share", "burst", "most"), [(0.12, 1, 0), (0.06, 20, 12)])
def test_what_is_stored_is_what_the_camera_saw_there(
    tmp_path: Path, share: float, burst: int, most: int
) -> None:
    rig = Rig()
    camera = Spoiled(rig, script(share, burst, seed=3), seed=4)
    hardware = Hardware(Steady(camera), rig, rig)
    plan = plan_of(40)
    events: list[Event] = []
    path = tmp_path / "a.turnscan"
    first = look(plan, hardware)
    Scan.create(path, first.scan_plan).close()
    with Scan.resume(path) as scan:
        outcome = run(plan, hardware, scan, first=first, listener=events.append)
    taken = [e for e in events if isinstance(e, Taken)]
    missing = [e for e in events if isinstance(e, Missing)]
    assert camera.spoiled >= 8
    assert outcome.complete
    assert len(taken) + len(missing) == 80
    assert len(missing) <= most
    assert (len(missing) > 0) == (most > 0), "bursts this long must cost pictures"
    for e in taken:
        angle = plan.angle(e.step)
        assert (angle, plan.sets[e.laser], e.lit.tobytes()) in camera.good
        assert e.dark is not None
        assert (angle, frozenset(), e.dark.tobytes()) in camera.good
    with Scan.open(path) as scan:
        stored = {laser: scan.missing(laser) for laser in plan.sets}
        assert sum(len(m) for m in stored.values()) == len(missing)
        assert all("×" in cause for m in stored.values() for cause in m.values())
    assert math.isfinite(rig.at)


def test_another_camera_in_the_middle_of_a_scan_ends_it(tmp_path: Path) -> None:
    rig = Rig()
    camera = Spoiled(rig, iter([None] * 20 + ["wrong size"] * 100), seed=4)
    hardware = Hardware(Steady(camera), rig, rig)
    plan = plan_of(40)
    first = look(plan, hardware)
    Scan.create(tmp_path / "a.turnscan", first.scan_plan).close()
    with (
        Scan.resume(tmp_path / "a.turnscan") as scan,
        pytest.raises(DeviceRefused, match="the first had 64×48 pixels"),
    ):
        run(plan, hardware, scan, first=first)
    assert not rig.lit

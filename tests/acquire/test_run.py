"""One turn of devices into a scan file: whatever happens, the lasers end dark."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from turnscan.acquire import Turn, even_turn, run
from turnscan.arrays import Image
from turnscan.errors import DeviceTimeout, InputError
from turnscan.scan import Frame


class _Rig:
    """Camera, table and lasers in one, writing down what is asked of them."""

    names = ("left", "right")

    def __init__(self, fail: dict[int, type[Exception]] | None = None) -> None:
        self.log: list[str] = []
        self.lit: frozenset[str] = frozenset()
        self.grabs = 0
        self.fail = fail or {}

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return seconds * 2, gain

    def grab(self, timeout: float) -> Image:
        self.grabs += 1
        self.log.append(f"grab {'+'.join(sorted(self.lit)) or 'dark'}")
        if self.grabs in self.fail:
            raise self.fail[self.grabs]("no")
        return np.full((2, 3), len(self.lit), np.uint8)

    def move_to(self, angle: float, timeout: float) -> float:
        self.log.append(f"move {angle:.2f}")
        return angle

    def stop(self) -> None:
        pass

    def light(self, lit: frozenset[str], lease: float) -> None:
        self.lit = lit

    def off(self) -> None:
        self.lit = frozenset()


class _Sink:
    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.missing: list[tuple[int, str]] = []

    def add(self, frame: Frame) -> None:
        self.frames.append(frame)

    def add_missing(self, step: int, laser: str, cause: str, commanded: float) -> None:
        self.missing.append((step, laser))


TURN = Turn(even_turn(2), ("left", "right"), 0.01)


def go(rig: _Rig, turn: Turn = TURN) -> _Sink:
    sink = _Sink()
    run(turn, rig, rig, rig, sink, clock=lambda: 5.0)
    return sink


def test_each_step_is_dark_then_each_laser_alone() -> None:
    rig = _Rig()
    sink = go(rig)
    step = ["grab dark", "grab left", "grab right"]
    assert rig.log == ["move 0.00", *step, "move 3.14", *step]
    assert [(f.step, f.laser) for f in sink.frames] == [
        (0, "left"), (0, "right"), (1, "left"), (1, "right")
    ]  # fmt: skip
    assert sink.frames[0].settings == {"seconds": 0.02, "gain": 1.0}
    assert sink.frames[0].commanded == 0.0
    assert math.isnan(sink.frames[0].measured)
    assert not rig.lit


def test_a_picture_that_does_not_come_is_asked_for_again_then_recorded_missing() -> None:
    once = _Rig({2: DeviceTimeout})
    assert len(go(once).frames) == 4
    twice = _Rig({2: DeviceTimeout, 3: DeviceTimeout})
    sink = go(twice)
    assert sink.missing == [(0, "left")]
    assert len(sink.frames) == 3


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_lasers_are_dark_however_it_ends(error: type[BaseException]) -> None:
    rig = _Rig({3: error})  # type: ignore[dict-item]
    with pytest.raises(error):
        go(rig)
    assert not rig.lit


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: even_turn(0), "0 steps"),
        (lambda: Turn((), ("a",), 0.1), "at least one"),
        (lambda: Turn((0.0,), ("a",), -1.0), "exposure -1 s"),
        (lambda: Turn((0.0,), ("a",), 0.1, gain=0.0), "gain 0"),
        (lambda: Turn((0.0,), (), 0.1), "at least one laser"),
        (lambda: go(_Rig(), Turn((0.0,), ("green",), 0.1)), "no laser 'green'"),
    ],
)
def test_what_cannot_be_done_is_refused(make: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()  # type: ignore[operator]


def test_a_simulated_turn_fills_a_scan_file(tmp_path: Path) -> None:
    from turnscan.scan import Scan, ScanPlan
    from turnscan.simulate import simulated

    d = simulated("sim:cylinder?steps=3&drop=0.3&seed=1")
    turn = Turn(even_turn(3), d.lasers.names, d.seconds)
    plan = ScanPlan(640, 480, "uint8", 1, turn.lasers, 3, 6.0)
    with Scan.create(tmp_path / "a.turnscan", plan, d.world.bench.rig) as scan:
        run(turn, d.camera, d.turntable, d.lasers, scan)
    with Scan.open(tmp_path / "a.turnscan") as scan:
        assert scan.complete
        assert len(list(scan.frames())) + len(scan.missing("right")) == 3

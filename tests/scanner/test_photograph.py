"""Series of pictures for a calibration: what is lit and where the table stands at each."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import pytest

from turnscan.acquire import Hardware
from turnscan.errors import DeviceDisconnected, InputError
from turnscan.scanner import Addresses, Opened, Series, Shot, photograph


@dataclass
class Bench:
    """Camera, turntable and lasers that write down what is asked of them."""

    names: tuple[str, ...] = ("left", "right")
    angle: float = 0.0
    lit: frozenset[str] = frozenset()
    dies_at: int = 99
    taken: list[tuple[float, frozenset[str]]] = field(default_factory=list)
    stops: int = 0

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return seconds, gain

    def grab(self, timeout: float) -> np.ndarray:
        if len(self.taken) == self.dies_at:
            raise DeviceDisconnected("the camera has disconnected")
        self.taken.append((round(float(np.degrees(self.angle)), 6), self.lit))
        return np.zeros((4, 4), np.uint8)

    def move_to(self, angle: float, timeout: float) -> float:
        self.angle = angle
        return angle

    def stop(self) -> None:
        self.stops += 1

    def light(self, lit: frozenset[str], lease: float) -> None:
        self.lit = lit

    def renew(self, lease: float) -> None:
        pass

    def off(self) -> None:
        self.lit = frozenset()


def opened(bench: Bench) -> Opened:
    at = Addresses("fake:", "fake:", "fake:")
    return Opened(at, Hardware(bench, bench, bench), 0.01, 8)  # type: ignore[arg-type]


def test_each_laser_has_a_dark_picture_of_its_own_at_every_stop() -> None:
    bench, shots = Bench(), list[Shot]()
    series = Series(3, (Fraction(-20), Fraction(20)), lasers=("left", "right"))
    photograph(opened(bench), series, shots.append)
    dark, left, right = frozenset[str](), frozenset({"left"}), frozenset({"right"})
    assert bench.taken == [
        (angle, lit) for angle in (-20.0, 0.0, 20.0) for lit in (dark, left, dark, right)
    ]
    assert [(s.stop, s.laser) for s in shots] == [
        (k, name) for k in range(3) for name in ("left", "right")
    ]
    assert not bench.lit


def test_a_whole_turn_ends_before_it_begins_again() -> None:
    assert Series(4, (Fraction(0), Fraction(360))).angles_deg() == [0.0, 90.0, 180.0, 270.0]
    assert Series(2).angles_deg() == [None, None]


def test_the_hand_has_time_before_each_picture() -> None:
    waited = list[float]()
    photograph(opened(Bench()), Series(2, every=1.5), lambda shot: None, waited.append)
    assert waited == [1.5, 1.5]


def test_it_is_dark_and_at_rest_after_a_failure() -> None:
    bench = Bench(dies_at=1)
    with pytest.raises(DeviceDisconnected):
        photograph(opened(bench), Series(lasers=("left",)), lambda shot: None)
    assert not bench.lit
    assert bench.stops == 1


@pytest.mark.parametrize("wrong", [{"count": 0}, {"count": 401}, {"every": -1.0}, {"every": 61.0}])
def test_a_series_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        Series(**wrong)  # type: ignore[arg-type]


def test_a_laser_that_is_not_there_is_refused_before_anything_moves() -> None:
    bench = Bench()
    with pytest.raises(InputError, match="no laser 'up'"):
        photograph(opened(bench), Series(lasers=("up",)), lambda shot: None)
    assert not bench.taken

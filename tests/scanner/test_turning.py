"""The direction of turning, from outlines that a laser and the edges tell."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.arrays import Floats
from turnscan.scanner._examine import _comes_round
from turnscan.scanner._rotation_sense import VIEWS, OutlineTrack, drift, edges, sense

ANGLES = np.arange(VIEWS) * 2 * np.pi / VIEWS


def outline(seed: int, fold: int = 1) -> tuple[Floats, Floats]:
    """Harmonics 1 to 5 (times ``fold``) of an irregular part: numbers, complex amplitudes."""
    rng = np.random.default_rng(seed)
    n = fold * np.arange(1, 6)
    return n, (rng.normal(size=(5, 4)) + 1j * rng.normal(size=(5, 4))) / n[:, None]


def seen(shape: tuple[Floats, Floats], azimuth: float, way: int, noise: float, seed: int) -> Floats:
    """(views, rows): how far out it reaches towards an azimuth, at each angle told."""
    n, amplitudes = shape
    at = np.radians(azimuth) - way * ANGLES
    reach = (np.exp(1j * np.outer(at, n)) @ amplitudes).real
    return 30.0 + reach + noise * np.random.default_rng(seed).normal(size=reach.shape)


def witnesses(
    shape: tuple[Floats, Floats], way: int, theta: float, two: bool, noise: float = 0.1
) -> list[OutlineTrack]:
    if two:
        return [
            OutlineTrack(seen(shape, side * theta, way, noise, side + 5), side, False)
            for side in (-1, 1)
        ]
    return [
        OutlineTrack(seen(shape, theta, way, noise, 7), 1, False),
        OutlineTrack(seen(shape, -90.0, way, noise, 8), -1, True),
        OutlineTrack(seen(shape, 90.0, way, noise, 9), 1, True),
    ]


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.sampled_from([1, -1]), st.floats(12.0, 45.0), st.booleans())
def test_the_direction_is_right(seed: int, way: int, theta: float, two: bool) -> None:
    assert sense(witnesses(outline(seed), way, theta, two)) is (way > 0)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.booleans())
def test_noise_tells_nothing(seed: int, two: bool) -> None:
    rng = np.random.default_rng(seed)
    group = [
        OutlineTrack(30.0 + rng.normal(size=(VIEWS, 120)), w.side, w.edge)
        for w in witnesses(outline(0), 1, 25.0, two)
    ]
    assert sense(group) is None
    assert all(w.is_round for w in group)


@pytest.mark.parametrize("fold", [2, 3])
def test_a_symmetric_part_is_right_or_unseen(fold: int) -> None:
    told = [sense(witnesses(outline(seed, fold), 1, 25.0, False)) for seed in range(40)]
    assert told.count(False) == 0
    assert told.count(True) > 0


def test_rows_that_are_not_seen_say_nothing() -> None:
    group = witnesses(outline(3), -1, 25.0, False)
    reach = group[0].reach.copy()
    reach[3, :] = np.nan
    reach[:, 2] = np.nan
    assert sense([OutlineTrack(reach, 1, False), *group[1:]]) is False
    nothing = np.full_like(reach, np.nan)
    assert sense([OutlineTrack(nothing, 1, False), OutlineTrack(nothing, -1, False)]) is None


def test_edges_of_a_bright_part_before_a_dark_room() -> None:
    rng = np.random.default_rng(2)
    views = []
    for angle in ANGLES:
        view = rng.normal(10.0, 1.0, (60, 100))
        middle = 50 + 5 * np.sin(angle)
        u = np.arange(100)
        view[20:50, abs(u - middle) < 20] += 60.0
        views.append(view.astype(np.uint8))
    left, right, axis = edges(views)
    assert axis == pytest.approx(50.0, abs=1.5)
    assert np.isnan(left.reach[:, :15]).all()
    assert np.nanmean(right.reach[:, 25:45]) == pytest.approx(20.0, abs=1.5)
    assert np.ptp(right.reach[:, 30]) == pytest.approx(10.0, abs=2.0)
    assert not right.is_round


def round_part(seed: int, per_view: float, ink: float) -> list[np.ndarray]:
    """Pictures of the middle of a round part under a lamp that stays, its ink moving on."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:120, :128]
    lamp = 20.0 * np.exp(-(((u - 60) / 40.0) ** 2)) * (np.abs(v - 60) < 45)
    print_ = cv2.GaussianBlur(rng.normal(size=(120, 256)), (0, 0), 3.0)
    out = []
    for k in (0, 0, 1, 2, 3):
        moved = cv2.warpAffine(
            print_, np.float32([[1, 0, k * per_view - 64], [0, 1, 0]]), (128, 120)
        )
        light = lamp * (1 + ink * moved / print_.std())
        out.append((light + rng.normal(0, 0.5, light.shape)).astype(np.float32))
    return out


@pytest.mark.parametrize("per_view", [3.0, -3.0])
def test_ink_on_a_round_part_shows_the_direction(per_view: float) -> None:
    told = [drift(round_part(seed, per_view, 0.2)) for seed in range(20)]
    assert told.count(per_view > 0) >= 16
    assert told.count(per_view < 0) == 0


def test_a_plain_round_part_shows_none() -> None:
    """Noise alone, in a light that stays: no direction is better than a wrong one."""
    told = [drift(round_part(seed, 3.0, 0.0)) for seed in range(200)]
    assert sum(t is not None for t in told) <= 2


LOOKS = (-14.4, -7.2, -3.6, -1.8, -0.9, 0.0, 0.9, 1.8, 3.6, 7.2, 14.4)


def comes_round(ratio: float, fold: int = 1) -> tuple[float, bool]:
    """For a table that turns ``ratio`` times as far as it is told, and an irregular part."""
    part = outline(4, fold)
    rng = np.random.default_rng(2)

    def line(told: float) -> Floats:
        n, amplitudes = part
        at = np.radians(told * ratio)
        reach = (np.exp(1j * np.outer(n, np.atleast_1d(at))).T @ amplitudes).real[0]
        return 3.0 * np.asarray(reach) + rng.normal(0, 0.02, len(reach))

    def distance(a: Floats, b: Floats) -> float:
        return float(np.minimum(np.abs(a - b), 5.0).mean())

    start, again = line(0.0), line(0.0)
    told = [360.0 / part for part in (7, 5, 3, 2)] + [360.0 + look for look in LOOKS]
    return _comes_round(told, [distance(line(t), start) for t in told], distance(start, again))


def test_one_turn_is_seen_to_be_one() -> None:
    assert comes_round(1.0) == (360.0, True)


@pytest.mark.parametrize("ratio", [28.125, 28.0, 10.0, 2.0, 3.0, 14.0, 0.5, 3.2, 1.5, 8.8])
def test_a_table_that_turns_more_or_less_than_it_is_told_fools_nobody(ratio: float) -> None:
    """A factory GRBL makes 250 steps of a degree: a table of 3 200 turns 28.125 times."""
    degrees, _ = comes_round(ratio)
    assert degrees != 360.0


def test_a_symmetric_part_does_not_tell() -> None:
    degrees, telling = comes_round(1.0, fold=2)
    assert (np.isnan(degrees), telling) == (True, False)

"""The angles of a turn: wraps, gaps, outliers, uneven motors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.calibrate import angle_model
from turnscan.calibrate._steps import _smooth
from turnscan.errors import Degenerate, NotEnoughViews

SIGMA = np.radians(0.03)


def wrapped(a: np.ndarray) -> np.ndarray:
    return np.angle(np.exp(1j * a))


def turn(n: int = 120, step: float = 3.0, seed: int = 0) -> np.ndarray:
    return np.radians(step) * np.arange(n) + SIGMA * np.random.default_rng(seed).standard_normal(n)


def codes(model: object) -> set[str]:
    return {f.code for f in model.findings}  # type: ignore[attr-defined]


@settings(max_examples=25)
@given(
    step=st.floats(0.3, 40).flatmap(lambda s: st.sampled_from([s, -s])),
    start=st.floats(-3, 3),
    count=st.integers(12, 80),
)
def test_any_even_motion_is_unwrapped(step: float, start: float, count: int) -> None:
    truth = start + np.radians(step) * np.arange(count)
    model = angle_model(wrapped(truth), np.full(count, SIGMA))
    assert np.allclose(model.angles - model.angles[0], truth - truth[0], atol=1e-6)
    assert model.step == pytest.approx(np.radians(step), rel=1e-6)


def test_gaps_are_filled_and_said() -> None:
    a = turn()
    holes = [10, 11, 50]
    seen = a.copy()
    seen[holes] = np.nan
    model = angle_model(wrapped(seen), np.full(len(a), SIGMA))
    assert np.abs(model.angles - a)[holes].max() < np.radians(0.2)
    assert not model.measured[holes].any()
    assert "calibrate.angle-filled" in codes(model)


def test_a_misread_marker_is_dropped_but_a_lost_step_is_kept() -> None:
    a = turn()
    a[60:] += np.radians(3.0)
    misread = a.copy()
    misread[30] += np.pi / 2
    model = angle_model(wrapped(misread), np.full(len(a), SIGMA))
    assert not model.measured[30]
    assert model.measured[55:65].all()
    assert np.abs(model.angles - a).max() < np.radians(0.3)
    assert "calibrate.step-jump" in codes(model)


def test_an_even_turn_has_nothing_to_complain_about() -> None:
    model = angle_model(wrapped(turn()), np.full(120, SIGMA), nominal_step=np.radians(3.0))
    assert codes(model) == {"calibrate.turn"}
    assert "counter-clockwise" in model.findings[0].message


@pytest.mark.parametrize("count", [9, 12])
def test_the_noise_of_a_few_angles_is_no_uneven_motion(count: int) -> None:
    """Six waves and a line go through nine angles, whatever these are."""
    k, all_good = np.arange(float(count)), np.ones(count, np.bool_)
    for seed in range(20):
        noise = 0.01 * np.random.default_rng(seed).standard_normal(count)
        a = 2 * np.pi / count * k + noise
        fit, step, _ = _smooth(k, a, np.full(count, SIGMA), all_good, None)
        assert np.allclose(np.diff(fit), step, atol=1e-9)
        assert 0.003 < (a - fit).std() < 0.02


def test_a_wrong_nominal_step_is_named() -> None:
    model = angle_model(wrapped(turn(step=2.8)), np.full(120, SIGMA), nominal_step=np.radians(3.0))
    assert "calibrate.step-size" in codes(model)


def test_too_little_to_go_by() -> None:
    with pytest.raises(NotEnoughViews):
        angle_model([0.0, 0.1, np.nan, np.nan], np.full(4, SIGMA))
    with pytest.raises(Degenerate):
        angle_model(np.random.default_rng(1).uniform(-3, 3, 60), np.full(60, SIGMA))


def _faults(kind: str) -> np.ndarray:
    """A turn of 120 steps of 3° with one kind of fault."""
    a = turn()
    if kind == "jump":
        a[60:] += np.radians(3.0)
    elif kind == "start":
        a[1:] -= np.radians(1.5)
        a[2:] -= np.radians(0.8)
        a[3:] -= np.radians(0.3)
    elif kind == "harmonic":
        a += np.radians(1.0) * np.cos(a)
    elif kind == "uneven":
        a += np.radians(0.3) * np.random.default_rng(5).standard_normal(len(a))
    return a


@pytest.mark.parametrize("kind", ["jump", "start", "harmonic", "uneven"])
def test_faults_of_the_table_are_told_apart(kind: str) -> None:
    """Each with its place and pictures, and none of the others with it."""
    names = [f"p{n}.jpg" for n in range(120)]
    model = angle_model(wrapped(_faults(kind)), np.full(120, SIGMA), names=names)
    assert codes(model) == {f"calibrate.step-{kind}", "calibrate.turn"}
    found = next(f for f in model.findings if f.code != "calibrate.turn")
    if kind == "jump":
        assert found.where == "step 59 to 60 (p59.jpg to p60.jpg)"
        assert "+6.0" in found.message or "+5.9" in found.message
    if kind == "start":
        assert found.where == "step 0 to 1 (p0.jpg to p1.jpg)"
        assert "first 3 steps together are 2.5" in found.message or "2.6" in found.message
    if kind == "harmonic":
        assert "amplitudes 1.0" in found.message or "amplitudes 0.99" in found.message
    if kind == "uneven":
        assert 0.25 < float(found.message.split("scatter by ")[1].split("°")[0]) < 0.35

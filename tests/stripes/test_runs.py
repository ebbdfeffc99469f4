"""The stripe in the kept runs of a frame is the one in the whole picture, to the bit."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError
from turnscan.runs import Runs
from turnscan.scan._codec import Background, decode, decode_runs, encode
from turnscan.scan._plan import ScanPlan
from turnscan.scan._signal import signal_of, statistics
from turnscan.stripes import Choice, RunDetector, Signal, Strategy, StripeSettings

H, W = 40, 210
FIELDS = ("position", "sigma", "amplitude", "width", "flags", "skew")


def a_scene(rng, dtype, channels, dark):
    """Lit, dark, of a wandering stripe, a second one, a halo, clipped and spurious pixels."""
    top = float(np.iinfo(dtype).max)
    u, v = np.arange(W), np.arange(H)[:, None]
    middle = rng.uniform(10, W - 10) + rng.normal(0, 1.5) * v + 4 * np.sin(v / rng.uniform(2, 9))
    light = rng.uniform(0.1, 1.6) * np.exp(-0.5 * ((u - middle) / rng.uniform(0.8, 6)) ** 2)
    light = light * (rng.random((H, 1)) < 0.9)
    light += rng.uniform(0, 0.4) * np.exp(-0.5 * ((u - middle - rng.uniform(5, 60)) / 2) ** 2)
    light += rng.uniform(0, 0.15) * np.exp(-np.abs(u - middle) / 15)
    room = rng.uniform(0.02, 0.5) + 0.2 * np.sin(u / 30 + v / 20) * (dark == "background")
    noise = rng.uniform(0.001, 0.02)
    shape = (H, W) if channels == 1 else (H, W, 3)
    tint = np.ones(1) if channels == 1 else np.array([0.1, 1.0, 0.2])

    def seen(what):
        grey = what if channels == 1 else what[..., None] * tint
        noisy = (grey + noise * rng.normal(size=shape)) * top
        return np.clip(np.rint(noisy), 0, top).astype(dtype)

    return seen(light + room), None if dark == "none" else seen(room + 0 * u)


def stored(plan, lit, dark, own):
    """Payload of a frame, level and noise of its signal."""
    told = statistics(signal_of(lit, dark, plan.weights))
    return encode(lit, dark, own, told.level + plan.threshold, plan)[0], told


def both_ways(plan, frames, look, inside):
    """The stripes of some frames from whole pictures, and from runs on one dirty surface."""
    weigh = Signal(plan.weights, plan.dtype)
    project = None if plan.channels == 1 else weigh.project
    detector = RunDetector(weigh, look, (H, W), inside)
    for lit, dark, kind in frames:
        payload, told = stored(plan, lit, dark, kind == "own")
        ground = Background(dark, project) if kind == "background" else None
        what = (payload, plan, kind, ground, project, "here")
        on, off = decode(*what)
        scale = weigh.gain
        told_in = (told.level * scale, told.noise * scale)
        whole = weigh.detect(on, off, look, *told_in, inside)
        found = detector.stripe(decode_runs(*what), *told_in)
        for surface in (detector._lit, detector._dark):  # what is left there must not matter
            surface[...] = np.random.default_rng(1).integers(0, 255, surface.shape)
        yield whole, found


@given(
    seed=st.integers(0, 2**32 - 1),
    strategy=st.sampled_from(get_args(Strategy)),
    choice=st.sampled_from(get_args(Choice)),
    kind=st.sampled_from(["own", "background", "none"]),
    orientation=st.sampled_from(["vertical", "horizontal"]),
    colour=st.booleans(),
    deep=st.booleans(),
    margin=st.sampled_from([0, 1, 3, 32]),
    extra=st.sampled_from(
        [
            {},
            {"width": 2.0},
            {"threshold": 9.0},
            {"roi": (20, 5, 180, 33)},
            {"max_candidates": 1},
            {"max_candidates": 5, "electrons_per_dn": 30.0, "read_noise": 1.0},
            {"saturation": 100.0, "speckle_contrast": 0.7, "speckle_grain": 3.0},
        ]
    ),
    masked=st.booleans(),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_runs_tell_what_the_whole_picture_tells(
    seed, strategy, choice, kind, orientation, colour, deep, margin, extra, masked
):
    rng = np.random.default_rng(seed)
    dtype, channels = (np.uint16, 1) if deep else (np.uint8, 3 if colour else 1)
    weights = (-0.3, 1.0, -0.1) if channels == 3 else None
    level = 0.05 * np.iinfo(dtype).max
    plan = ScanPlan(
        *(W, H, np.dtype(dtype).name, channels, ("L",), 3, rng.uniform(0.2, 1) * level),
        margin=margin, orientation=orientation, weights=weights,
    )  # fmt: skip
    inside = mask = None
    if masked:
        v, u = np.mgrid[:H, :W]
        inside = np.hypot((u - rng.uniform(0, W)) / 3, v - rng.uniform(0, H)) < rng.uniform(5, 50)
        inside &= (u // 40 % 4 != 1) | (v > 10)
        mask = inside | np.roll(inside, 9, 1) | np.roll(inside, -9, 1)
    look = replace(
        StripeSettings(strategy=strategy, choose=choice, orientation=orientation, mask=mask),
        **extra,
    )
    frames = [(*a_scene(rng, dtype, channels, kind), kind) for _ in range(2)]
    if kind == "background":
        frames = [(lit, frames[0][1], kind) for lit, _, _ in frames]
    for whole, found in both_ways(plan, frames, look, inside):
        if found is None:  # what is not kept lies above a threshold that was given, or the room
            assert "threshold" in extra or kind == "background"  # became brighter after it
            continue
        for name in FIELDS:
            assert getattr(found, name).tobytes() == getattr(whole, name).tobytes(), name


def test_the_usual_frame_is_told_by_its_runs():
    rng = np.random.default_rng(3)
    for kind, channels in itertools.product(("own", "background", "none"), (1, 3)):
        weights = (-0.3, 1.0, -0.1) if channels == 3 else None
        plan = ScanPlan(W, H, "uint8", channels, ("L",), 3, 8.0, weights=weights)
        lit, dark = a_scene(rng, np.uint8, channels, kind)
        frames = [(lit, dark, kind), (np.roll(lit, 3, axis=1), dark, kind)]
        for whole, found in both_ways(plan, frames, StripeSettings(), None):
            assert found is not None
            assert whole.found.sum() > 10
            assert found.position.tobytes() == whole.position.tobytes()


def some_runs(**other):
    number = np.array([0, 2, *[0] * (H - 2)])
    have = {
        "counts": number,
        "starts": np.array([20, 60]),
        "lengths": np.array([30, 30]),
        "lit": np.full(60, 90, np.uint8),
        "dark": None,
        "ground": 5,
        "dark_ground": 0,
        "background": None,
    }
    return Runs(**{**have, **other})


def test_what_runs_cannot_tell_is_left_to_the_whole_picture():
    detector = RunDetector(Signal(None), StripeSettings(), (H, W))
    assert detector.stripe(some_runs(), 5.0, 1.0) is not None
    assert detector.stripe(some_runs(), 5.0, float("nan")) is None, "noise unknown"
    assert detector.stripe(some_runs(ground=60), 5.0, 1.0) is None, "light is not kept"
    late_first = some_runs(starts=np.array([60, 20]))
    assert detector.stripe(late_first, 5.0, 1.0) is None, "out of order"
    with pytest.raises(InputError, match="mask"):
        RunDetector(Signal(None), StripeSettings(mask=np.ones((2, 2), bool)), (H, W))

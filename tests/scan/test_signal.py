"""What is kept of pictures is decided alike, however it is computed."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from turnscan.scan import _signal, signal_of, statistics


@pytest.fixture(autouse=True, scope="module")
def few_lines_at_a_time():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_signal, "_IN_CACHE", 100)
        yield


@given(
    seed=st.integers(0, 2**32 - 1),
    dtype=st.sampled_from(["uint8", "uint16"]),
    shape=st.tuples(st.integers(1, 30), st.integers(1, 40)),
    weights=st.sampled_from([None, (1.0, -0.5, 0.0)]),
    dark=st.booleans(),
    threshold=st.floats(-20.0, 300.0) | st.integers(-3, 300).map(float) | st.just(1e6),
)
def test_pixels_above_the_threshold_are_those_of_the_signal(
    seed, dtype, shape, weights, dark, threshold
):
    rng = np.random.default_rng(seed)
    size = shape if weights is None else (*shape, 3)
    # Few levels, so that many pixels are at the threshold, some at either end of the scale.
    top = np.iinfo(dtype).max
    lit, off = np.clip(rng.integers(-5, 300, (2, *size)), 0, top).astype(dtype)
    lit[rng.random(size) < 0.1] = top
    shade = off if dark else None
    wanted = signal_of(lit, shade, weights) > threshold
    assert np.array_equal(_signal.above(lit, shade, weights, threshold), wanted)


@pytest.mark.parametrize("weights", [None, (0.2, 0.5, 0.3)])
@pytest.mark.parametrize("dark", [False, True])
def test_a_sample_of_pictures_says_what_all_of_them_say(weights, dark):
    rng = np.random.default_rng(1)
    size = (411, 530) if weights is None else (411, 530, 3)
    lit, off = rng.integers(0, 255, (2, *size)).astype(np.uint8)
    shade = off if dark else None
    whole = statistics(signal_of(lit, shade, weights))
    assert statistics(_signal.sampled_signal(lit, shade, weights)) == whole

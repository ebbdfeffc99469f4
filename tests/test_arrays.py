"""Arrays of frozen dataclasses: checked once, then handed on."""

from __future__ import annotations

import gc
from dataclasses import dataclass, replace

import numpy as np
import pytest

from turnscan.arrays import Floats, _checked, frozen, handed_over


@dataclass(frozen=True, eq=False)
class Held:
    """A value with a large array."""

    x: Floats
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", frozen(self.x, (None, 3), "x"))


def test_what_was_checked_once_is_handed_on() -> None:
    given = np.zeros((1000, 3))
    first = Held(given)
    given[0] = np.nan  # the caller's own array stays the caller's
    second = replace(first, name="other")
    assert second.x is first.x
    assert not first.x.flags.writeable
    assert np.isfinite(second.x).all()


def test_what_was_not_checked_is() -> None:
    there = frozen(np.zeros((1000, 3)), (None, 3), "x")
    with pytest.raises(ValueError, match="shape"):
        frozen(there, (None, 2), "x")
    missing = np.zeros((1000, 3))
    missing[7, 1] = np.nan
    with_nan = frozen(missing, (None, 3), "x", nan=True)
    assert frozen(with_nan, (None, 3), "x", nan=True) is with_nan
    with pytest.raises(ValueError, match=r"x\[7, 1\]"):
        frozen(with_nan, (None, 3), "x")
    assert frozen(there, (None, 3), "x", nan=True) is there
    stranger = missing.copy()
    stranger.flags.writeable = False
    with pytest.raises(ValueError, match=r"x\[7, 1\]"):
        frozen(stranger, (None, 3), "x")
    assert frozen(there, (None, 3), "x", np.float32).dtype == np.float32
    assert frozen(there[10:], (None, 3), "x").base is None


def test_nothing_is_kept_alive() -> None:
    held = Held(np.zeros((1000, 3)))
    before = len(_checked[False])
    del held
    gc.collect()
    assert len(_checked[False]) < before


def test_what_is_handed_over_is_not_copied() -> None:
    given = np.zeros((1000, 3))
    given[7, 1] = np.nan
    with pytest.raises(ValueError, match=r"array\[7, 1\]"):
        handed_over(given)
    mine = handed_over(given, nan=True)
    assert mine is given
    assert not given.flags.writeable
    assert frozen(mine, (None, 3), "x", nan=True) is mine
    with pytest.raises(ValueError, match=r"x\[7, 1\]"):
        frozen(mine, (None, 3), "x")
    whole = np.zeros((1000, 3))
    part = handed_over(whole[10:])  # another one may write to what it is a part of
    whole[:] = 1.0
    assert not part.any()
    assert whole.flags.writeable

"""A part that is alike from several sides was laid down in one of several ways: which is asked."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from turnscan.calibrate import Measured, RefineSettings
from turnscan.errors import Degenerate, InputError
from turnscan.progress import no_progress
from turnscan.rig import Pose
from turnscan.workflows._calibration import _refine

WAYS = [(Pose(translation=np.array([float(k), 0.0, 0.0])),) for k in range(3)]


def outcome(gap: float, wave: float) -> Any:
    return SimpleNamespace(gap_after=gap, gap_noise=1.0,
                           estimated={"motion.sin1": Measured(wave, 0.01)})  # fmt: skip


def refined(
    monkeypatch: pytest.MonkeyPatch, by_way: Sequence[Any], ways: Sequence[Any] = WAYS
) -> tuple[Any, list[int]]:
    """What comes out where each way gives this outcome, and the ways as they were tried."""
    asked = list[int]()

    def adjust(rig: Any, sweeps: Any, settings: RefineSettings, *_: Any) -> Any:
        k = int(settings.poses[0].translation[0])
        asked.append(k)
        if by_way[k] is None:
            raise Degenerate("no two surfaces overlap")
        return by_way[k]

    monkeypatch.setattr(_refine, "adjust_rig", adjust)
    done = _refine._adjusted(None, [], RefineSettings(), ways, no_progress)  # type: ignore[arg-type]
    return done, asked


def test_the_way_whose_surfaces_agree_best_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    best = outcome(1.0, 0.5)
    done, asked = refined(monkeypatch, [outcome(3.0, 0.1), best, None])
    assert done is best
    assert asked == [0, 1, 2, 1]
    # One way is not asked twice.
    assert refined(monkeypatch, [best], WAYS[:1])[1] == [0]


def test_ways_that_say_the_same_are_as_good_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    by_way = [outcome(1.05, 0.52), outcome(1.0, 0.5), outcome(1.1, 0.49)]
    assert refined(monkeypatch, by_way)[0] is by_way[1]


def test_ways_that_say_otherwise_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="several ways, and they say that the rig is a different"):
        refined(monkeypatch, [outcome(1.05, 0.9), outcome(1.0, 0.5), None])


def test_where_no_way_leads_to_a_rig_the_first_reason_is_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(Degenerate, match="no two surfaces"):
        refined(monkeypatch, [None, None, None])

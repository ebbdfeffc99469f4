"""Grid edits: what was seen in a profile, changed by hand before it becomes a surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from turnscan.edit import (
    CloseSeam,
    DeletePoints,
    Edit,
    Entry,
    PickCandidate,
    ProfileOff,
    Redetect,
    SetPoint,
    lost_edits,
    repair_grid,
    repair_stripes,
)
from turnscan.edit._grid import HAND_SIGMA
from turnscan.points import RangeGrid
from turnscan.progress import Progress
from turnscan.stripes import Candidates, Stripe, StripeFlag, Stripes

LINES = 12
SLANT = 2.0
"""px a line by which the ghost leans: from end to end, further than a candidate is sought."""


def stripe(at: float) -> Stripe:
    n = np.full(LINES, 1.0)
    position = at + 0.1 * np.arange(LINES)
    position[4] = np.nan
    flags = np.zeros(LINES, np.uint16)
    flags[4] = StripeFlag.DARK
    some = np.where(np.isnan(position), np.nan, 1.0)
    return Stripe(position, 0.05 * some, 80 * some, 1.5 * some * n, flags)


@dataclass
class Frames:
    """Frames in which a ghost stands 30 px beside the stripe; what was asked is kept."""

    asked: list[object] = field(default_factory=list)

    def candidates(self, step: int) -> Candidates:
        self.asked.append(step)
        true = stripe(100.0 + step).position
        position = np.stack([true, true + 30.0 + SLANT * np.arange(LINES)], axis=-1)
        position[7, 1] = np.nan
        one = np.where(np.isnan(position), np.nan, 1.0)
        flags = np.full((LINES, 2), StripeFlag.MULTI, np.uint16)
        return Candidates(position, 0.2 * one, 50 * one, 2 * one, flags)

    def again(self, step: int, edit: Redetect) -> Stripe:
        self.asked.append((step, edit.threshold))
        return stripe(500.0 + step)


SEEN = Stripes("left", (0, 2, 3), np.array([0.0, 0.2, 0.3]), tuple(map(stripe, (100, 102, 103))))


def repaired(*edits: Edit) -> tuple[dict[int, Stripe], list[str], Frames]:
    frames = Frames()
    entries = [Entry(k, e) for k, e in enumerate(edits, start=1)]
    done, findings = repair_stripes(SEEN, entries, frames)
    assert done.laser == "left"
    return dict(zip(done.steps, done.stripes, strict=True)), [f.where for f in findings], frames


def test_points_go_move_and_come() -> None:
    done, nothing, _ = repaired(
        DeletePoints("left", 2, (0, 3, 4, 99)),
        SetPoint("left", 2, 4, 77.25),
        SetPoint("left", 3, 1, 78.0),
    )
    assert nothing == []
    assert np.isnan(done[2].position[[0, 3]]).all()
    assert done[2].flags[[0, 3]].tolist() == [StripeFlag.HAND] * 2
    assert done[2].position[4] == 77.25
    assert done[2].sigma[4] == HAND_SIGMA
    assert done[2].amplitude[4] == 80.0
    assert done[3].position[1] == 78.0
    untouched = [k for k in range(LINES) if k not in (0, 3, 4)]
    assert np.array_equal(done[2].position[untouched], SEEN.stripes[1].position[untouched])
    assert done[0] is SEEN.stripes[0]


def test_each_profile_that_is_sought_again_is_told_of() -> None:
    shares, frames = list[float](), Frames()
    again = Redetect("left", (0, 3), (0, LINES), threshold=9.0)
    entries = [Entry(1, ProfileOff("left", (9, 9))), Entry(2, again)]

    def hear(share: float, _: str) -> None:
        shares.append(share)
        if len(frames.asked) == 2:
            raise TimeoutError  # what hears of it may end it

    with pytest.raises(TimeoutError):
        repair_stripes(SEEN, entries, frames, Progress(hear))
    assert shares == pytest.approx([0, 0.5, 0.5, 4 / 6, 5 / 6])
    assert frames.asked == [(0, 9.0), (2, 9.0)]


def test_the_order_of_edits_counts() -> None:
    first, second = SetPoint("left", 0, 5, 60.0), DeletePoints("left", 0, (5,))
    assert np.isnan(repaired(first, second)[0][0].position[5])
    assert repaired(second, first)[0][0].position[5] == 60.0


def test_another_candidate_is_followed_along_the_stripe() -> None:
    done, nothing, frames = repaired(PickCandidate("left", 2, (2, 9), 135.0))
    assert (nothing, frames.asked) == ([], [2])
    true = SEEN.stripes[1].position
    picked = [2, 3, 5, 6, 8, 9]
    assert np.allclose(done[2].position[picked], true[picked] + 30.0 + SLANT * np.array(picked))
    assert done[2].sigma[2] == 0.2
    assert done[2].flags[2] == StripeFlag.MULTI | StripeFlag.HAND
    # Line 4 shows nothing, line 7 has no ghost within reach: they stay as they were.
    assert np.isnan(done[2].position[4])
    for line in (0, 1, 7, 10, 11):
        assert done[2].position[line] == true[line]


def test_profiles_are_left_out_and_parts_sought_again() -> None:
    done, nothing, frames = repaired(
        Redetect("left", (1, 3), (8, 40), threshold=5.0), ProfileOff("left", (3, 9))
    )
    assert nothing == []
    assert frames.asked == [(2, 5.0), (3, 5.0)]
    assert sorted(done) == [0, 2]
    assert np.array_equal(done[2].position[8:], stripe(502.0).position[8:])
    assert np.array_equal(done[2].position[:4], SEEN.stripes[1].position[:4])


@pytest.mark.parametrize(
    "edit",
    [
        DeletePoints("left", 1, (3,)),
        DeletePoints("left", 2, (4,)),
        SetPoint("left", 2, LINES, 5.0),
        PickCandidate("left", 2, (0, 3), 900.0),
        ProfileOff("left", (4, 9)),
        Redetect("left", (0, 3), (LINES, 50)),
    ],
)
def test_an_edit_of_what_is_not_there_is_named_and_changes_nothing(edit: Edit) -> None:
    done, nothing, _ = repaired(edit)
    assert nothing == [f"edit 1 ({edit.kind})"]
    for step, was in zip(SEEN.steps, SEEN.stripes, strict=True):
        assert np.array_equal(done[step].position, was.position, equal_nan=True)


def test_edits_of_other_lasers_are_not_this_ones() -> None:
    done, nothing, _ = repaired(ProfileOff("right", (0, 9)))
    assert (sorted(done), nothing) == ([0, 2, 3], [])
    entries = [Entry(1, ProfileOff("right", (0, 9))), Entry(2, ProfileOff("left", (0, 0)))]
    assert [f.where for f in lost_edits(entries, ["left"])] == ["edit 1 (profile_off)"]


def test_the_seam_is_closed_where_it_is_wanted() -> None:
    nan = np.full((4, 2), np.nan)
    grid = RangeGrid(
        "left", np.arange(4), np.arange(4.0), np.full((4, 2, 3), np.nan), nan, nan,
        np.zeros((4, 2), np.uint16), False,
    )  # fmt: skip
    asked = [Entry(1, CloseSeam("left"))]
    assert repair_grid(grid, asked).closed
    assert not repair_grid(grid, [Entry(1, CloseSeam("right"))]).closed
    short = replace(grid, steps=grid.steps[:2], angles=grid.angles[:2], points=grid.points[:2],
                    sigma=nan[:2], amplitude=nan[:2], flags=grid.flags[:2])  # fmt: skip
    assert not repair_grid(short, asked).closed


def test_a_picked_candidate_scatters_like_the_stripe_it_is_put_into():
    rough = replace(SEEN.stripes[0], scatter=0.01)
    seen = replace(SEEN, stripes=(rough, *SEEN.stripes[1:]))
    pick = Entry(1, PickCandidate("left", 0, (2, 3), 130.0 + 2 * SLANT))
    done = repair_stripes(seen, [pick], Frames())[0].stripes[0]
    assert done.sigma[2] == pytest.approx(np.hypot(0.2, np.sqrt(0.01 * 2)))
    assert done.scatter == 0.01

"""Progress: fractions of parts of parts, counted from any thread, cancelled at a report."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from turnscan.progress import Cancelled, Progress, no_progress

Reports = list[tuple[float, str]]


def listening() -> tuple[Reports, Progress]:
    reports: Reports = []
    return reports, Progress(lambda fraction, text: reports.append((fraction, text)))


def test_a_part_of_a_part_reports_its_share_of_the_whole() -> None:
    reports, progress = listening()
    half = progress.subrange(0.5, 1.0, "half")
    half.subrange(0.0, 0.5)(1.0)
    half.subrange(0.5, 1.0, "last")(0.5, "now")
    assert reports == [(0.75, "half"), (0.875, "now")]


def test_fractions_stay_within_the_part() -> None:
    reports, progress = listening()
    for fraction in (-1.0, 1.0 + 1e-9):
        progress.subrange(0.25, 0.5)(fraction)
    assert reports == [(0.25, ""), (0.5, "")]


def test_items_are_tracked_and_none_is_no_trouble() -> None:
    reports, progress = listening()
    assert list(progress.track("ab", "letters")) == ["a", "b"]
    assert reports == [(0.0, "letters"), (0.5, "letters"), (1.0, "letters")]
    assert list(no_progress.track(())) == []


def test_steps_of_several_threads_are_all_counted_in_order() -> None:
    reports, progress = listening()
    count = progress.counter(200)
    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(count) for _ in range(200)]:
            done.result()
    assert [fraction for fraction, _ in reports] == [(k + 1) / 200 for k in range(200)]


def test_cancelled_work_ends_at_its_next_report_and_reports_no_more() -> None:
    reports: Reports = []
    wanted = [True]
    progress = Progress(lambda f, t: reports.append((f, t)), lambda: not wanted[0])
    items = progress.subrange(0, 0.5).track(range(4))
    assert [next(items), next(items)] == [0, 1]
    wanted[0] = False
    with pytest.raises(Cancelled):
        next(items)
    assert reports == [(0.0, ""), (0.125, "")]

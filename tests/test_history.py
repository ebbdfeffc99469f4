"""The history of speed names what became slower than its noise, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest
from bench import history
from bench.history import Kept, changes

STEADY = [1.0, 1.01, 0.99, 1.005, 0.995]
NOISY = [1.0, 1.5, 0.7, 1.3, 0.8]


def kept(commit: str, taken: str, **ratios: list[float]) -> Kept:
    return Kept(commit, history.machine(), taken, ratios)


def times(factor: float, ratios: list[float]) -> list[float]:
    return [factor * r for r in ratios]


def test_only_what_exceeds_its_noise_is_named() -> None:
    old = kept("a", "1", worse=STEADY, better=STEADY, same=STEADY, noisy=NOISY, gone=STEADY)
    new = kept(
        "b", "2", worse=times(1.2, STEADY), better=times(0.5, STEADY), same=times(1.02, STEADY),
        noisy=times(1.2, NOISY), come=STEADY,
    )  # fmt: skip
    found = {change.case: change for change in changes(old, new)}
    assert next(iter(found)) in ("noisy", "worse")
    assert {case: change.word for case, change in found.items()} == {
        "worse": "slower", "better": "faster", "same": "", "noisy": "",
    }  # fmt: skip
    assert found["worse"].factor == pytest.approx(1.2)


def test_two_commits_are_compared_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(history, "PLACE", tmp_path / "build" / "bench")
    history.keep(kept("abc", "2026-01-02", mesh=STEADY))
    history.keep(kept("def", "2026-01-01", mesh=times(2.0, STEADY)))
    history.run(parts=["def"])
    assert "mesh                          0.500 × the time" in capsys.readouterr().out
    history.run(parts=["abc", "def"])
    assert capsys.readouterr().out.splitlines()[1].endswith("slower")
    with pytest.raises(SystemExit, match=r"no figures of 123 .* there are def, abc"):
        history.run(parts=["123"])


def test_figures_are_multiples_of_the_yardstick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "_cases", lambda folder, stack: {"same": history.yardstick})
    monkeypatch.setattr(history, "_timed", lambda job: 2.0)
    assert history.measure(3) == {"same": [1.0, 1.0, 1.0]}


def test_more_than_two_commits_are_not_compared() -> None:
    with pytest.raises(SystemExit, match="3 commits"):
        history.run(parts=("one", "two", "three"))

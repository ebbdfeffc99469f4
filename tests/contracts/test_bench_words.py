"""``python -m bench``: which benchmarks are named, and what is handed on to each."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from bench.__main__ import asked_for

ROOT = Path(__file__).parents[2]
NAMES = [p.stem for p in (ROOT / "bench").glob("*.py") if not p.stem.startswith("_")]


def test_make_bench_runs_each_of_its_speeds() -> None:
    line = re.search(r"^SPEEDS := (.+)$", (ROOT / "Makefile").read_text(), re.M)
    assert line is not None
    words = line[1].split()
    assert "history" in words
    assert asked_for(words, NAMES) == {word: [] for word in words}


def test_words_go_to_the_benchmark_before_them() -> None:
    asked = asked_for(["history", "0123abc", "4567def", "batch", "many"], NAMES)
    assert asked == {"history": ["0123abc", "4567def"], "batch": ["many"]}
    with pytest.raises(ValueError, match="no benchmark nothing"):
        asked_for(["batch", "many", "nothing"], NAMES)

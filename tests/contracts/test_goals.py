"""docs/explain/goals.md names every promise of the first order and tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explain" / "goals.md"
FIRST = {
    "C1", "C2", "C3", "C5", "C7", "C8", "C13", "D1", "D2", "D3", "D4", "D5", "D8", "D10",
    "S1", "S2", "S3", "S4", "S5", "S7", "S8", "S12", "S13",
}  # fmt: skip


def test_every_promise_has_a_row_and_every_test_exists() -> None:
    page = PAGE.read_text()
    rows = {row[0]: row for row in re.findall(r"^\| ([CDS]\d+) \|(.*)\|(.*)\|(.*)\|$", page, re.M)}
    assert set(rows) == FIRST
    sources = "\n".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    for goal, _, test, mutant in rows.values():
        assert test.strip(), goal
        assert mutant.strip() or goal == "S13"
        for name in re.findall(r"(?<!/)\b(test_\w+)\b(?!\.py)", test + mutant):
            assert f"def {name}(" in sources, name
        for path in re.findall(r"[\w/]+\.py", test + mutant):
            found = list((ROOT / "tests").rglob(Path(path).name))
            assert found, path

"""Figures in the documents, written by the command that measures them.

A page marks their place with two comments, ``<!-- figures: NAME -->`` and ``<!-- end -->``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
ACCURACY = DOCS / "explain" / "accuracy.md"


def _place(name: str) -> re.Pattern[str]:
    return re.compile(rf"(<!-- figures: {re.escape(name)} -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def figures(page: Path, name: str) -> list[str]:
    """The lines that stand on a page now. Raises ValueError where it has no such place."""
    found = _place(name).search(page.read_text())
    if found is None:
        raise ValueError(f"{page}: no figures: {name}")
    return [line for line in found[2].splitlines() if line]


def write(page: Path, name: str, lines: Sequence[str]) -> None:
    """Put these lines in their place. Raises ValueError where the page has none."""
    figures(page, name)
    text = "\n".join(lines)
    page.write_text(_place(name).sub(lambda m: f"{m[1]}\n{text}\n\n{m[3]}", page.read_text()))

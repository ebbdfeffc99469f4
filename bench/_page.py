"""Figures in the documents, written by the command that measures them.

A page marks their place with two comments, ``<!-- figures: NAME -->`` and ``<!-- end -->``. A table
whose rows are measured one part at a time says in its last column of which commit each row is, so
that rows of different age may stand together (`measured`, `replaced`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from bench._commit import commit_of_code

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


MEASURED = "measured"
"""The head of the column that says with what and at which commit a row was measured."""
UNKNOWN = "not recorded"


def measured(lines: Sequence[str], how: str) -> list[str]:
    """Rows of a table with one more cell: how they were measured, and at which commit."""
    return [f"{line} {how}, {commit_of_code()} |" for line in lines]


def cells(row: str) -> list[str]:
    """What stands in a row of a table."""
    return [cell.strip() for cell in row.strip().strip("|").split("|")]


def replaced(old: Sequence[str], new: Sequence[str], keys: int, order: Sequence[str]) -> list[str]:
    """The table ``new`` with the rows of ``old`` that it does not measure again.

    The first ``keys`` cells of a row say what it is of; ``order`` holds the first cells in the
    order of the table, and numbers among the others ascend. What is measured again keeps its place.
    The first two lines of ``new`` are its head; lines that are no rows are not kept. Old rows that
    have too few cells for the head were measured nobody knows when.
    """
    head, fresh = list(new[:2]), dict[tuple[str, ...], list[str]]()
    for row in (line for line in new[2:] if line.startswith("|")):
        fresh.setdefault(tuple(cells(row)[:keys]), []).append(row)
    width, rows, again = len(cells(head[0])), list[str](), dict(fresh)
    for row in [line for line in old if line.startswith("|")][2:]:
        have = cells(row)
        if (of := tuple(have[:keys])) in fresh:
            rows += again.pop(of, [])
            continue
        have += [""] * (width - 1 - len(have)) + [UNKNOWN] * (len(have) < width)
        rows.append("| " + " | ".join(have) + " |")
    rows += [row for some in again.values() for row in some]
    place = {name: k for k, name in enumerate(order)}

    def before(row: str) -> tuple[int, list[float]]:
        first, *others = cells(row)[:keys]
        return place.get(first, len(place)), [float(c) for c in others if c.isdecimal()]

    return [*head, *sorted(rows, key=before)]


def put(page: Path, name: str, new: Sequence[str], keys: int, order: Sequence[str]) -> None:
    """Put the rows of a table ``new`` on a page, those that stand there and are not among them
    kept, as `replaced` does. A command that ends early has then written what it measured."""
    write(page, name, replaced(figures(page, name), new, keys, order))


def write(page: Path, name: str, lines: Sequence[str]) -> None:
    """Put these lines in their place. Raises ValueError where the page has none."""
    figures(page, name)
    text = "\n".join(lines)
    page.write_text(_place(name).sub(lambda m: f"{m[1]}\n{text}\n\n{m[3]}", page.read_text()))

"""Figures in the documents: a command that measures some parts of a table keeps the others."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from bench import _page, foreign, shapes, solids, truth
from bench._commit import commit_of_code

PAGE = """# Page

<!-- figures: table -->

| part | size | true | {head}
|---|---|---|{line}
| hexagon | flats | 40 |{more}
| hexagon | boss | 24 |{more}
| gear | hub | 24 |{more}

It was measured.

<!-- end -->

The rest.
"""
NEW = ["| part | size | true | measured |", "|---|---|---|---|"]


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "page.md"
    path.write_text(PAGE.format(head="measured |", line="---|", more=" 9 steps, abc |"))
    return path


def test_parts_that_are_measured_again_replace_their_rows_alone(page: Path) -> None:
    new = [*NEW, *_page.measured(["| shaft | low | 50 |", "| hexagon | flats | 40 |"], "5 steps")]
    order = ("hexagon", "shaft", "gear")
    table = _page.replaced(_page.figures(page, "table"), new, 1, order)
    _page.write(page, "table", table)
    rows = [_page.cells(row) for row in _page.figures(page, "table")[2:]]
    assert [row[:2] for row in rows] == [["hexagon", "flats"], ["shaft", "low"], ["gear", "hub"]]
    now = _page.measured([""], "5 steps")[0].strip(" |")
    assert [row[3] for row in rows] == [now, now, "9 steps, abc"]
    assert page.read_text().startswith("# Page\n")
    assert page.read_text().endswith("<!-- end -->\n\nThe rest.\n")


def test_rows_of_a_scan_are_told_by_two_cells(page: Path) -> None:
    new = [*NEW, "| hexagon | boss | 25 | now |"]
    table = _page.replaced(_page.figures(page, "table"), new, 2, ())
    assert [_page.cells(row)[1:] for row in table[2:]] == [
        ["flats", "40", "9 steps, abc"],
        ["boss", "25", "now"],
        ["hub", "24", "9 steps, abc"],
    ]


def test_rows_that_are_put_one_by_one_stand_in_their_order_and_keep_the_others(page: Path) -> None:
    for row in ("| gear | hub | 24 | 1 |", "| shaft | 60 | 3 | 1 |", "| shaft | 24 | 2 | 1 |"):
        _page.put(page, "table", [*NEW, row], 2, ("shaft", "hexagon", "gear"))
    table = [_page.cells(row) for row in _page.figures(page, "table")]
    assert [row[:2] + row[3:] for row in table] == [
        ["part", "size", "measured"], ["---", "---", "---"],
        ["shaft", "24", "1"], ["shaft", "60", "1"],
        ["hexagon", "flats", "9 steps, abc"], ["hexagon", "boss", "9 steps, abc"],
        ["gear", "hub", "1"],
    ]  # fmt: skip


def test_the_tables_of_truth_and_foreign_shapes_are_written_row_by_row(
    page: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command that breaks off has written what it measured, and kept what it did not."""
    monkeypatch.setattr(_page, "ACCURACY", page)

    class Measured:
        def __init__(self, *cells: str) -> None:
            self.line = lambda: f"| {' | '.join(cells)} |"

    def broken_off(*_: object) -> Iterator[Measured]:
        yield Measured(*last.pop())
        raise KeyboardInterrupt

    for bench, name, head, rows in (
        (
            truth,
            "truth",
            truth.HEAD,
            [["gear, paper", "1", "60", "paste"], ["mug, paper", "1", "60", "grid"]],
        ),
        (foreign, "foreign", foreign.HEAD, [["b, paper", "60"], ["a, paper", "60"]]),
    ):
        width = len(_page.cells(head[0]))
        blank = [[*row, *["0"] * (width - 1 - len(row))] for row in rows]
        page.write_text(f"<!-- figures: {name} -->\n<!-- end -->\n")
        last = list(blank)
        monkeypatch.setattr(bench, "rows", broken_off)
        for _ in rows:
            with pytest.raises(KeyboardInterrupt):
                bench.run(into_pages=True)
        written = [_page.cells(line) for line in _page.figures(page, name)[2:]]
        assert sorted(row[:-1] for row in written) == sorted(blank)
        assert all("rig known" in row[-1] for row in written)


def test_rows_from_before_the_column_are_of_nobody_knows_when(page: Path) -> None:
    page.write_text(PAGE.format(head="", line="", more=""))
    new = [*NEW, "| shaft | low | 50 | now |"]
    table = _page.replaced(_page.figures(page, "table"), new, 1, ("gear", "shaft"))
    assert [_page.cells(row)[3] for row in table[2:]] == [
        _page.UNKNOWN, "now", _page.UNKNOWN, _page.UNKNOWN
    ]  # fmt: skip


def test_the_tables_of_shapes_and_solids_keep_their_rows(
    page: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shapes, "PAGE", page)
    row = "| shaft | low ⌀ | 50 | 50.0038 | 0.0082 | +3.8 | 0.23 |"
    shapes.into_page(
        "table", "paper", [*shapes.HEAD, *_page.measured([row], shapes.Task("shaft").how)]
    )
    rows = [_page.cells(line) for line in _page.figures(page, "table")]
    assert [r[0] for r in rows[2:]] == ["hexagon", "hexagon", "shaft", "gear"]
    assert {len(r) for r in rows} == {len(_page.cells(shapes.HEAD[0]))}
    assert rows[4][-1].startswith("200 steps, ")


def test_what_is_said_of_solids_counts_all_rows_of_the_table() -> None:
    made = solids.Row(solids.CASES[0], True, 1, True, "9, 0, 0", 0.0, 0.001, 1.5, 0.01, 3.0)
    nan = float("nan")
    shell = solids.Row(solids.CASES[1], False, 0, True, "5, 1, 2", nan, nan, nan, 0.01, 3.0)
    rough = solids.Row(solids.CASES[2], True, 1, True, "9, 0, 0", 0.0, 0.01, -2.5, 0.01, 3.0)
    lines = [made.line(), shell.line(), rough.line()]
    assert {len(_page.cells(line)) for line in lines} == {len(_page.cells(solids.HEAD[0]))}
    assert solids.summary(lines) == (
        "Of 3 scans 2 had a closed mesh. 2 became valid solids, 1 valid shells, 0 triangles alone. "
        "1 of 2 volumes are right within 2 u."
    )


def test_figures_are_of_the_last_commit_of_code_not_of_one_that_wrote_them_down() -> None:
    root = Path(_page.__file__).parents[1]
    git = ["git", "-C", str(root), "diff", "--quiet", commit_of_code().rstrip("+"), "HEAD"]
    assert subprocess.run([*git, "--", "src", "bench"], check=False).returncode == 0

"""Verbs are functions in `workflows`; doors declare, call one and print."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "src" / "turnscan"

THIN = (
    "_artefact", "_calibrate", "_check", "_compare", "_design", "_export", "_import", "_join",
    "_measure", "_reconstruct", "_section", "_simulate", "_verify",
)  # fmt: skip
"""Modules of the command line whose verbs are in `workflows`."""
HELPERS = (
    "_degrees", "_flags", "_numbers", "_output", "_own_settings", "_progress", "_show",
    "_verify_report", "_words",
)  # fmt: skip
"""Modules of the command line that declare flags, show progress and word results."""
LOWEST = ("errors", "findings", "progress", "remedy", "workflows")
DOORS = ("__main__.py", "app", "cli")
LONGEST = 100
FLAG = re.compile(r"(?<!var\()--[a-z][a-z-]*\b(?!: *#)")
"""Not the colours that a style sheet names."""

NOT_YET_CLEAN = {
    "acquire/_angle.py", "acquire/_watch.py", "devices/_picamera2.py", "devices/_registry.py",
    "devices/_sentences.py", "points/_build.py", "points/_findings.py", "poses/_align.py",
    "poses/_place.py", "scan/_edit_log.py", "scan/_fit.py", "scanner/_wishes.py",
    "surface/clean/_clean.py", "surface/decimation/_decimate.py", "surface/_findings.py",
    "surface/fusion/_merge.py", "surface/fusion/_range_surface.py", "surface/fusion/_tsdf.py",
}  # fmt: skip
"""Modules below the doors whose texts still name flags. Clean one, and take it from the list."""


def _below_the_doors() -> list[str]:
    paths = (p.relative_to(SOURCES) for p in SOURCES.rglob("*.py"))
    return sorted(p.as_posix() for p in paths if p.parts[0] not in DOORS)


def _flags_in(path: Path) -> list[str]:
    """Texts that name a flag, docstrings left out: nobody is shown those."""
    tree = ast.parse(path.read_text())
    shown_to_nobody = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if FLAG.search(node.value) and id(node) not in shown_to_nobody
    ]


@pytest.mark.parametrize("path", _below_the_doors())
def test_below_the_doors_no_text_names_a_flag(path: str) -> None:
    found = _flags_in(SOURCES / path)
    if path in NOT_YET_CLEAN:
        assert found, f"{path} is clean: take it from the list"
    else:
        assert not found


@pytest.mark.parametrize("verb", THIN)
def test_a_verb_of_the_command_line_declares_calls_and_prints(verb: str) -> None:
    path = SOURCES / "cli" / f"{verb}.py"
    text = path.read_text()
    assert len(text.splitlines()) <= LONGEST
    allowed = {f"turnscan.cli.{name}" for name in HELPERS} | {f"turnscan.{n}" for n in LOWEST}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("turnscan"):
            assert node.module in allowed, f"{path.name} imports {node.module}"
        if isinstance(node, ast.Import):
            assert not any(a.name.startswith("turnscan") for a in node.names)

"""Verbs are functions in `workflows`; doors declare, call one and print."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from tests.contracts.sources import SOURCES, modules, name, nodes, text
from turnscan.cli import _VERBS
from turnscan.points import Spacing
from turnscan.rig import PRESET_NAMES
from turnscan.scan import Keep
from turnscan.stripes import Choice, Orientation, Refinement, Strategy
from turnscan.surface.fusion import MergeMethod
from turnscan.surface.holes import FillHow
from turnscan.workflows._options import _choices

HELPERS = (
    "_calibrate_report", "_found",
    "_devices_in_use", "_flags", "_numbers", "_output", "_own_settings", "_progress", "_serving",
    "_show", "_signals", "_words",
)  # fmt: skip
"""Modules of the command line that declare flags, show progress and word results."""
LOWEST = ("errors", "findings", "memory", "progress", "remedy", "threads", "workflows")
DOORS = ("__main__.py", "app", "cli")
LONGEST = 100
FLAG = re.compile(r"(?<!var\()--[a-z][a-z-]*\b(?!: *#)")
"""Not the colours that a style sheet names."""


def _flags_in(path: Path) -> list[str]:
    """Texts that name a flag, docstrings left out: nobody is shown those."""
    shown_to_nobody = {id(n.value) for n in nodes(path) if isinstance(n, ast.Expr)}
    return [
        node.value
        for node in nodes(path)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if FLAG.search(node.value) and id(node) not in shown_to_nobody
    ]


def test_below_the_doors_no_text_names_a_flag() -> None:
    below = [p for p in modules() if p.relative_to(SOURCES).parts[0] not in DOORS]
    assert len(below) > 400
    assert {name(p): found for p in below if (found := _flags_in(p))} == {}
    assert any(_flags_in(p) for p in (SOURCES / "cli").glob("*.py")), "flags are seen"


@pytest.mark.parametrize("verb", sorted(_VERBS))
def test_a_verb_of_the_command_line_declares_calls_and_prints(verb: str) -> None:
    path = SOURCES / "cli" / f"_{verb}.py"
    assert len(text(path).splitlines()) <= LONGEST
    allowed = {f"turnscan.cli.{n}" for n in HELPERS} | {f"turnscan.{n}" for n in LOWEST}
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module == "turnscan":
            assert [a.name for a in node.names] == ["workflows"], path.name
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("turnscan"):
            assert node.module in allowed, f"{path.name} imports {node.module}"
        if isinstance(node, ast.Import):
            assert not any(a.name.startswith("turnscan") for a in node.names)


def test_help_of_a_verb_loads_no_room() -> None:
    """Whose loading would take a second before a line of help is read."""
    probe = (
        "import importlib, sys\n"
        f"for name in {sorted(_VERBS)!r}: importlib.import_module(f'turnscan.cli._{{name}}')\n"
        "print([m for m in sys.modules if m in ('numpy', 'scipy', 'cv2', 'numba', 'pydantic', "
        "'sqlite3', 'rich', 'matplotlib')])\n"
        "print(sorted({m.split('.')[1] for m in sys.modules if m.startswith('turnscan.')}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True
    )
    libraries, rooms = map(ast.literal_eval, done.stdout.splitlines())
    assert libraries == []
    assert set(rooms) <= {"cli", *LOWEST}


def test_words_that_options_choose_among_are_those_of_the_rooms() -> None:
    declared_in_rooms = {
        "STRATEGY": Strategy, "CHOICE": Choice, "REFINEMENT": Refinement, "SPACING": Spacing,
        "ORIENTATION": Orientation, "KEEP": Keep, "HOW": MergeMethod, "FILL_HOW": FillHow,
    }  # fmt: skip
    for choice, kind in declared_in_rooms.items():
        assert getattr(_choices, choice) == get_args(kind), choice
    assert _choices.PRESETS == PRESET_NAMES


@pytest.mark.parametrize("path", sorted((SOURCES / "app").rglob("*.py")), ids=name)
def test_the_browser_calls_workflows(path: Path) -> None:
    rooms = set[str]()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module == "turnscan":
            rooms |= {a.name for a in node.names} - {"__version__"}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("turnscan."):
            rooms.add((node.module or "").split(".")[1])
    below = rooms - {"app", "arrays", "json_text", "memory", *LOWEST}
    assert not below, "call a workflow"

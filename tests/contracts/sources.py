"""The sources, read and parsed once in a process: many promises are about all of them."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

TOP = Path(__file__).parents[2]
SOURCES = TOP / "src" / "turnscan"


@functools.cache
def modules() -> tuple[Path, ...]:
    """Every module of turnscan."""
    return tuple(sorted(SOURCES.rglob("*.py")))


@functools.cache
def text(path: Path) -> str:
    """What stands in a file."""
    return path.read_text()


@functools.cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Every node of a module's syntax tree."""
    return tuple(ast.walk(ast.parse(text(path))))


def name(path: Path) -> str:
    """A module's path inside turnscan."""
    return path.relative_to(SOURCES).as_posix()

"""Promises about the sources themselves, that no single room could test."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import pytest

import turnscan

TOP = Path(__file__).parents[2]
SOURCES = sorted((TOP / "src" / "turnscan").rglob("*.py"))
ROOMS = sorted(m.name for m in pkgutil.iter_modules(turnscan.__path__) if m.ispkg)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(p.parents[2])))
def test_nothing_from_a_file_is_ever_executed(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            assert name not in {"eval", "exec", "compile", "pickle.load", "pickle.loads"}, name
            assert not any(
                k.arg in {"shell", "allow_pickle"} and ast.unparse(k.value) == "True"
                for k in node.keywords
            ), ast.unparse(node)
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [a.name for a in node.names] + [getattr(node, "module", None) or ""]
            assert not {"pickle", "marshal", "shelve"} & {m.split(".")[0] for m in modules}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_hands_out_exactly_what_it_names(room: str) -> None:
    module = importlib.import_module(f"turnscan.{room}")
    for name in getattr(module, "__all__", ()):
        thing = getattr(module, name)
        if inspect.isfunction(thing) or inspect.isclass(thing):
            assert thing.__doc__, f"turnscan.{room}.{name} has no docstring"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(p.parents[2])))
def test_no_unfinished_marks_and_no_network(path: Path) -> None:
    text = path.read_text()
    assert not re.search(r"\b(TODO|FIXME|XXX|NotImplementedError)\b", text)
    own = "|{" if path.name == "_server.py" and path.parent.name == "app" else ""
    # The server prints its own address, put together from where it listens.
    names = r"www\.w3\.org|schemas\.(microsoft|openxmlformats)\.(com|org)|json-schema\.org"
    found = re.search(rf"\bhttps?://(?!{names}{own})", text)
    assert not found, "no address is reached at run time"

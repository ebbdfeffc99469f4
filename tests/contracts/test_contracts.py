"""Promises about the sources themselves, that no single room could test."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator

import pytest

import turnscan
from tests.contracts.sources import modules, name, nodes, text

ROOMS = sorted(m.name for m in pkgutil.iter_modules(turnscan.__path__) if m.ispkg)


def _executing(node: ast.AST) -> Iterator[str]:
    """What of a node executes, or reads in a way that may execute, what a file holds."""
    if isinstance(node, ast.Call):
        if isinstance(node.func, ast.Name | ast.Attribute):
            called = ast.unparse(node.func)
            if called in {"eval", "exec", "compile", "pickle.load", "pickle.loads"}:
                yield called
        for k in node.keywords:
            if k.arg in {"shell", "allow_pickle"} and ast.unparse(k.value) == "True":
                yield ast.unparse(node)
    if isinstance(node, ast.Import | ast.ImportFrom):
        imported = [a.name for a in node.names] + [getattr(node, "module", None) or ""]
        yield from {"pickle", "marshal", "shelve"} & {m.split(".")[0] for m in imported}


def test_nothing_from_a_file_is_ever_executed() -> None:
    assert len(modules()) > 500
    found = [(name(p), said) for p in modules() for node in nodes(p) for said in _executing(node)]
    assert not found


@pytest.mark.parametrize(
    "line",
    [
        "eval(x)", "pickle.loads(x)", "run(x, shell=True)", "load(x, allow_pickle=True)",
        "import shelve", "from pickle import load", "import marshal as m",
    ],
)  # fmt: skip
def test_what_executes_is_seen(line: str) -> None:
    assert [said for node in ast.walk(ast.parse(line)) for said in _executing(node)]


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_hands_out_exactly_what_it_names(room: str) -> None:
    module = importlib.import_module(f"turnscan.{room}")
    for named in getattr(module, "__all__", ()):
        thing = getattr(module, named)
        if inspect.isfunction(thing) or inspect.isclass(thing):
            assert thing.__doc__, f"turnscan.{room}.{named} has no docstring"


def test_no_unfinished_marks_and_no_network() -> None:
    for path in modules():
        marks = re.findall(r"\b(TODO|FIXME|XXX|NotImplementedError)\b", text(path))
        assert not marks, f"{name(path)}: {marks}"
        # The server prints its own address, put together from where it listens.
        own = "|{" if name(path) == "app/_server.py" else ""
        names = r"www\.w3\.org|schemas\.(microsoft|openxmlformats)\.(com|org)|json-schema\.org"
        found = re.findall(rf"\bhttps?://(?!{names}{own}).*", text(path))
        assert not found, f"{name(path)}: no address is reached at run time: {found}"

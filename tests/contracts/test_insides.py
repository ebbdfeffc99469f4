"""The insides of the rooms: few parameters, kernels that say their types, few public names."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.contracts.sources import SOURCES, modules, name, nodes, text

MOST_PARAMETERS = 10
MOST_NAMES = {
    "acquire": 35,
    "app": 4,
    "calibrate": 44,  # with a part as it is drawn, and a platter that has moved
    "devices": 25,
    "drawings": 20,  # with shells of faces, their triangles and colours
    "edit": 83,  # with names of edits, and edits of named sets of settings
    "formats": 18,  # with the texture beside an OBJ
    "mesh": 26,  # with samples of a surface, faces about vertices and areas, which other rooms had
    "points": 40,
    "poses": 17,  # with the ways in which a part that is alike from several sides fits
    "rig": 27,  # with how the axis moves in a turn
    "scan": 28,
    "scanner": 22,
    "shapes": 47,  # with all common causes at once, and the parts of a volume, which solids have
    "simulate": 40,
    "stripes": 28,
    "surface": 4,
    "testing": 6,
    "texture": 5,
    "workflows": 188,  # with a gallery, previews, live views, tables, surfaces and histories
}
"""Public names of each room at most. A room that needs more raises this and says why."""


def _parameters(f: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    a = f.args
    named = [*a.posonlyargs, *a.args]
    own = bool(named) and named[0].arg in ("self", "cls")
    return len(named) - own + len(a.kwonlyargs) + bool(a.vararg) + bool(a.kwarg)


def test_no_function_takes_more_than_ten_parameters() -> None:
    long = {
        f"{name(path)}:{node.name}": _parameters(node)
        for path in modules()
        for node in nodes(path)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and _parameters(node) > MOST_PARAMETERS
    }
    assert not long


def test_kernels_say_the_types_of_their_arrays() -> None:
    kernels = [path for path in modules() if "turnscan.compiled import njit" in text(path)]
    assert len(kernels) > 30
    vague = [
        f"{name(path)}:{node.lineno}"
        for path in kernels
        for node in nodes(path)
        if isinstance(node, ast.Name) and node.id == "Any"
    ]
    assert not vague


def _public(room: Path) -> int | None:
    """How many names its ``__all__``, or its stub, has; None where it has neither."""
    stub = room / "__init__.pyi"
    if stub.exists():
        tree = ast.walk(ast.parse(stub.read_text()))
        return sum(len(node.names) for node in tree if isinstance(node, ast.ImportFrom))
    for node in ast.parse((room / "__init__.py").read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return sum(isinstance(e, ast.Constant) for e in ast.walk(node.value))
    return None


def test_rooms_hand_out_few_names() -> None:
    counts = {p.parent.name: _public(p.parent) for p in SOURCES.glob("*/__init__.py")}
    assert {r: n for r, n in counts.items() if n is not None and n > MOST_NAMES.get(r, 0)} == {}
    assert set(MOST_NAMES) == {room for room, n in counts.items() if n is not None}

"""Faults that a source can have: each operator lists the places of a file where it fits.

Comparisons, arithmetic, constants, signs, factors and terms that are dropped, conditions negated.
Left alone is what says nothing to a test: docstrings, annotations, decorators, messages of errors,
and slices of axes.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate

from bench.mutants._mutant import Mutant

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_CALCULATED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.MatMult: ast.Mult,
    ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}  # fmt: skip
_OTHER_NAME = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum",
               "any": "all", "all": "any", "floor": "ceil", "ceil": "floor"}  # fmt: skip
_SAY_NOTHING = ("Error", "Finding", "say", "warn", "hint")
"""Calls and arguments that hold words for people."""


def mutants_of(room: str, path: str, text: str) -> list[Mutant]:
    """All mutants of one file, in the order of its text."""
    lines = [0, *accumulate(len(line) for line in text.splitlines(keepends=True))]
    raw = text.splitlines(keepends=True)
    found: list[Mutant] = []
    for where, node, condition in _places(ast.parse(text)):
        for other in _changed(node, condition):
            start, stop = (
                lines[row - 1] + len(raw[row - 1].encode()[:column].decode())
                for row, column in (
                    (node.lineno, node.col_offset),
                    (node.end_lineno or 0, node.end_col_offset or 0),
                )
            )
            new = f"({ast.unparse(other)})"
            mutant = Mutant(room, path, start, stop, new, where, ast.unparse(node))
            opposite_half_edges = sum(m.where == where and m.change == mutant.change for m in found)
            found.append(replace(mutant, nth=opposite_half_edges + 1))
    return found


Place = tuple[str, ast.expr, bool]


def _places(tree: ast.AST, where: str = "") -> Iterator[Place]:
    """Every expression that a test could notice: what it is in, it, whether it is a condition."""
    for child in ast.iter_child_nodes(tree):
        match child:
            case ast.FunctionDef() | ast.ClassDef():
                inner = f"{where}.{child.name}".lstrip(".")
                for part in child.body:
                    yield from _inside(part, inner)
                if isinstance(child, ast.FunctionDef):
                    for default in [*child.args.defaults, *child.args.kw_defaults]:
                        if default is not None:
                            yield from _inside(default, inner)
            case ast.Import() | ast.ImportFrom():
                pass
            case _:
                yield from _inside(child, where)


def _inside(node: ast.AST, where: str, condition: bool = False) -> Iterator[Place]:
    if _silent(node):
        return
    match node:
        case ast.FunctionDef() | ast.ClassDef():
            yield from _places(ast.Module([node], []), where)
            return
        case ast.Assign() | ast.AnnAssign():
            # Constants of a module are named by themselves, all else by its function.
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            where = where or ast.unparse(target)
            parts: list[ast.AST] = [node.value] if node.value else []
        case ast.Subscript() if _plain_axes(node.slice):
            parts = [node.value]
        case _:
            parts = [n for n in ast.iter_child_nodes(node) if not isinstance(n, ast.pattern)]
    if isinstance(node, ast.expr):
        yield where, node, condition
    test = getattr(node, "test", None)
    for part in parts:
        yield from _inside(part, where, part is test)


def _silent(node: ast.AST) -> bool:
    """Whether nothing in it says anything to a test."""
    match node:
        case ast.Raise() | ast.Import() | ast.ImportFrom() | ast.JoinedStr() | ast.Assert():
            return True
        case ast.Expr(value=ast.Constant()):
            return True
        case ast.Call():
            return _last_name(node.func).endswith(_SAY_NOTHING)
        case ast.keyword():
            return node.arg in _SAY_NOTHING
    return False


def _last_name(node: ast.expr) -> str:
    return ast.unparse(node).rsplit(".", 1)[-1]


def _plain_axes(node: ast.expr) -> bool:
    """Slices of nothing but ``:``, ``None`` and ``...``: another one does not even run."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    return all(
        isinstance(p, ast.Slice) or (isinstance(p, ast.Constant) and p.value in (None, ...))
        for p in parts
    )


def _changed(node: ast.expr, condition: bool) -> Iterator[ast.expr]:
    match node:
        case ast.Name() | ast.Attribute() | ast.Call() | ast.NamedExpr() if condition:
            yield ast.UnaryOp(ast.Not(), node)
        case ast.Compare() if type(node.ops[0]) in _COMPARED:
            ops: list[ast.cmpop] = [_COMPARED[type(node.ops[0])](), *node.ops[1:]]
            yield ast.Compare(node.left, ops, node.comparators)
        case ast.BinOp() if type(node.op) in _CALCULATED and not _joins_text(node):
            yield ast.BinOp(node.left, _CALCULATED[type(node.op)](), node.right)
            if isinstance(node.op, ast.Mult | ast.Add | ast.Sub | ast.Div | ast.Pow):
                yield node.left
        case ast.BoolOp():
            swapped = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            yield ast.BoolOp(swapped, node.values)
            yield ast.BoolOp(node.op, node.values[:-1]) if node.values[2:] else node.values[0]
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert()):
            yield node.operand
        case ast.Constant():
            yield from _constants(node)
        case ast.Call() if _last_name(node.func) in _OTHER_NAME:
            call = copy.deepcopy(node)
            if isinstance(call.func, ast.Attribute):
                call.func.attr = _OTHER_NAME[call.func.attr]
            elif isinstance(call.func, ast.Name):
                call.func.id = _OTHER_NAME[call.func.id]
            yield call


def _joins_text(node: ast.BinOp) -> bool:
    return any(
        isinstance(side, ast.JoinedStr)
        or (isinstance(side, ast.Constant) and isinstance(side.value, str | bytes))
        for side in (node.left, node.right)
    )


def _constants(node: ast.Constant) -> Iterator[ast.expr]:
    match node.value:
        case bool():
            yield ast.Constant(not node.value)
        case int() | float():
            yield ast.Constant(2 * node.value if node.value else 1)

"""Fail when a module or a function has grown too long: cohesion, no count, decides before."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

AIM, LIMIT = 500, 1000
FUNCTION = 80
"""Lines that fit on a screen."""


def main() -> int:
    """Print modules over the aim and functions over the limit; return 1 when there is one."""
    root = Path(__file__).parents[2]
    modules = [p for room in ("src", "bench") for p in (root / room).rglob("*.py")]
    texts = {p.relative_to(root): p.read_text() for p in modules}
    sizes = {p: len(text.splitlines()) for p, text in texts.items()}
    for path, lines in sorted(sizes.items(), key=lambda item: -item[1]):
        if lines > AIM:
            verdict = "too long" if lines > LIMIT else "over the aim"
            print(f"{path}: {lines} lines, {verdict} ({AIM} aim, {LIMIT} limit)")
    long = [said for path, text in texts.items() for said in _long_functions(path, text)]
    print(*long, sep="\n", end="\n" if long else "")
    return int(bool(long) or any(lines > LIMIT for lines in sizes.values()))


def _long_functions(path: Path, text: str) -> list[str]:
    out = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if lines > FUNCTION:
                out.append(f"{path}:{node.lineno}: {node.name} has {lines} lines, limit {FUNCTION}")
    return out


if __name__ == "__main__":
    sys.exit(main())

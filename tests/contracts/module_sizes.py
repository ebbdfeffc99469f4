"""Fail when a module has grown past 1 000 lines: cohesion, no count, decides before."""

from __future__ import annotations

import sys
from pathlib import Path

AIM, LIMIT = 500, 1000


def main() -> int:
    """Print modules over the aim; return 1 when one is over the limit."""
    root = Path(__file__).parents[2]
    modules = (p for room in ("src", "bench") for p in (root / room).rglob("*.py"))
    sizes = {p: len(p.read_text().splitlines()) for p in modules}
    for path, lines in sorted(sizes.items(), key=lambda item: -item[1]):
        if lines > AIM:
            verdict = "too long" if lines > LIMIT else "over the aim"
            print(f"{path.relative_to(root)}: {lines} lines, {verdict} ({AIM} aim, {LIMIT} limit)")
    return int(any(lines > LIMIT for lines in sizes.values()))


if __name__ == "__main__":
    sys.exit(main())

"""Run every benchmark of this folder, or the named ones: ``python -m bench [NAME …]``.

A benchmark is a module here with a function ``run()`` that prints its figures.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path


def main(wanted: list[str]) -> int:
    """Run the benchmarks; returns the exit code."""
    there = [m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)])]
    names = [name for name in there if not name.startswith("_")]
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        print(f"no benchmark {', '.join(unknown)} → there are {', '.join(names)}", file=sys.stderr)
        return 2
    for name in wanted or names:
        module = importlib.import_module(f"bench.{name}")
        if hasattr(module, "run"):
            print(f"== {name}", flush=True)
            module.run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

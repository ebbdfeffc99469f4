"""Run every benchmark of this folder, or the named ones: ``python -m bench [NAME …] [--quick]``.

A benchmark is a module here with a function ``run()`` that prints its figures. Some take ``quick``:
it is asked for with ``--quick``, and where all of them run.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from pathlib import Path


def main(words: list[str]) -> int:
    """Run the benchmarks; returns the exit code."""
    wanted = [w for w in words if w != "--quick"]
    quick = "--quick" in words or not wanted
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
            asked = {"quick": quick} if "quick" in inspect.signature(module.run).parameters else {}
            module.run(**asked)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

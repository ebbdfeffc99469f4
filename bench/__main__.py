"""Run every benchmark of this folder, or the named ones: ``python -m bench [NAME …] [--quick]``.

A benchmark is a module here with a function ``run()`` that prints its figures. Some take ``quick``:
it is asked for with ``--quick``, and where all of them run. Some have ``PARTS``: those named after
the benchmark run alone; where it is None, any words are handed on. Some write their figures into
the documents with ``--write``.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from pathlib import Path


def main(words: list[str]) -> int:
    """Run the benchmarks; returns the exit code."""
    named = [w for w in words if not w.startswith("--")]
    there = [m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)])]
    names = [name for name in there if not name.startswith("_")]
    wanted = dict[str, list[str]]()
    parts: tuple[str, ...] | None = ()
    for word in named:
        if parts is None or word in parts:
            wanted[list(wanted)[-1]].append(word)
        elif word in names:
            wanted[word] = []
            parts = getattr(importlib.import_module(f"bench.{word}"), "PARTS", ())
        else:
            print(
                f"no benchmark {word} → there are {', '.join((*names, *(parts or ())))}",
                file=sys.stderr,
            )
            return 2
    quick = "--quick" in words or not wanted
    for name in wanted or names:
        module = importlib.import_module(f"bench.{name}")
        if hasattr(module, "run"):
            print(f"== {name}", flush=True)
            able = inspect.signature(module.run).parameters
            asked = {
                "quick": quick,
                "parts": wanted.get(name, []),
                "into_pages": "--write" in words,
            }
            module.run(**{k: v for k, v in asked.items() if k in able})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

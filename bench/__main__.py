"""Run every benchmark of this folder, or the named ones: ``python -m bench [NAME …] [--quick]``.

``--help`` lists them. A benchmark is a module here with a function ``run()`` that prints its
figures. Some take ``quick``: it is asked for with ``--quick``, and where all of them run. Some have
``PARTS``: those named after the benchmark run alone; where it is None, any words are handed on that
are no benchmarks. Some write their figures into the documents with ``--write``.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pkgutil
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def listed(names: list[str]) -> str:
    """How the command is used, and each benchmark with the first line of its text."""
    width = max(map(len, names)) + 2
    lines = ["usage: python -m bench [NAME …] [--quick] [--write]", ""]
    for name in names:
        alone, package = FOLDER / f"{name}.py", FOLDER / name / "__init__.py"
        source = (alone if alone.exists() else package).read_text()
        text = ast.get_docstring(ast.parse(source)) or ""
        lines.append(f"  {name:<{width}}{text.partition(chr(10))[0]}")
    return "\n".join(
        [
            *lines,
            "",
            "Without a NAME all of them run, quick; that takes hours.",
            "--write: into docs/",
        ]
    )


def asked_for(words: list[str], names: list[str]) -> dict[str, list[str]]:
    """The benchmarks that are named, each with the words that are handed on to it: the name of
    another begins that one. Raises ValueError for a word that is none of them."""
    wanted = dict[str, list[str]]()
    parts: tuple[str, ...] | None = ()
    for word in words:
        if parts and word in parts:
            wanted[list(wanted)[-1]].append(word)
        elif word in names:
            wanted[word] = []
            parts = getattr(importlib.import_module(f"bench.{word}"), "PARTS", ())
        elif parts is None:
            wanted[list(wanted)[-1]].append(word)
        else:
            there = ", ".join((*names, *parts))
            raise ValueError(f"no benchmark {word} → there are {there}")
    return wanted


def main(words: list[str]) -> int:
    """Run the benchmarks; returns the exit code."""
    there = [m.name for m in pkgutil.iter_modules([str(FOLDER)])]
    names = [name for name in there if not name.startswith("_")]
    named = [w for w in words if not w.startswith("-")]
    if {"-h", "--help"} & set(words):
        print(listed(names))
        return 0
    unknown = set(words) - set(named) - {"--quick", "--write"}
    if unknown:
        print(f"no option {' '.join(sorted(unknown))} → see --help", file=sys.stderr)
        return 2
    try:
        wanted = asked_for(named, names)
    except ValueError as error:
        print(error, file=sys.stderr)
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
    try:
        code = main(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # who read it has seen enough; nothing is left to be flushed at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)

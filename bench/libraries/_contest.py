"""Contenders in processes of their own: their time, memory and result, or how they failed."""

from __future__ import annotations

import importlib
import importlib.metadata
import multiprocessing
import os
import re
import resource
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Arrays = dict[str, Any]
"""Arrays by name, as `numpy.savez` keeps them."""
LIMIT = 240.0
"""s that a contender may take, its imports and both runs included."""
_AGAIN = 60.0
"""s below which a second run follows: the first may compile, load and warm up."""


@dataclass(frozen=True)
class Contender:
    """A way of doing a job: our own, or a library's."""

    name: str
    do: Callable[[Arrays], Arrays]
    package: str = ""
    """On PyPI; empty for our own."""
    licence: str = "Apache-2.0"
    note: str = ""
    """What the reader of the table must know."""


@dataclass(frozen=True)
class Outcome:
    """What became of a contender."""

    seconds: float = float("nan")
    """Of a processor, all threads; the faster of two runs."""
    waited: float = float("nan")
    """s on the wall clock in the same run."""
    megabytes: float = float("nan")
    """How far the memory of the process grew at most."""
    made: Arrays | None = None
    """What it returned; None where it failed."""
    same: bool | None = None
    """Whether two runs gave the same bytes; None where there was one."""
    error: str = ""


def contest(who: Contender, given: Arrays, limit: float = LIMIT) -> Outcome:
    """Let a contender do its job on the same arrays as all others."""
    if who.package and not installed(who.package):
        return Outcome(error="not installed")
    with tempfile.TemporaryDirectory() as folder:
        inside, outside = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(inside, **given)
        context = multiprocessing.get_context("spawn")
        job = (who.do.__module__, who.do.__name__, inside, outside)
        process = context.Process(target=_work, args=job)
        process.start()
        process.join(limit)
        if process.is_alive():
            process.kill()
            process.join()
            return Outcome(error=f"not done after {limit:.0f} s")
        if process.exitcode:
            return Outcome(error=f"the process died ({process.exitcode})")
        with np.load(outside) as file:
            made = dict(file)
    if "error" in made:
        return Outcome(error=str(made["error"]))
    seconds, waited, megabytes, same = made.pop("_figures")
    return Outcome(seconds, waited, megabytes, made, None if np.isnan(same) else bool(same))


def _work(module: str, name: str, inside: Path, outside: Path) -> None:
    # Libraries write into the terminal what they think of damaged files.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    do = getattr(importlib.import_module(module), name)
    with np.load(inside) as file:
        given = dict(file)
    try:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        made, *first = _timed(do, given)
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        same, best = float("nan"), first
        if first[1] < _AGAIN:
            again, *second = _timed(do, given)
            same = float(_equal(made, again))
            best = min(first, second)
        np.savez(outside, **made, _figures=[*best, grown, same])
    except Exception as e:
        text = str(e).strip() or "no message"
        np.savez(outside, error=f"{type(e).__name__}: {text.splitlines()[0][:60]}")


def _timed(do: Callable[[Arrays], Arrays], given: Arrays) -> tuple[Arrays, float, float]:
    wall, spent = time.perf_counter(), time.process_time()
    made = do({k: v.copy() for k, v in given.items()})
    # A job that times its parts says what counts; the rest was preparation.
    own = made.pop("_seconds", None)
    spent = time.process_time() - spent if own is None else float(own)
    return made, spent, time.perf_counter() - wall


def _equal(one: Arrays, other: Arrays) -> bool:
    # What begins with an underline is a figure, no result.
    return one.keys() == other.keys() and all(
        np.array_equal(one[k], other[k], equal_nan=one[k].dtype.kind == "f")
        for k in one
        if not k.startswith("_")
    )


def installed(package: str) -> bool:
    """Whether a package is here."""
    try:
        importlib.metadata.distribution(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def weight(package: str) -> str:
    """MB that a package and what it needs take beside what turnscan has anyway; how many they are.

    Without extras and without what is needed for other platforms.
    """
    if not package:
        return "0"
    if not installed(package):
        return "?"
    more = _closure(package) - _closure("turnscan")
    size = sum(_megabytes(name) for name in more)
    return f"{size:.0f} MB" + (f", {len(more)} packages" if len(more) > 1 else "")


def _closure(package: str) -> set[str]:
    seen: set[str] = set()
    ahead = [package]
    while ahead:
        name = re.sub(r"[-_.]+", "-", ahead.pop()).lower()
        if name in seen or not installed(name):
            continue
        seen.add(name)
        for text in importlib.metadata.requires(name) or ():
            if "extra ==" not in text:
                found = re.match(r"[\w.-]+", text)
                ahead += [found[0]] if found else []
    return seen


def _megabytes(package: str) -> float:
    files = importlib.metadata.files(package) or ()
    places = [Path(str(f.locate())) for f in files]
    return sum(p.stat().st_size for p in places if p.is_file()) / 1e6


def table(columns: list[str], rows: list[list[str]]) -> list[str]:
    """The lines of a table in Markdown."""
    widths = [max(len(r[k]) for r in (columns, *rows)) for k in range(len(columns))]
    put = [
        "| " + " | ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)) + " |" for r in rows
    ]
    head = "| " + " | ".join(c.ljust(w) for c, w in zip(columns, widths, strict=True)) + " |"
    return [head, "|" + "|".join("-" * (w + 2) for w in widths) + "|", *put]


Judge = Callable[[Arrays, Arrays], Mapping[str, str]]
"""The figures of a result by column: given what went in and what came out."""


def compare(
    contenders: list[Contender], given: Arrays, judge: Judge, columns: list[str]
) -> list[str]:
    """Run all, the first being our own; a table of time, ratio, the judge's columns and costs."""
    head = ["", "s", "to ours", "MB", *columns, "same twice", "licence", "adds"]
    rows = list[list[str]]()
    ours = float("nan")
    for who in contenders:
        done = contest(who, given)
        label = who.name + (f" ({who.note})" if who.note else "")
        ends = [who.licence, weight(who.package)]
        if done.made is None:
            rows.append([label, done.error, "", "", *[""] * len(columns), "", *ends])
        else:
            ours = done.seconds if who is contenders[0] else ours
            found = judge(given, done.made)
            same = {True: "yes", False: "no", None: "?"}[done.same]
            ratio = f"{done.seconds / ours:.2f}"
            figures = [found.get(c, "") for c in columns]
            rows.append(
                [
                    label,
                    f"{done.seconds:.2f}",
                    ratio,
                    f"{done.megabytes:.0f}",
                    *figures,
                    same,
                    *ends,
                ]
            )
        print("  ".join(rows[-1]), flush=True)
    return table(head, rows)

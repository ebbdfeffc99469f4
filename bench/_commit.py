"""The commit that figures are of."""

from __future__ import annotations

import subprocess
from pathlib import Path


def _git(*words: str) -> str:
    where = Path(__file__).parents[1]
    done = subprocess.run(["git", *words], capture_output=True, text=True, check=True, cwd=where)
    return done.stdout.strip()


def commit() -> str:
    """The commit that is checked out, with a ``+`` where something was changed since."""
    changed = "+" if _git("status", "--porcelain", "--", "src") else ""
    return _git("rev-parse", "--short=10", "HEAD") + changed


def commit_of_code() -> str:
    """The last commit that changed what figures hang on, with a ``+`` where more was changed.

    One that changes the documents alone is none: figures that are written there stay of this one.
    """
    code = ("--", "src", "bench")
    changed = "+" if _git("status", "--porcelain", *code) else ""
    return _git("log", "-1", "--abbrev=10", "--format=%h", *code) + changed

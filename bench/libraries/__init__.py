"""Our own parts beside the libraries that offer the same, on the same input, by one measure.

``python -m bench libraries [PART …] [--quick] [--write]``; ``--write`` puts the tables into the
decision pages. The libraries come with ``pip install turnscan[bench]``, best into an environment of
their own: ``make bench-libraries``.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from bench._page import DOCS, write

PARTS = ("decimation", "fusion", "cut", "readers", "rays", "holes", "crossings")
"""Words that may follow the name of this benchmark: what is compared."""


def run(quick: bool = False, parts: Sequence[str] = (), into_pages: bool = False) -> None:
    """Print a table for each part, or for those named."""
    for part in parts or PARTS:
        module = importlib.import_module(f"bench.libraries.{part}")
        print(f"-- {part}", flush=True)
        lines = module.measure(quick)
        print("\n".join(lines), flush=True)
        if into_pages:
            write(DOCS / "decisions" / module.PAGE, part, lines)

"""Calibration against what was asked of it: each figure beside its wanted value.

``python -m bench calibration [PART …] [--quick] [--write]``. The parts: ``boards`` (rigs calibrated
from rendered pictures, then a ball bar), ``noise`` (of what is found in such pictures), ``axis``
(where the axis comes out, over draws), ``zscores`` (errors over the uncertainties stated, 100
rigs), ``targetless`` (from a ruler to a rig by two lasers), ``poses`` (by one laser and a part in
two poses), ``table`` (a table that is eccentric and has play), ``wobble`` (one whose axis moves
in a turn), ``verify`` (drift, and 200 calibrations), ``stands`` (bodies that say enough of a rig,
and too little), ``refused`` (set-ups and inputs that must be refused), ``real`` (pictures of real
scanners, where they are) and ``time``.
``--quick`` takes fewer seeds, and the paper rig alone; ``--write`` puts each part's table into
docs/explain/calibration.md.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from bench._page import DOCS, write
from bench.calibration import _figures
from bench.calibration._figures import HEAD, Figure

PARTS = (
    "boards", "noise", "axis", "zscores", "targetless", "poses", "stands", "table", "wobble",
    "verify", "refused", "real", "time",
)  # fmt: skip
PAGE = DOCS / "explain" / "calibration.md"


def run(quick: bool, parts: Sequence[str], into_pages: bool) -> None:
    """Print the tables of these parts, all of them where none is named."""
    missed = 0
    for part in parts or PARTS:
        print("\n".join((f"-- {part}", *HEAD)), flush=True)
        made: list[Figure] = []
        for figure in importlib.import_module(f"bench.calibration.{part}").figures(quick):
            print(figure.line, flush=True)
            made.append(figure)
        missed += sum(f.met is not None and not f.met for f in made)
        if into_pages:
            write(PAGE, f"calibration {part}", _figures.table(made))
    print(f"{missed} missed")

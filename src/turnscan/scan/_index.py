"""Index: what a scan file holds, its rows in memory, each judged against the plan."""

from __future__ import annotations

import json
import math
from itertools import product
from pathlib import Path
from typing import Final

from turnscan.errors import InputError, ScanCorrupt
from turnscan.scan import _database as database
from turnscan.scan._database import Row
from turnscan.scan._plan import ScanPlan, settings_from_json
from turnscan.scan._stored import DARKS

WHOLE: Final = ("background", "texture")
"""Kinds of rows that are whole pictures."""


class Index:
    """The rows of one scan file, found by what they are of. No thread's own; no file is read."""

    def __init__(self, path: Path, plan: ScanPlan) -> None:
        self._path, self._plan = path, plan
        self._frames: dict[tuple[str, int, int], Row] = {}
        self.textures: dict[int, Row] = {}
        """By step."""
        self.backgrounds: dict[str, Row] = {}
        """By laser."""

    def add(self, row: Row) -> None:
        """Take a row in: of a frame, or of the record that there is none, or of a picture."""
        if row.kind == "background":
            self.backgrounds[row.laser] = row
        elif row.kind == "texture":
            self.textures[row.step] = row
        else:
            self._frames[row.laser, row.step, row.exposure] = row

    def remove(self, row: Row) -> None:
        """Forget the row of a frame."""
        del self._frames[row.laser, row.step, row.exposure]

    def row(self, laser: str, step: int, exposure: int) -> Row | None:
        """The row of a frame, or of the record that there is none."""
        return self._frames.get((laser, step, exposure))

    def in_order(self, laser: str | None) -> list[Row]:
        """Rows of frames by step, of one laser or of all, one laser after the other."""
        self.known(laser)
        rows = [r for r in self._frames.values() if r.kind == "lit" and laser in (None, r.laser)]
        order = {name: i for i, name in enumerate(self._plan.lasers)}
        return sorted(rows, key=lambda r: (order[r.laser], r.step, r.exposure))

    def missing(self, laser: str) -> dict[int, str]:
        """Steps of a laser that have no frame of any exposure, with the cause."""
        self.known(laser)
        out: dict[int, str] = {}
        for step in range(self._plan.steps):
            rows = [self.row(laser, step, k) for k in range(self._plan.exposures)]
            there = [row for row in rows if row is not None]
            if any(row.kind == "lit" for row in there):
                continue
            causes = [settings_from_json(row.settings, str(row)).get("cause", "") for row in there]
            out[step] = "; ".join(dict.fromkeys(map(str, causes))) or "it was not taken"
        return out

    @property
    def complete(self) -> bool:
        """Whether every exposure of every step and laser is there, or a record of why it is not."""
        plan = self._plan
        wanted = product(plan.lasers, range(plan.steps), range(plan.exposures))
        return all(key in self._frames for key in wanted)

    @property
    def last(self) -> Row | None:
        """What was stored last, of the turning part."""
        rows = [*self._frames.values(), *self.textures.values()]
        return max(rows, key=lambda r: r.id, default=None)

    def __len__(self) -> int:
        """Number of frames."""
        return sum(r.kind == "lit" for r in self._frames.values())

    def seal(self) -> str:
        """All rows in one text, to be compared."""
        rows = [*self._frames.values(), *self.backgrounds.values(), *self.textures.values()]
        return json.dumps({"frames": len(rows), "sha256": database.digest_of_rows(rows)})

    def known(self, laser: str | None) -> None:
        """Raise InputError where the scan has no such laser."""
        if laser is not None and laser not in self._plan.lasers:
            raise InputError(
                f"{self._path}: no laser {laser!r}", hint=f"it has {', '.join(self._plan.lasers)}"
            )

    def free(self, laser: str, step: int, exposure: int) -> None:
        """Raise InputError where a frame is there already, or is none of the plan."""
        self.known(laser)
        if not 0 <= step < self._plan.steps:
            raise InputError(f"{self._path}: step {step} is not one of 0 … {self._plan.steps - 1}")
        if not 0 <= exposure < self._plan.exposures:
            last = self._plan.exposures - 1
            raise InputError(f"{self._path}: exposure {exposure} is not one of 0 … {last}")
        if (laser, step, exposure) in self._frames:
            raise InputError(f"{self._path}: step {step} of laser {laser!r} is there already")

    def believe(self, row: Row) -> None:
        """Raise ScanCorrupt where a row does not fit the plan: with a right checksum it can still
        be a stranger's.
        """
        plan = self._plan
        good = (
            row.kind in ("lit", "missing", *WHOLE)
            and (row.laser in plan.lasers if row.kind != "texture" else row.laser == "")
            and 0 <= row.step < plan.steps
            and 0 <= row.exposure < plan.exposures
            and (row.width, row.height) == (plan.width, plan.height)
            and row.codec in [f"{form_of(row.kind, plan)}.{dark}" for dark in DARKS]
            and not any(math.isinf(v) for v in (row.commanded, row.measured, row.sigma))
        )
        if not good:
            raise ScanCorrupt(f"{self._path}: damaged: {row} does not fit the plan of the scan")


def form_of(kind: str, plan: ScanPlan) -> str:
    """How the pixels of a kind of row are packed."""
    return "full" if kind in WHOLE or plan.keep == "full" else "runs"

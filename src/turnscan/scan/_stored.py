"""Stored: a frame as it lies in the file, to be unpacked where and when it is needed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from turnscan.runs import Runs
from turnscan.scan._codec import Background, Dark, Project, decode, decode_runs
from turnscan.scan._database import Row
from turnscan.scan._plan import Frame, ScanPlan, settings_from_json

DARKS: Final[tuple[Dark, ...]] = ("own", "background", "none")


@dataclass(frozen=True)
class Stored:
    """A frame as it lies in the file; `decode` may run in any thread, many at a time."""

    row: Row
    read: Callable[[Row], bytes] = field(repr=False)
    """Reads the packed pixels of a row from the file, which must still be open."""
    plan: ScanPlan
    background: Background | None
    project: Project | None
    scale: float
    """Grey levels of the projected signal for one of ``weights`` · (red, green, blue)."""
    where: str

    @property
    def payload(self) -> bytes:
        """The packed pixels, read again each time. Raises ScanCorrupt naming the frame."""
        return self.read(self.row)

    def runs(self) -> Runs:
        """The pixels that a sparse scan keeps, and nothing else; of colour, only projected ones.

        Raises ScanCorrupt naming the file and the frame.
        """
        dark = dark_of(self.row)
        return decode_runs(self.payload, self.plan, dark, self.background, self.project, self.where)

    @property
    def level(self) -> float:
        """`Frame.level`."""
        return self.row.level * self.scale

    @property
    def noise(self) -> float:
        """`Frame.noise`."""
        return self.row.noise * self.scale

    @property
    def angle(self) -> float:
        """`Frame.angle`."""
        return self.row.commanded if math.isnan(self.row.measured) else self.row.measured

    def decode(self) -> Frame:
        """Unpack the pixels. Raises ScanCorrupt naming the file and the frame."""
        row = self.row
        lit, dark = decode(
            self.payload, self.plan, dark_of(row), self.background, self.project, self.where
        )
        return Frame(
            step=row.step,
            laser=row.laser,
            lit=lit,
            dark=dark,
            exposure=row.exposure,
            commanded=row.commanded,
            measured=row.measured,
            angle_sigma=row.sigma,
            noise=self.noise,
            level=self.level,
            time=row.time,
            settings=settings_from_json(row.settings, self.where),
        )


def dark_of(row: Row) -> Dark:
    """Where a frame has its dark picture."""
    return next(d for d in DARKS if row.codec.endswith(d))

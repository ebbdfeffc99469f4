"""Stored: a frame as it lies in the file, to be unpacked where and when it is needed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from turnscan.scan._codec import Background, Dark, Project, decode
from turnscan.scan._database import Row
from turnscan.scan._plan import Frame, ScanPlan, settings_from_json

DARKS: Final[tuple[Dark, ...]] = ("own", "background", "none")


@dataclass(frozen=True)
class Stored:
    """A frame as it lies in the file; `decode` may run in any thread, many at a time."""

    row: Row
    payload: bytes
    plan: ScanPlan
    background: Background | None
    project: Project | None
    scale: float
    """Grey levels of the projected signal for one of ``weights`` · (red, green, blue)."""
    where: str

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
            noise=row.noise * self.scale,
            level=row.level * self.scale,
            time=row.time,
            settings=settings_from_json(row.settings, self.where),
        )


def dark_of(row: Row) -> Dark:
    """Where a frame has its dark picture."""
    return next(d for d in DARKS if row.codec.endswith(d))

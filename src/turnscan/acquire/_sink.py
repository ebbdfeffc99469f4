"""Where the frames of a run go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from turnscan.arrays import Image
from turnscan.scan import Frame, ScanPlan, Setting


class Sink(Protocol):
    """Where frames go: a `turnscan.scan.Scan`, or anything else that keeps them."""

    @property
    def plan(self) -> ScanPlan:
        """What the frames look like."""
        ...

    def has(self, laser: str, step: int, exposure: int = 0) -> bool:
        """Whether it has this frame, or knows that there is none."""
        ...

    def has_texture(self, step: int) -> bool:
        """Whether it has the picture without laser light of this step."""
        ...

    def add(self, frame: Frame) -> object:
        """Keep a frame."""
        ...

    def add_missing(
        self, step: int, laser: str, cause: str, commanded: float, exposure: int = 0
    ) -> None:
        """Keep the fact that there is none, and why."""
        ...

    def add_texture(
        self,
        step: int,
        picture: Image,
        commanded: float,
        time: float,
        settings: Mapping[str, Setting],
    ) -> None:
        """Keep a picture without laser light."""
        ...

"""The pictures of a scan file, unpacked: whole ones, and frames with what they refer to as dark."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from turnscan.arrays import Image
from turnscan.errors import ScanCorrupt
from turnscan.scan._codec import Background, Project, decode
from turnscan.scan._database import Row
from turnscan.scan._index import Index
from turnscan.scan._plan import ScanPlan
from turnscan.scan._stored import Stored, dark_of


class Unpacker:
    """Makes pictures of rows; keeps the backgrounds, which many frames share."""

    def __init__(
        self, path: Path, plan: ScanPlan, index: Index, payload: Callable[[Row], bytes]
    ) -> None:
        """``payload`` reads the packed pixels of a row."""
        self._path = path
        self._plan = plan
        self._index = index
        self._payload = payload
        self._pictures: dict[str, Image] = {}
        self._shared: tuple[str, Project | None, Background] | None = None
        self._scales: tuple[Project, float] | None = None

    def stored(self, row: Row, project: Project | None) -> Stored:
        """A frame, not yet unpacked. Raises ScanCorrupt where its background is missing."""
        if self._plan.channels == 1:
            project = None
        background = None
        if dark_of(row) == "background":
            background = self._ground(row, project)
        where = f"{self._path}: {row}"
        scale = 1.0 if project is None else self._scale(project)
        return Stored(row, self._payload, self._plan, background, project, scale, where)

    def whole(self, row: Row) -> Image:
        """A picture of which all pixels are kept: a texture or a background."""
        where = f"{self._path}: {row}"
        plan = replace(self._plan, keep="full")
        return decode(self._payload(row), plan, "none", None, None, where)[0]

    def background(self, laser: str) -> Image | None:
        """(H, W) or (H, W, 3): what the frames of a laser refer to as dark, or None."""
        self._index.known(laser)
        row = self._index.backgrounds.get(laser)
        if row is not None and laser not in self._pictures:
            self.keep(laser, self.whole(row))
        return self._pictures.get(laser)

    def keep(self, laser: str, picture: Image) -> None:
        """Take a background that was just unpacked or stored; nothing else may write to it."""
        picture.flags.writeable = False
        self._pictures[laser] = picture

    def _ground(self, row: Row, project: Project | None) -> Background:
        if self._shared is None or self._shared[:2] != (row.laser, project):
            picture = self.background(row.laser)
            if picture is None:
                raise ScanCorrupt(f"{self._path}: damaged: the background of {row} is missing")
            self._shared = (row.laser, project, Background(picture, project))
        return self._shared[2]

    def _scale(self, project: Project) -> float:
        """What a projection makes of one grey level of the signal; it is linear up to a shift."""
        if self._scales is None or self._scales[0] is not project:
            weights = np.array(self._plan.weights)
            top = np.iinfo(self._plan.dtype).max
            ends = np.where(np.stack([weights > 0, weights < 0]), top, 0).astype(self._plan.dtype)
            low, high = (float(v) for v in project(ends[::-1].reshape(1, 2, 3))[0])
            self._scales = (project, (high - low) / float(np.abs(weights).sum() * top))
        return self._scales[1]

"""What an open scan is at one moment, and what one step of it did: values for those who show it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Protocol

from turnscan import edit
from turnscan.detection import View
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.points import RangeGrid
from turnscan.progress import Progress
from turnscan.settings import Settings
from turnscan.surface.holes import LeftOut, ScanCoverage
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._session._grid import changed_steps, steps_taken_away
from turnscan.workflows._session._measures import KeptMeasure
from turnscan.workflows._session._mesh import Arrays, SurfacePatch, surface_patches


class NotOpen(InputError):
    """What was asked of a scan that is not open, or was closed meanwhile, was not done."""


class Stale(InputError):
    """The edit was made on a surface that has changed since."""


class Work(Protocol):
    """Who asked for something that may take long: receives its progress, and may cancel it."""

    title: str

    @property
    def progress(self) -> Progress:
        """Receives the progress."""

    def check(self) -> None:
        """Raise Cancelled where somebody has cancelled it."""

    def commit(self) -> None:
        """From here on it cannot be cancelled. Raises Cancelled where it was before."""


@dataclass(frozen=True, eq=False)
class SessionState:
    """What an open scan is at one moment; a value, so that readers need no lock."""

    document: edit.Document
    grids: tuple[RangeGrid, ...]
    sought: tuple[ScanCoverage, ...]
    """What the scan could have seen, for the causes of holes."""
    lost: LeftOut | None
    """Faces that were left out as too uncertain, for these causes, too."""
    merged: Mesh | None
    """The surface with its islands, before any edit of its faces."""
    revision: int
    epoch: int
    """Counts the surfaces whose faces have other numbers, from a random number on."""
    figures: edit.Figures
    options: ReconstructOptions
    """What the surface was made with."""
    settings: Settings
    """The same, with the rig."""
    views: Mapping[str, View]
    """How the stripe of each laser was found."""
    measures: tuple[KeptMeasure, ...]
    sets: Mapping[str, ReconstructOptions]
    """The named sets of settings in the file, those that can be read; not the default one."""


@dataclass(frozen=True, eq=False)
class SessionChange:
    """One step of an open scan, for those who show it."""

    before: SessionState
    after: SessionState
    text: str
    patches: Sequence[edit.Patch]

    def surface(self) -> list[SurfacePatch]:
        """What it did to the surface, in the order it is done."""
        return surface_patches(self.patches)

    def grids(self) -> Iterator[tuple[int, list[int]]]:
        """Which steps of which grids are others now."""
        for k, (a, b) in enumerate(zip_longest(self.before.grids, self.after.grids)):
            steps = changed_steps(a, b)
            if b is not None:
                away = steps_taken_away(b, self.before.document, self.after.document)
                steps = sorted({*steps, *map(int, away)})
            if steps:
                yield k, steps


@dataclass(frozen=True, eq=False)
class ShownPreview:
    """What an edit would do: vertices and faces it would add, faces it would take away."""

    figures: edit.Figures
    arrays: Arrays


@dataclass(frozen=True)
class PlacedFinding:
    """A finding, and the grid and the step that its words name."""

    finding: Finding
    grid: int | None
    step: int | None

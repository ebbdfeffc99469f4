"""Messages of an open scan: its surface, its grids and its history of edits."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from turnscan.app._protocol._base import Box, Count, Model, Opaque, Remark
from turnscan.app._protocol._headers import GridEntry
from turnscan.app._protocol._inspection import Measure
from turnscan.app._protocol._settings import ScanSettings


class HistoryEntry(Model):
    """An edit in the list."""

    index: Count
    """Its place in the list: it counts where that is below the cursor, and it is on."""
    edit: Count
    """Its number for ever."""
    name: str
    text: str
    on: bool
    at: str
    """ISO time, UTC."""
    title: str
    """Name that a person gave it; empty for none."""
    picture: str
    """Of the surface after it, at ``/api/scans/{scan}/steps/{picture}.png``; empty for none."""


class BranchEntry(Model):
    """A piece of another history, left when an edit was made after stepping back."""

    after: Count
    """Number of the edit it grows from; 0: it begins with the first edit."""
    edits: list[HistoryEntry]
    """Those that neither the history nor a newer branch has."""


class Figures(Model):
    """What the surface is like now."""

    vertices: Count
    faces: Count
    bounds: Box | None
    closed: bool
    volume: float | None
    """mm³; None where the surface is open."""


class FirstSurface(Model):
    """Shown while a large scan is being opened: arrays positions f32 (v, 3), faces u32 (f, 3).

    Some of the profiles as scanned; nothing can be edited or measured on it.
    """

    kind: Literal["first_surface"] = "first_surface"
    scan: Opaque
    every: Count
    """One in so many profiles is in it."""
    edits: Count
    """Repairs in the file, which are not in it."""


class Opened(Model):
    """A document is open: to who asked, and to everybody when it is first opened."""

    kind: Literal["opened"] = "opened"
    id: Count | None
    scan: Opaque
    name: str
    revision: Count
    epoch: Count
    steps: Count
    """Of the plan."""
    textured: bool
    """There are texture images, which the surface has its colours from."""
    grids: list[GridEntry]
    figures: Figures
    history: list[HistoryEntry]
    cursor: Count
    branches: list[BranchEntry]
    scanned_picture: str
    """As that of an edit, before all of them."""
    findings: list[Remark]
    measures: list[Measure]
    settings: ScanSettings
    fields: dict[str, dict[str, Any]]
    """What each of the settings may be, by name, in the words of JSON Schema."""


class Closed(Model):
    """A document was closed, since its file is renamed or in the bin."""

    kind: Literal["closed"] = "closed"
    scan: Opaque


class Append(Model):
    """New vertices and faces at the end: positions, faces, measured, sigma, laser, step, line."""

    kind: Literal["append"] = "append"


class Truncate(Model):
    """Only so many vertices and faces are left: what was appended last is removed."""

    kind: Literal["truncate"] = "truncate"
    vertices: Count
    faces: Count


class Alive(Model):
    """Faces (array faces u32) that die or come back."""

    kind: Literal["alive"] = "alive"
    value: bool


class Verts(Model):
    """Vertices that moved: arrays ids u32 (k), positions f32 (k, 3)."""

    kind: Literal["verts"] = "verts"


class Replace(Model):
    """Another mesh altogether, of a new epoch: get it."""

    kind: Literal["replace"] = "replace"


Part = Annotated[Append | Truncate | Alive | Verts | Replace, Field(discriminator="kind")]


class Patch(Model):
    """What one edit did to the surface: parts, to be done in this order, all or none.

    The arrays of part k are named ``k.faces`` and so on.
    """

    kind: Literal["patch"] = "patch"
    scan: Opaque
    revision: Count
    epoch: Count
    text: str
    parts: list[Part]
    figures: Figures


class History(Model):
    """The list of edits; those from ``cursor`` on are undone."""

    kind: Literal["history"] = "history"
    scan: Opaque
    history: list[HistoryEntry]
    cursor: Count
    branches: list[BranchEntry]
    scanned_picture: str
    """As that of an edit, before all of them."""


class GridChanged(Model):
    """Rows of a grid are others now: get them."""

    kind: Literal["grid"] = "grid"
    scan: Opaque
    grid: Count
    steps: list[Count]


class PreviewShown(Model):
    """What an edit would do: arrays positions f32 (v, 3), faces u32 (f, 3) that it would add and
    dead u32 that it would take away. Nothing is stored."""

    kind: Literal["preview"] = "preview"
    id: Count
    figures: Figures


class ColoursShown(Model):
    """Colours of the surface from its texture images. Array ``colour`` (v, 3): u8, of each vertex,
    grey where no image shows it."""

    kind: Literal["colours"] = "colours"
    id: Count
    scan: Opaque
    revision: Count

"""Requests that change an open scan, or try what a change would do."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from turnscan.app._protocol import Count, Opaque
from turnscan.app._requests._base import Request


class EditRequest(Request):
    """Do an edit: ``done`` after its patch. With ``preview``, answered by ``preview``.

    ``edit`` is one of the values of `turnscan.edit`, its ``faces`` or ``vertices`` left out where
    they are arrays of the envelope.
    """

    kind: Literal["edit"] = "edit"
    scan: Opaque
    base_revision: Count
    edit: dict[str, Any]
    preview: bool = False


class Undo(Request):
    """One edit back."""

    kind: Literal["undo"] = "undo"
    scan: Opaque


class Redo(Request):
    """One edit on again."""

    kind: Literal["redo"] = "redo"
    scan: Opaque


class GoTo(Request):
    """To the state after an edit, of the history or of a branch, which becomes the history."""

    kind: Literal["go_to"] = "go_to"
    scan: Opaque
    edit: Count
    """Its number; 0: as scanned."""


class NameEdit(Request):
    """Name an edit, of a branch too; an empty name takes it away."""

    kind: Literal["name_edit"] = "name_edit"
    scan: Opaque
    edit: Count
    name: Annotated[str, Field(max_length=80)]


class Switch(Request):
    """One edit of the list off or on again, all others as they are."""

    kind: Literal["switch"] = "switch"
    scan: Opaque
    edit: Count
    on: bool


class CopyEdits(Request):
    """Add edits of a scan to another one, in their order; a document of that is closed.

    ``done`` says which of them do not fit there.
    """

    kind: Literal["copy_edits"] = "copy_edits"
    scan: Opaque
    edits: Annotated[tuple[Count, ...], Field(min_length=1)]
    """Their numbers."""
    to: Opaque
    by_shape: bool = False
    """Whether the part stands elsewhere there: measurements are brought along by its shape."""


class TrySettings(Request):
    """What settings would make of a few profiles and a patch: answered by ``settings_tried``.

    An earlier trial of the same browser that is still under way is refused as ``cancelled``.
    """

    kind: Literal["try_settings"] = "try_settings"
    scan: Opaque
    options: dict[str, Any]
    grid: Count
    step: Count | None = None
    """None takes the middle one."""


class CompareSettings(Request):
    """Two settings side by side, with all edits: answered by ``settings_compared``."""

    kind: Literal["compare_settings"] = "compare_settings"
    scan: Opaque
    first: dict[str, Any]
    """Options by name; those left out are at their default."""
    second: dict[str, Any]
    gap: Annotated[float, Field(gt=0, le=1000)] = 0.2
    """mm: what is further than this from the other surface has no counterpart there."""

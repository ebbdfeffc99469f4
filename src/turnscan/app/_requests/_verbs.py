"""Requests of verbs, and of the files that they take."""

from __future__ import annotations

from typing import Any, Literal

from turnscan.app._protocol import Count, Name
from turnscan.app._requests._base import Request


class ListVerbs(Request):
    """Answered by ``verbs``."""

    kind: Literal["list_verbs"] = "list_verbs"


class ListFiles(Request):
    """Answered by ``files``."""

    kind: Literal["list_files"] = "list_files"


class RunVerb(Request):
    """Run a verb as a job: its findings, text and files are what it came to.

    ``values`` are those of its schema: options as they are, inputs by the opaque names of files
    and scans, outputs by the suffixes that are wanted. What is left out has its default.
    """

    kind: Literal["run_verb"] = "run_verb"
    verb: Name
    name: Name
    """Of the files that it writes."""
    values: dict[str, Any]


class PreviewImport(Request):
    """What an import would make of pictures: answered by ``import_preview``; nothing is written.

    ``values`` are those of the verb ``import``; of its options those about pictures count.
    """

    kind: Literal["preview_import"] = "preview_import"
    values: dict[str, Any]
    laser: str = ""
    """Whose picture is shown; empty for the first one."""
    picture: Count | None = None
    """Its place in the series; None takes the middle one."""

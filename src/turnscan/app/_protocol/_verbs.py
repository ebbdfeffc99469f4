"""Messages of verbs, and of the files that they take and write."""

from __future__ import annotations

from typing import Any, Literal

from turnscan.app._protocol._base import Count, Model, Opaque, Remark


class FileEntry(Model):
    """A file, or a folder of pictures, that verbs may take or have written."""

    file: Opaque
    name: str
    kinds: list[str]
    """What it can be to a verb, as ``accepts`` in schemas; empty for a result that none takes."""
    pictures: Count
    """Of a folder."""
    megabytes: float
    modified: str
    """ISO time, UTC."""
    sent: bool
    """Whether a browser sent it: it goes when the server ends."""
    takers: list[str]
    """Verbs that take it."""


class ResultFile(Model):
    """A file that a verb wrote into the folder."""

    file: Opaque
    name: str
    scan: bool
    """Whether it is a scan, to be opened as such; others are at ``/api/files/{file}``."""


class ResultTable(Model):
    """What a verb found out, as a table."""

    title: str
    head: list[str]
    rows: list[list[str]]


class VerbEntry(Model):
    """A verb that the server runs: ``run_verb``."""

    verb: str
    title: str
    group: str
    json_schema: dict[str, Any]
    """JSON Schema (draft 2020-12) of its values: `turnscan.workflows.Verb`."""


class Verbs(Model):
    """What the server does with files."""

    kind: Literal["verbs"] = "verbs"
    id: Count
    verbs: list[VerbEntry]


class Files(Model):
    """The files that verbs take; to everybody where they have changed."""

    kind: Literal["files"] = "files"
    id: Count | None
    files: list[FileEntry]


class SeriesSeen(Model):
    """What was recognised in the pictures of one laser."""

    laser: str
    pictures: list[str]
    """Their names, in the order of their steps."""
    steps: list[Count]
    """Of the pictures."""
    missing: list[Count]
    """Steps without a picture."""
    background: str
    """Where the pictures without laser come from, in words."""
    noise: float
    threshold: float
    """Grey levels."""
    line_share: float
    """Share of the lines of the samples with a stripe that is a line."""


class ImportPreviewed(Model):
    """What an import would make of pictures: arrays jpeg u8 (bytes) of one of them, and stripe f32
    (lines), NaN where there is none."""

    kind: Literal["import_preview"] = "import_preview"
    id: Count
    series: list[SeriesSeen]
    weights: list[float] | None
    """Of red, green and blue in the laser's light; None for grey pictures."""
    findings: list[Remark]
    laser: str
    picture: Count
    step: Count
    width: Count
    height: Count
    orientation: Literal["vertical", "horizontal"]

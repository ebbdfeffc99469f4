"""Messages of the scan files in the folder, and of its bin."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque


class FindingCounts(Model):
    """How many findings a scan has."""

    errors: Count
    warnings: Count
    notes: Count


class ScanEntry(Model):
    """A scan file in the list; its picture is at ``/api/scans/{scan}/thumbnail.png``, the file at
    ``/api/scans/{scan}/file``."""

    scan: Opaque
    name: str
    megabytes: float
    modified: str
    """ISO time, UTC."""
    open: bool
    missing: Count
    """Steps that ``resume`` would take; 0 where the scan is whole, or it cannot be resumed."""
    content: str
    """Other where its frames, edits or settings are others; empty where it cannot be read."""
    simulated: bool
    """Whether its pictures are of no real part."""
    findings: FindingCounts | None
    """As it was when it was last open; None where it was not, or has changed since."""


class BinEntry(Model):
    """A scan in the bin."""

    binned: Opaque
    name: str
    megabytes: float
    at: str
    """ISO time of its deletion, UTC."""


class Scans(Model):
    """The list of scan files has changed."""

    kind: Literal["scans"] = "scans"
    scans: list[ScanEntry]
    binned: list[BinEntry]

"""What a gallery of scans shows of each file; scan files copied and renamed."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from turnscan.errors import TurnscanError
from turnscan.picture import brightened, png, shrunk
from turnscan.scan import Scan, copy_scan
from turnscan.workflows._scanning._scan import left_in

THUMBNAIL = (320, 240)
"""px, width and height."""


@dataclass(frozen=True)
class ScanGlance:
    """What is known of a scan file without making its surface."""

    missing: int
    """Steps that `resume` would take."""
    content: str
    """Other where its frames, edits or settings are others; empty where it cannot be read."""
    simulated: bool = False
    """Whether its pictures are of no real part."""


def glance_at(path: Path) -> ScanGlance:
    """Look at a scan file, whatever it is: one that is damaged or none has no content."""
    try:
        with Scan.open(path) as scan:
            edits = scan.edits()
            last = edits[-1].digest.hex() if edits else ""
            said = f"{scan.digest} {len(edits)} {last} {scan.settings}"
            missing = 0
            with suppress(TurnscanError):  # of one that was imported
                at = left_in(scan)
                missing = at.steps - at.done
            simulated = bool(scan.plan.simulated)
    except TurnscanError:
        return ScanGlance(0, "")
    return ScanGlance(missing, hashlib.sha256(said.encode()).hexdigest()[:16], simulated)


def frame_thumbnail(path: Path) -> bytes:
    """A picture of the middle of a scan as PNG: the part as the camera saw it, and the stripe.

    Raises as `Scan.open`, and InputError for a scan without frames.
    """
    with Scan.open(path) as scan:
        steps = scan.steps(scan.plan.lasers[0])
        lit = scan.frame(steps[len(steps) // 2] if steps else 0).lit
    return png(brightened(shrunk(lit, THUMBNAIL[0])))


def duplicate_scan(source: Path, target: Path, *, keep: bool = True) -> None:
    """Copy a scan file with its edits, also while it is open; without ``keep`` move it, damaged or
    not, while nobody writes it. Raises as `copy_scan`.
    """
    copy_scan(source, target, keep=keep)
    if keep:
        with Scan.open(target):
            return

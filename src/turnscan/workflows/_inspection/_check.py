"""Check: is a scan file whole, or a mesh sound, and what is in it?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.errors import FormatError, InputError, ScanCorrupt, ScanNewer
from turnscan.findings import Finding, record
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.rig import rig_hash
from turnscan.scan import Scan, ScanPlan
from turnscan.workflows._files._history import history_of
from turnscan.workflows._inspection._check_mesh import CheckedMesh, check_mesh
from turnscan.workflows._options._units import IGES_SUFFIXES, STEP_SUFFIXES

_MESHES = (".stl", ".ply", ".obj", ".3mf", ".glb", ".dxf")
_WITHOUT_FACES = {
    ".xyz": "points",
    **dict.fromkeys((*STEP_SUFFIXES, *IGES_SUFFIXES), "curved surfaces"),
}
"""What is in files that turnscan writes, but does not check."""
_OF_PLAN = (
    "width", "height", "dtype", "channels", "weights", "keep", "threshold", "orientation",
    "steps", "source",
)  # fmt: skip
_UNEVEN = 0.5
"""A step that differs from the median one by more than this part of it is worth a word."""


@dataclass(frozen=True)
class CheckedLaser:
    """What there is of one laser in a scan file."""

    frames: int
    steps: int
    """That have a frame; fewer than frames where each was taken with several exposures."""
    missing: dict[str, str]
    """Why there is no frame, by step."""
    first_deg: float | None
    """Table angle of the first frame with a known one; None where there is none."""
    last_deg: float | None
    step_deg: float | None
    """Median step between neighbouring frames; None where no two have an angle."""


@dataclass(frozen=True)
class CheckedScan:
    """What a scan file holds, and whether it is whole."""

    path: Path
    plan: ScanPlan
    size_bytes: int
    """Of the file."""
    raw_bytes: int
    """Of its pictures, unpacked."""
    rig: str | None
    """Hash of the rig in it; None where there is none."""
    complete: bool
    """Whether every frame is there, or known to be missing."""
    closed: bool
    """Whether the file was closed properly."""
    lasers: dict[str, CheckedLaser]
    edits: int | None
    """How many edits count; None where the log cannot be read."""
    findings: tuple[Finding, ...]

    @property
    def summary(self) -> list[str]:
        """What the file holds, in a few lines."""
        plan = self.plan
        kind = "colour" if plan.channels == 3 else "grey"
        lines = [
            f"{self.path}: {self.size_bytes / 1e6:.1f} MB, {plan.width}×{plan.height} {kind} "
            f"{plan.dtype}, {plan.keep} frames" + (f", {plan.source}" if plan.source else ""),
            f"rig: {self.rig[:12] if self.rig else 'none'}",
        ]
        if plan.simulated:
            lines.insert(1, "SIMULATED: these are pictures of no real part")
        for name, laser in self.lasers.items():
            angles = "angles unknown"
            if laser.first_deg is not None:
                angles = f"{laser.first_deg:.2f}° … {laser.last_deg:.2f}°"
            if laser.step_deg is not None:
                angles += f", usual step {laser.step_deg:.3f}°"
            lines.append(f"laser {name}: {laser.steps} of {plan.steps} steps, {angles}")
            if laser.frames != laser.steps:
                lines[-1] += f"; {laser.frames} frames of several exposures"
        if self.edits:
            lines.append(f"{self.edits} edits; see turnscan edits")
        return lines

    @property
    def verdict(self) -> str:
        """Whether the file is whole, in words."""
        return "DAMAGED" if self.damaged else "intact: every frame matches its checksum"

    def figures(self) -> dict[str, Any]:
        """All of it by name, to go into JSON."""
        body = asdict(self)
        start = {"file": str(body.pop("path")), "bytes": body.pop("size_bytes")}
        start["raw_bytes"] = body.pop("raw_bytes")
        plan = body.pop("plan")
        start |= {name: plan[name] for name in _OF_PLAN}
        return start | body | {"findings": [record(f) for f in self.findings]}

    @property
    def damaged(self) -> bool:
        """Whether something in the file does not match its checksum."""
        return any(f.severity == "error" for f in self.findings)


def check(path: str | PathLike[str], progress: Progress = no_progress) -> CheckedScan | CheckedMesh:
    """Read all of a file and say what it holds, and whether it is whole.

    Parameters
    ----------
    path
        A scan, compared with its checksums, or a mesh (STL, PLY, OBJ, 3MF, GLB, DXF): closed,
        manifold, oriented, free of self-intersections.
    progress
        Told how far it is; it may cancel.

    Returns
    -------
    CheckedScan or CheckedMesh
        With findings; a warning or an error among them says what is wrong with the file.

    Raises
    ------
    FormatError
        The file is neither a scan nor a mesh.
    InputError, ScanError
        It cannot be read at all.
    Cancelled
        By ``progress``.

    >>> import turnscan as ts
    >>> found = ts.check("cup.turnscan")
    >>> found.complete, found.findings
    (True, ())
    """
    path = Path(path)
    if path.suffix.lower() in _MESHES:
        return check_mesh(path)
    with _opened(path) as scan:
        found = _damage(scan, progress.subrange(0, 1, "checking"))
        lasers = {name: _laser(scan, name, found) for name in scan.plan.lasers}
        found += _state(scan)
        edits = _edits(scan, found)
        plan = scan.plan
        pixels = len(scan) * plan.width * plan.height
        return CheckedScan(
            path=scan.path,
            plan=plan,
            size_bytes=_size(scan.path),
            raw_bytes=pixels * plan.channels * np.dtype(plan.dtype).itemsize,
            rig=None if scan.rig is None else rig_hash(scan.rig),
            complete=scan.complete,
            closed=scan.sealed,
            lasers=lasers,
            edits=edits,
            findings=tuple(found),
        )


def _size(file: Path) -> int:
    """Bytes of a scan file, with what is not yet merged into it while it is written."""
    log = file.with_name(file.name + "-wal")
    return file.stat().st_size + (log.stat().st_size if log.exists() else 0)


def _opened(file: Path) -> Scan:
    try:
        return Scan.open(file)
    except FormatError as e:
        hint = f"name a scan file, or a mesh ({', '.join(_MESHES)})"
        holds = _WITHOUT_FACES.get(file.suffix.lower())
        if holds is None:
            raise FormatError(e.message, hint=hint) from None
        raise FormatError(f"{file}: holds {holds}, and no faces to check", hint=hint) from None


def _damage(scan: Scan, progress: Progress) -> list[Finding]:
    found = []
    count = progress.counter(len(scan))
    for name, trouble in scan.verify():
        count()
        if trouble is not None:
            found.append(Finding("scan.damaged", "error", trouble.message, name, trouble.hint))
    return found


def _state(scan: Scan) -> list[Finding]:
    """Whether the scan is still being taken, or was never closed."""
    if scan.being_written:
        return [
            Finding("scan.in-progress", "note", "the scan is running: these are the frames so far")
        ]
    if scan.sealed:
        return []
    return [
        Finding(
            "scan.not-closed",
            "warning",
            "the file was not closed properly; all acknowledged frames are present",
            remedy="finish it with turnscan resume",
        )
    ]


def _edits(scan: Scan, found: list[Finding]) -> int | None:
    """How many edits count; None where the log cannot be read."""
    try:
        return len(history_of(scan).enabled)
    except ScanCorrupt:
        return None  # `_damage` has said so
    except (InputError, ScanNewer) as e:
        found.append(Finding("scan.edits", "warning", e.message, "the log of edits", e.hint))
        return None


def _laser(scan: Scan, name: str, found: list[Finding]) -> CheckedLaser:
    """What there is of one laser; adds what is odd to ``found``."""
    missing = scan.missing(name)
    if missing:
        shown = ", ".join(str(step) for step in list(missing)[:8])
        found.append(
            Finding(
                "scan.missing-step",
                "note" if scan.being_written else "warning",
                f"{len(missing)} of {scan.plan.steps} steps have no frame",
                where=f"laser {name}, steps {shown}{' …' if len(missing) > 8 else ''}",
                remedy="take them with turnscan resume, or accept the gap",
            )
        )
    angles = np.degrees(scan.angles(name))
    known = angles[~np.isnan(angles)]
    if len(known) < len(angles):
        found.append(
            Finding(
                "scan.no-angle",
                "warning",
                f"{len(angles) - len(known)} of {len(angles)} frames have no table angle",
                where=f"laser {name}",
                remedy=Remedy("import again with ", Option("angles")),
            )
        )
    return CheckedLaser(
        frames=len(angles),
        steps=len(set(scan.steps(name))),
        missing={str(step): cause for step, cause in missing.items()},
        first_deg=float(known[0]) if len(known) else None,
        last_deg=float(known[-1]) if len(known) else None,
        step_deg=_usual_step(np.array(scan.steps(name)), angles, name, found),
    )


def _usual_step(
    steps: np.ndarray, angles: np.ndarray, name: str, found: list[Finding]
) -> float | None:
    """Median step in degrees; adds a finding where some differ from it."""
    per_step = np.diff(angles) / np.maximum(np.diff(steps), 1)
    per_step = per_step[~np.isnan(per_step) & (np.diff(steps) > 0)]
    if not len(per_step):
        return None
    usual = float(np.median(per_step))
    odd = np.abs(per_step - usual) > _UNEVEN * abs(usual)
    if odd.any():
        found.append(
            Finding(
                "scan.uneven-steps",
                "note",
                f"{int(odd.sum())} of {len(per_step)} steps differ from the usual {usual:.3f}° by "
                f"more than half of it",
                where=f"laser {name}",
            )
        )
    return usual

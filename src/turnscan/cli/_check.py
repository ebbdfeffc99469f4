"""``turnscan check``: is a scan file whole, or a mesh sound, and what is in it?"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np

from turnscan.cli._edit_source import history_of
from turnscan.cli._progress import progress
from turnscan.errors import FormatError, InputError, ScanCorrupt, ScanNewer
from turnscan.findings import Finding, findings_json
from turnscan.rig import rig_hash
from turnscan.scan import Scan

_MESHES = (".stl", ".ply", ".obj", ".3mf", ".glb", ".dxf")
_UNEVEN = 0.5
"""A step that differs from the median one by more than this part of it is worth a word."""


@click.command("check")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def verb(file: Path, as_json: bool) -> None:
    """Read all of FILE and say what it holds, and whether it is whole.

    FILE is a scan, compared with its checksums, or a mesh (STL, PLY, OBJ, 3MF, GLB, DXF): closed,
    manifold, oriented, cutting nowhere through itself. Exit code 1 when there is a warning or an
    error among the findings.
    """
    if file.suffix.lower() in _MESHES:
        from turnscan.cli._check_mesh import check_mesh

        check_mesh(file, as_json)
        return
    with _opened(file) as opened:
        found = _damage(opened)
        lasers = {name: _laser(opened, name, found) for name in opened.plan.lasers}
        if opened.being_written:
            found.append(
                Finding("scan.in-progress", "note", "it is being taken: this is what is there now")
            )
        elif not opened.sealed:
            found.append(
                Finding(
                    "scan.not-closed",
                    "warning",
                    "the file was not closed properly; everything acknowledged is there",
                    remedy="finish it with turnscan resume",
                )
            )
        edits = _edits(opened, found)
        report = {
            **_report(opened, lasers),
            "edits": edits,
            "findings": json.loads(findings_json(found)),
        }
    click.echo(json.dumps(report, indent=1, allow_nan=False) if as_json else _text(report, found))
    if any(f.severity != "note" for f in found):
        sys.exit(1)


def _opened(file: Path) -> Scan:
    try:
        return Scan.open(file)
    except FormatError as e:
        known = ", ".join(_MESHES)
        raise FormatError(e.message, hint=f"name a scan file, or a mesh ({known})") from None


def _damage(scan: Scan) -> list[Finding]:
    found = []
    with progress("checking", len(scan)) as tick:
        for name, trouble in scan.verify():
            tick()
            if trouble is not None:
                found.append(Finding("scan.damaged", "error", trouble.message, name, trouble.hint))
    return found


def _edits(scan: Scan, found: list[Finding]) -> int | None:
    """How many edits count; None where the log cannot be read."""
    try:
        return len(history_of(scan).enabled)
    except ScanCorrupt:
        return None  # `_damage` has said so
    except (InputError, ScanNewer) as e:
        found.append(Finding("scan.edits", "warning", e.message, "the log of edits", e.hint))
        return None


def _laser(scan: Scan, name: str, found: list[Finding]) -> dict[str, Any]:
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
                remedy="take them with turnscan resume, or live with the gap",
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
                remedy="import again with --angles",
            )
        )
    steps = np.array(scan.steps(name))
    per_step = np.diff(angles) / np.maximum(np.diff(steps), 1)
    per_step = per_step[~np.isnan(per_step) & (np.diff(steps) > 0)]
    usual = float(np.median(per_step)) if len(per_step) else math.nan
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
    return {
        "frames": len(angles),
        "missing": {str(step): cause for step, cause in missing.items()},
        "first_deg": float(known[0]) if len(known) else None,
        "last_deg": float(known[-1]) if len(known) else None,
        "step_deg": None if math.isnan(usual) else usual,
    }


def _report(scan: Scan, lasers: dict[str, Any]) -> dict[str, Any]:
    plan = scan.plan
    itemsize = np.dtype(plan.dtype).itemsize
    return {
        "file": str(scan.path),
        "bytes": scan.path.stat().st_size,
        "raw_bytes": len(scan) * plan.width * plan.height * plan.channels * itemsize,
        "width": plan.width,
        "height": plan.height,
        "dtype": plan.dtype,
        "channels": plan.channels,
        "weights": plan.weights,
        "keep": plan.keep,
        "threshold": plan.threshold,
        "orientation": plan.orientation,
        "steps": plan.steps,
        "source": plan.source,
        "rig": None if scan.rig is None else rig_hash(scan.rig),
        "complete": scan.complete,
        "closed": scan.sealed,
        "lasers": lasers,
    }


def _text(report: dict[str, Any], found: list[Finding]) -> str:
    kind = "colour" if report["channels"] == 3 else "grey"
    lines = [
        f"{report['file']}: {report['bytes'] / 1e6:.1f} MB, {report['width']}×{report['height']} "
        f"{kind} {report['dtype']}, {report['keep']} frames"
        + (f", {report['source']}" if report["source"] else ""),
        f"rig: {report['rig'][:12] if report['rig'] else 'none'}",
    ]
    for name, laser in report["lasers"].items():
        angles = "angles unknown"
        if laser["first_deg"] is not None:
            angles = f"{laser['first_deg']:.2f}° … {laser['last_deg']:.2f}°"
        if laser["step_deg"] is not None:
            angles += f", usual step {laser['step_deg']:.3f}°"
        lines.append(f"laser {name}: {laser['frames']} of {report['steps']} steps, {angles}")
    if report["edits"]:
        lines.append(f"{report['edits']} edits; see turnscan edits")
    lines += [str(f) for f in found]
    damaged = any(f.severity == "error" for f in found)
    lines.append("DAMAGED" if damaged else "whole: every frame agrees with its checksum")
    return "\n".join(lines)

"""``turnscan check``: is a scan file whole, or a mesh sound, and what is in it?"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags
from turnscan.findings import Finding, findings_json

_OF_PLAN = (
    "width", "height", "dtype", "channels", "weights", "keep", "threshold", "orientation",
    "steps", "source",
)  # fmt: skip


@click.command("check")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def verb(file: Path, as_json: bool) -> None:
    """Read FILE completely; report its contents and whether it is intact.

    FILE is a scan, compared with its checksums, or a mesh (STL, PLY, OBJ, 3MF, GLB, DXF): closed,
    manifold, oriented, free of self-intersections. Exit code 1 when there is a warning or an
    error among the findings.
    """
    with progress_bar() as bar:
        done = workflows.check(file, bar)
    found = [with_flags(finding) for finding in done.findings]
    if as_json:
        body = _body(done) | {"findings": json.loads(findings_json(found))}
        click.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        lines = (
            _of_mesh(done, found)
            if isinstance(done, workflows.CheckedMesh)
            else _of_scan(done, found)
        )
        click.echo("\n".join(lines))
    if any(f.severity != "note" for f in found) or (
        found and isinstance(done, workflows.CheckedMesh)
    ):
        sys.exit(1)


def _body(done: workflows.CheckedScan | workflows.CheckedMesh) -> dict[str, Any]:
    body = asdict(done)
    start: dict[str, Any] = {"file": str(body.pop("path")), "bytes": body.pop("size_bytes")}
    if isinstance(done, workflows.CheckedScan):
        plan = body.pop("plan")
        start["raw_bytes"] = body.pop("raw_bytes")
        start |= {name: plan[name] for name in _OF_PLAN}
    return start | body


def _of_scan(done: workflows.CheckedScan, found: Sequence[Finding]) -> list[str]:
    plan = done.plan
    kind = "colour" if plan.channels == 3 else "grey"
    lines = [
        f"{done.path}: {done.size_bytes / 1e6:.1f} MB, {plan.width}×{plan.height} "
        f"{kind} {plan.dtype}, {plan.keep} frames" + (f", {plan.source}" if plan.source else ""),
        f"rig: {done.rig[:12] if done.rig else 'none'}",
    ]
    for name, laser in done.lasers.items():
        angles = "angles unknown"
        if laser.first_deg is not None:
            angles = f"{laser.first_deg:.2f}° … {laser.last_deg:.2f}°"
        if laser.step_deg is not None:
            angles += f", usual step {laser.step_deg:.3f}°"
        lines.append(f"laser {name}: {laser.frames} of {plan.steps} steps, {angles}")
    if done.edits:
        lines.append(f"{done.edits} edits; see turnscan edits")
    lines += [str(f) for f in found]
    return [*lines, "DAMAGED" if done.damaged else "intact: every frame matches its checksum"]


def _of_mesh(done: workflows.CheckedMesh, found: Sequence[Finding]) -> list[str]:
    volume = "" if done.volume_mm3 is None else f", volume {done.volume_mm3:.2f} mm³"
    marked = f"{done.faces_not_measured} not measured"
    if done.faces_not_measured is None:
        marked = "STL cannot mark the measured faces"
    return [
        f"{done.path}: {done.size_bytes / 1e6:.1f} MB, {done.vertices} vertices, "
        f"{done.faces} faces ({marked}){volume}",
        *(str(f) for f in found),
        "NOT SOUND" if found else "sound: closed, manifold, no self-intersections",
    ]

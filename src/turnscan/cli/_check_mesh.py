"""``turnscan check`` of a mesh file: is it sound enough to print or machine?"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from turnscan.cli._input import read_mesh_file
from turnscan.findings import Finding, findings_json
from turnscan.surface import Mesh, holes, is_closed, soundness


def check_mesh(path: Path, as_json: bool) -> None:
    """Say whether a mesh is closed and sound; exit code 1 when it is not."""
    mesh = read_mesh_file(path)
    closed, borders, found = is_closed(mesh), holes(mesh), soundness(mesh)
    if not closed:
        size = f", the largest {borders[0].size:.2f} mm across" if borders else ""
        text = f"the surface has {len(borders)} open borders{size}"
        found.append(Finding("surface.open", "warning", text, "", "close it before it is made"))
    report = {
        "file": str(path),
        "bytes": path.stat().st_size,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "faces_not_measured": _not_measured(path, mesh),
        "closed": closed,
        "volume_mm3": mesh.volume if closed else None,
        "findings": json.loads(findings_json(found)),
    }
    if as_json:
        click.echo(json.dumps(report, indent=1, allow_nan=False))
    else:
        volume = f", volume {mesh.volume:.2f} mm³" if closed else ""
        marked = f"{report['faces_not_measured']} not measured"
        if report["faces_not_measured"] is None:
            marked = "an STL does not say which were measured"
        click.echo(
            f"{path}: {report['bytes'] / 1e6:.1f} MB, {report['vertices']} vertices, "
            f"{report['faces']} faces ({marked}){volume}"
        )
        for finding in found:
            click.echo(str(finding))
        click.echo("NOT SOUND" if found else "sound: closed, manifold, does not cut through itself")
    if found:
        sys.exit(1)


def _not_measured(path: Path, mesh: Mesh) -> int | None:
    """How many faces were not measured; None in a format that cannot say so."""
    if path.suffix.lower() == ".stl":
        return None
    return 0 if mesh.measured is None else int((~mesh.measured).sum())

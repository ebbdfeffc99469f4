"""``turnscan check``: is a scan file whole, or a mesh sound, and what is in it?"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags
from turnscan.findings import findings_json


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
        body = done.figures() | {"findings": json.loads(findings_json(found))}
        click.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        click.echo("\n".join([*done.summary, *map(str, found), done.verdict]))
    if any(f.severity != "note" for f in found) or (
        found and isinstance(done, workflows.CheckedMesh)
    ):
        sys.exit(1)

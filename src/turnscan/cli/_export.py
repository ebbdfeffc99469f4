"""``turnscan export``: a mesh file in another format."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._output import format_options
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


@click.command("export")
@click.argument("source", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "outputs",
    required=True,
    multiple=True,
    type=click.Path(path_type=Path),
    help="File to write; its suffix names the format. May be repeated.",
)
@flags_of(workflows.ReconstructOptions, "decimate")
@format_options
def verb(
    source: Path,
    outputs: tuple[Path, ...],
    options: workflows.ReconstructOptions,
    formats: workflows.ExportOptions,
) -> None:
    """Write the mesh in SOURCE, or of a scan (.turnscan), in other formats, and audit them.

    Each is chosen by its suffix: .dxf .stl .ply .obj .3mf .glb .xyz .step. A scan is reconstructed
    with its own settings. STEP holds the solid that the part's shapes close to, else its triangles.
    """
    workflows.check_targets(outputs, [source])
    with progress_bar() as progress:
        done = workflows.export(
            source, *outputs, formats=formats, decimate=options.decimate, progress=progress
        )
    for finding in done.findings:
        click.echo(with_flags(finding), err=True)
    for remark in done.remarks:
        click.echo(with_flags(remark), err=remark.severity != "note")
    for path in outputs:
        size = f"{len(done.mesh.vertices)} points"
        if path.suffix.lower() != ".xyz":
            size = f"{len(done.mesh.vertices)} vertices, {len(done.mesh.faces)} faces"
        click.echo(f"{path}: {size}, {path.stat().st_size / 1e6:.2f} MB, read back the same")

"""``turnscan export``: a mesh file in another format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from turnscan import surface
from turnscan.cli._decimation import Fewer, decimate_option
from turnscan.cli._input import read_mesh_file
from turnscan.cli._output import check_apart, check_output, format_options, write_results
from turnscan.errors import InputError
from turnscan.export import ExportOptions, exporter_for


@click.command("export")
@click.argument("source", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "outputs",
    required=True,
    multiple=True,
    type=click.Path(path_type=Path),
    help="File to write; its suffix names the format. May be given several times.",
)
@decimate_option
@format_options
def verb(
    source: Path, outputs: tuple[Path, ...], decimate: Fewer | None, options: ExportOptions
) -> None:
    """Write the mesh in SOURCE in other formats, and audit them.

    Each is chosen by its suffix: .dxf .stl .ply .obj .3mf .glb .xyz.
    """
    if "profiles" in options.dxf_forms:
        raise InputError(
            "a mesh file holds no profiles", hint="use turnscan reconstruct --dxf-form profiles"
        )
    check_apart(outputs)
    for path in outputs:
        exporter_for(path.suffix)
        check_output(path, inputs=[source])
    mesh = read_mesh_file(source)
    if decimate is not None:
        dense = mesh
        mesh = surface.decimate(dense, tolerance=decimate.tolerance, faces=decimate.faces)
        for finding in surface.decimation_findings(dense, mesh, decimate.faces):
            click.echo(str(finding), err=True)
    mesh = surface.settled(mesh)
    options = replace(options, about={"source": source.name})
    for remark in write_results(dict.fromkeys(outputs, mesh), options):
        click.echo(str(remark), err=remark.severity != "note")
    for path in outputs:
        size = f"{len(mesh.vertices)} points"
        if path.suffix.lower() != ".xyz":
            size = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces"
        click.echo(f"{path}: {size}, {path.stat().st_size / 1e6:.2f} MB, read back the same")

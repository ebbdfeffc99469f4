"""``turnscan section``: planes through a part as dimensioned drawings."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from turnscan import workflows
from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress_bar


@click.command("section")
@click.argument("part", type=click.Path(path_type=Path))
@click.option(
    "--plane",
    "planes",
    multiple=True,
    help="Cutting plane: z=20, x=0, z=10:100:10 (from, to, step), or nx,ny,nz,distance, in mm; "
    "may be repeated.",
)
@click.option(
    "--half-plane-deg",
    "half_planes",
    type=Finite(),
    multiple=True,
    help="Cut along the half-plane from the rotation axis at this angle, degrees; may be repeated.",
)
@click.option(
    "--tolerance",
    type=Finite(),
    help="Largest deviation of fitted lines and arcs from the points beyond their noise, mm.  "
    "[default: three times the noise, at least 1/10000 of the size]",
)
@click.option(
    "-o",
    "--output",
    "outputs",
    required=True,
    multiple=True,
    type=click.Path(path_type=Path),
    help=f"File to write: {' '.join(workflows.SECTION_SUFFIXES)}. May be repeated.",
)
@click.option(
    "--dxf-version",
    "version",
    type=click.Choice(["R12", "R2010"]),
    default="R2010",
    show_default=True,
    help="DXF version; R12 has no splines and takes polylines in their place.",
)
def verb(
    part: Path,
    planes: tuple[str, ...],
    half_planes: tuple[float, ...],
    tolerance: float | None,
    outputs: tuple[Path, ...],
    version: Literal["R12", "R2010"],
) -> None:
    """Cut PART, a mesh (.ply .stl .obj .3mf .glb .dxf, mm) or a scan, and draw the sections.

    A .turnscan is reconstructed with the settings stored in it.

    Each section is drawn as measured, and as lines, arcs and splines fitted to it, with dimensions
    and their standard uncertainties. Only measured points are fitted; filled parts are on a layer
    of their own. Several sections are placed side by side in a DXF, and on a sheet each in SVG and
    PDF; the JSON holds every point with its sigma.
    """
    workflows.check_apart(outputs)
    for path in outputs:
        workflows.check_output(path, workflows.SECTION_SUFFIXES, inputs=[part])
    cuts = workflows.cuts_of(planes, half_planes)
    with progress_bar() as bar:
        sections = workflows.section(part, cuts, tolerance, bar)
    sections.save(*outputs, version=version)
    click.echo(sections)
    for path in outputs:
        click.echo(f"{path}: {len(sections)} section{'s' if len(sections) > 1 else ''}")

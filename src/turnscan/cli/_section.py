"""``turnscan section``: planes through a part as dimensioned drawings."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._found import tell_findings
from turnscan.cli._progress import progress_bar


@click.command("section")
@click.argument("part", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "outputs",
    required=True,
    multiple=True,
    type=click.Path(path_type=Path),
    help=f"File to write: {' '.join(workflows.SECTION_SUFFIXES)}. May be repeated.",
)
@flags_of(workflows.SectionOptions)
def verb(
    part: Path,
    outputs: tuple[Path, ...],
    options: workflows.SectionOptions,
) -> None:
    """Cut PART, a mesh (.ply .stl .obj .3mf .glb .dxf, mm) or a scan, and draw the sections.

    A .turnscan is reconstructed with the settings stored in it.

    Each section is drawn as measured, and as lines, arcs and splines fitted to it, with dimensions
    and their standard uncertainties. Only measured points are fitted; filled parts are on a layer
    of their own. Several sections are placed side by side in a DXF, and on a sheet each in SVG and
    PDF; the JSON holds every point with its sigma. A section that misses the part is named, and the
    others are drawn; the exit code is 1 then.
    """
    workflows.check_apart(outputs)
    for path in outputs:
        workflows.check_output(path, workflows.SECTION_SUFFIXES, inputs=[part])
    cuts = workflows.cuts_of(
        options.plane, options.half_plane_deg, options.silhouette, options.unrolled
    )
    with progress_bar() as bar:
        sections = workflows.section(part, cuts, options.tolerance, bar)
    tell_findings(sections.findings)
    sections.save(*outputs, version=options.dxf_version)
    click.echo(sections)
    for path in outputs:
        click.echo(f"{path}: {len(sections)} section{'s' if len(sections) > 1 else ''}")
    if sections.findings:
        sys.exit(1)

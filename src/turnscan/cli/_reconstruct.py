"""``turnscan reconstruct``: a scan file, or placed range scans → points, mesh, CAD."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of, given
from turnscan.cli._output import format_options, report_option
from turnscan.cli._own_settings import chosen_options, settings_options, show_own
from turnscan.cli._progress import progress_bar
from turnscan.cli._show import show_result
from turnscan.errors import InputError

_path = click.Path(path_type=Path)


@click.command("reconstruct")
@click.argument("source", type=_path)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=_path,
    multiple=True,
    required=True,
    help="File to write, may be repeated; by suffix: .dxf .stl .ply .obj .3mf .glb .xyz .step.",
)
@click.option(
    "--rig", "rig_path", type=_path, help="rig.json.  [default: the one stored in the scan]"
)
@settings_options
@flags_of(workflows.RangeScanOptions, into="ranged")
@click.option(
    "--edits",
    default="own",
    metavar="own|none|FILE",
    show_default=True,
    help="Edits to apply: those stored in the scan, none, or those of another scan or .json file.",
)
@report_option(".html with pictures, or .json")
@format_options
def verb(
    source: Path,
    outputs: tuple[Path, ...],
    rig_path: Path | None,
    options: workflows.ReconstructOptions,
    base: str | None,
    name: str,
    ranged: workflows.RangeScanOptions,
    edits: str,
    reports: tuple[Path, ...],
    formats: workflows.ExportOptions,
) -> None:
    """Turn SOURCE into a surface and write it; each file is read back and compared.

    SOURCE is a scan file (.turnscan), in which the settings are stored, or the .conf file that
    places the range scans (PLY) of another scanner beside it. Findings go to stderr; the exit code
    is 1 where one is an error, and then nothing but the report is written.
    """
    ranges = source.suffix.lower() == ".conf"
    idle = given(*(_of_pictures() if ranges else workflows.declared(workflows.RangeScanOptions)))
    if idle:
        said = f"{', '.join(idle)}: no effect on {source}"
        raise InputError(said, hint="leave it out")
    inputs = [source] if rig_path is None else [source, rig_path]
    inputs += [] if edits in ("own", "none") else [Path(edits)]
    workflows.check_targets(outputs, inputs, reports, ranged.unit)
    rig = None if rig_path is None else workflows.read_rig_file(rig_path)
    chosen = options if ranges else chosen_options(source, options, base, name)
    with progress_bar() as progress:
        result = workflows.reconstruct(
            source,
            chosen,
            rig=rig,
            edits=edits,
            unit=ranged.unit,
            store=True,
            settings=name,
            progress=progress,
        )
    if chosen is None:
        show_own(result)
    show_result(result, outputs, reports, formats)


def _of_pictures() -> list[str]:
    """Parameters about stripes, the table or the rig: range scans have none of these."""
    has = dict(workflows.VERBS["range-scans"].declared)
    options = workflows.declared(workflows.ReconstructOptions)
    return ["rig_path", *(name for name in options if name not in has)]

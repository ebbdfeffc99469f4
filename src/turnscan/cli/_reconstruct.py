"""``turnscan reconstruct``: a scan file, or placed range scans → points, mesh, CAD."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click
from click.core import ParameterSource

from turnscan.cli._edit_source import wanted_history
from turnscan.cli._input import read_rig_file
from turnscan.cli._output import check_apart, check_output, format_options
from turnscan.cli._progress import progress
from turnscan.cli._reconstruct_report import about, check_report, finish
from turnscan.cli._settings import Limits, settings_options
from turnscan.errors import InputError
from turnscan.export import ExportOptions, exporter_for
from turnscan.pipeline import reconstruct
from turnscan.rig import Rig
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.settings import Settings

_OF_PICTURES = (
    "rig_path", "strategy", "choose", "threshold", "spacing", "spacing_by", "spacing_between",
    "every", "radius", "z_min", "z_max", "top", "bottom", "denoise", "outliers",
)  # fmt: skip
"""Options about stripes, the table or the rig: range scans have none of these."""
_OF_RANGES = ("unit",)
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
    help="File to write, may be repeated; by suffix: .dxf .stl .ply .obj .3mf .glb .xyz.",
)
@click.option("--rig", "rig_path", type=_path, help="rig.json; without it the scan file's own.")
@settings_options
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "inch"]),
    default="m",
    show_default=True,
    help="Unit of range scans (.conf input); results are always mm.",
)
@click.option(
    "--edits",
    default="own",
    metavar="own|none|FILE",
    show_default=True,
    help="Repairs to do: those kept in the scan, none, or those of another scan or .json file.",
)
@click.option("--report", type=_path, help="Report to write: .html with pictures, or .json.")
@format_options
def verb(
    source: Path,
    outputs: tuple[Path, ...],
    rig_path: Path | None,
    unit: str,
    edits: str,
    report: Path | None,
    settings: Settings,
    limits: Limits,
    options: ExportOptions,
) -> None:
    """Turn SOURCE into a surface and write it, each file re-read and compared.

    SOURCE is a scan file (.turnscan), or the .conf file that places the range scans (PLY) of
    another scanner beside it. Findings go to stderr; the exit code is 1 where one is an error, and
    then nothing but the report is written.
    """
    ranges = source.suffix.lower() == ".conf"
    _refuse(_OF_PICTURES if ranges else _OF_RANGES, source)
    inputs = [source] if rig_path is None else [source, rig_path]
    if edits not in ("own", "none"):
        inputs.append(Path(edits))
    if ranges:
        from turnscan.cli._range_scans import join_scans, placed_scans

        placed = placed_scans(source, unit)
        inputs += placed
    check_apart(outputs)
    for path in outputs:
        exporter_for(path.suffix)
        check_output(path, inputs=inputs)
    check_report(report, inputs)
    rig: Rig | None = None
    if ranges:
        done = join_scans(source, placed, unit, settings)
    else:
        given = None if rig_path is None else read_rig_file(rig_path)
        with Scan.open(source) as scan:
            rig = rig_for(scan, given)
            history = wanted_history(scan, edits)
            settings = replace(settings, volume=limits.volume(rig, scan))
            looks = sum(len(lit_in(n, rig)) * len(scan.steps(n)) for n in scan.plan.lasers)
            with progress("reconstructing", looks) as tick:
                done = reconstruct(scan, rig, settings, tick, history.enabled)
    told = about(source, rig, settings, done.edits)
    finish(outputs, done, told, rig, report, options)


def _refuse(names: tuple[str, ...], source: Path) -> None:
    """Raise InputError for options that mean nothing to this kind of source."""
    context = click.get_current_context()
    idle = [n for n in names if context.get_parameter_source(n) is ParameterSource.COMMANDLINE]
    if idle:
        words = ", ".join("--" + n.removesuffix("_path").replace("_", "-") for n in idle)
        kind = "range scans" if names is _OF_PICTURES else "a scan file"
        raise InputError(f"{words}: nothing to {kind} like {source}", hint="leave it out")

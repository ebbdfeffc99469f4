"""``turnscan reconstruct``: a scan file, or placed range scans → points, mesh, CAD."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click
from click.core import ParameterSource

from turnscan.cli._caps import caps_options
from turnscan.cli._edit_source import wanted_history
from turnscan.cli._input import read_rig_file
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output, format_options, write_results
from turnscan.cli._progress import progress
from turnscan.cli._reconstruct_report import about, check_report, summary, write_report
from turnscan.errors import InputError
from turnscan.export import ExportOptions, Profiles, exporter_for
from turnscan.pipeline import Reconstruction, Settings, reconstruct
from turnscan.points import Volume, profiles, working_volume
from turnscan.rig import Rig
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.stripes import StripeSettings
from turnscan.surface import Caps, Clean

STRATEGIES = (
    "window", "maximum", "centroid", "median", "parabola", "gauss3", "squared", "blais-rioux",
)  # fmt: skip
_OF_PICTURES = (
    "rig_path", "strategy", "choose", "threshold", "spacing", "spacing_by", "every", "radius",
    "z_min", "z_max", "top",
)  # fmt: skip
"""Options about stripes, the table or the rig: range scans have none of these."""
_OF_RANGES = ("unit",)
_path = click.Path(path_type=Path)
_length = Finite(min=0, min_open=True)


@click.command("reconstruct")
@click.argument("source", type=_path)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=_path,
    multiple=True,
    required=True,
    help="File to write; the suffix names the format (.dxf .stl .ply .obj .xyz). May be repeated.",
)
@click.option("--rig", "rig_path", type=_path, help="rig.json; without it the scan file's own.")
@click.option(
    "--strategy",
    type=click.Choice(STRATEGIES),
    default="window",
    show_default=True,
    help="How the centre of the stripe is computed.",
)
@click.option(
    "--choose",
    type=click.Choice(["brightest", "first", "last", "nearest"]),
    default="brightest",
    show_default=True,
    help="Which stripe counts where a line of the picture shows several.",
)
@click.option("--threshold", type=_length, help="Grey levels; without it from the noise.")
@click.option("--spacing", type=_length, help="mm between points along a profile.")
@click.option(
    "--spacing-by",
    type=click.Choice(["height", "arc"]),
    default="height",
    show_default=True,
    help="Points at common heights, or at equal length along each profile; the latter are for "
    "--dxf-form profiles, and the mesh keeps the points as measured.",
)
@click.option("--every", type=click.IntRange(min=1), default=1, help="Use every N-th profile.")
@click.option("--radius", type=_length, help="mm from the axis; what is further out is dropped.")
@click.option("--z-min", type=Finite(), help="mm above the platter; what is lower is dropped.")
@click.option("--z-max", type=Finite(), help="mm above the platter; what is higher is dropped.")
@click.option(
    "--island",
    type=click.IntRange(min=0),
    help="Loose pieces of fewer faces are taken away.  [default: 1 % of the largest piece]",
)
@click.option(
    "--edge",
    type=click.IntRange(min=0, max=20),
    default=1,
    show_default=True,
    help="Points dropped where a run ends at a jump in depth or in one-sided light.",
)
@click.option("--keep-strays", is_flag=True, help="Keep points without a surface round them.")
@click.option(
    "--merge",
    type=click.Choice(["auto", "grid", "tsdf", "paste"]),
    default="auto",
    show_default=True,
    help="Several lasers or scans: average in angle and height, in voxels, or keep every point.",
)
@click.option("--voxel", type=_length, help="mm: voxels of tsdf.  [default: the points' spacing]")
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
@caps_options
@format_options
def verb(
    source: Path,
    outputs: tuple[Path, ...],
    rig_path: Path | None,
    strategy: str,
    choose: str,
    threshold: float | None,
    spacing: float | None,
    spacing_by: str,
    every: int,
    radius: float | None,
    z_min: float | None,
    z_max: float | None,
    island: int | None,
    edge: int,
    keep_strays: bool,
    merge: str,
    voxel: float | None,
    unit: str,
    edits: str,
    report: Path | None,
    caps: Caps | None,
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
    for path in outputs:
        exporter_for(path.suffix)
        check_output(path, inputs=inputs)
    check_report(report, inputs)
    settings = Settings(
        stripes=StripeSettings(
            strategy=strategy,  # type: ignore[arg-type]
            choose=choose,  # type: ignore[arg-type]
            threshold=threshold,
        ),
        every=every,
        spacing=spacing,
        spacing_by=spacing_by,  # type: ignore[arg-type]
        island=island,
        clean=Clean(edge=edge, support=0, piece=0.0) if keep_strays else Clean(edge=edge),
        merge=merge,  # type: ignore[arg-type]
        voxel=voxel,
        caps=caps,
    )
    rig: Rig | None = None
    if ranges:
        done = join_scans(source, placed, unit, settings)
    else:
        given = None if rig_path is None else read_rig_file(rig_path)
        with Scan.open(source) as scan:
            rig = rig_for(scan, given)
            history = wanted_history(scan, edits)
            settings = replace(settings, volume=_volume(rig, scan, radius, z_min, z_max))
            looks = sum(len(lit_in(n, rig)) * len(scan.steps(n)) for n in scan.plan.lasers)
            with progress("reconstructing", looks) as tick:
                done = reconstruct(scan, rig, settings, tick, history.enabled)
    _finish(source, outputs, done, rig, settings, report, options)


def _refuse(names: tuple[str, ...], source: Path) -> None:
    """Raise InputError for options that mean nothing to this kind of source."""
    context = click.get_current_context()
    idle = [n for n in names if context.get_parameter_source(n) is ParameterSource.COMMANDLINE]
    if idle:
        words = ", ".join("--" + n.removesuffix("_path").replace("_", "-") for n in idle)
        kind = "range scans" if names is _OF_PICTURES else "a scan file"
        raise InputError(f"{words}: nothing to {kind} like {source}", hint="leave it out")


def _volume(
    rig: Rig, scan: Scan, radius: float | None, z_min: float | None, z_max: float | None
) -> Volume | None:
    """What the user limits, and the rig's own limits for the rest; None for those alone."""
    if radius is None and z_min is None and z_max is None:
        return None
    names = [name for lit in scan.plan.lasers for name in lit_in(lit, rig)]
    usual = [working_volume(rig, laser) for laser in names]
    low = usual[0].z_min if z_min is None else z_min
    high = usual[0].z_max if z_max is None else z_max
    if high <= low:
        raise InputError(
            f"no height between {low} and {high} mm", hint="give --z-min below --z-max"
        )
    return Volume(max(v.r_max for v in usual) if radius is None else radius, low, high)


def _finish(
    source: Path,
    outputs: tuple[Path, ...],
    done: Reconstruction,
    rig: Rig | None,
    settings: Settings,
    report: Path | None,
    options: ExportOptions,
) -> None:
    for finding in done.findings:
        click.echo(str(finding), err=True)
    failed = any(f.severity == "error" for f in done.findings)
    if not failed:
        options = replace(options, about=about(source, rig, settings, done.edits))
        lines: dict[str, tuple[object, ...]] = {}
        if "profiles" in options.dxf_forms:
            for grid in done.grids:
                runs = [p.points for step in profiles(grid) for p in step]
                lines[grid.laser] = (*lines.get(grid.laser, ()), *runs)
        held = Profiles(lines) if lines else None  # type: ignore[arg-type]
        for remark in write_results(dict.fromkeys(outputs, done.mesh), options, held):
            click.echo(str(remark), err=True)
    for line in summary(done, rig):
        click.echo(line)
    if report is not None:
        write_report(report, source, done, rig, settings)
    if failed:
        sys.exit(1)
    for path in outputs:
        click.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB, read back the same")

"""``turnscan join``: several poses of one part → one surface."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._output import format_options, report_option
from turnscan.cli._own_settings import base_option, options_for_each
from turnscan.cli._progress import progress_bar
from turnscan.cli._show import show_result

_path = click.Path(path_type=Path)


@click.command("join")
@click.argument("sources", type=_path, nargs=-1, required=True)
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
    "--points",
    "points_path",
    type=_path,
    help="Corresponding points in several poses: CSV `point,pose,x,y,z` or JSON, mm, in the "
    "frame of each pose.",
)
@click.option(
    "--reference",
    type=_path,
    help="The part as it is drawn (mesh in mm, or STEP), which each pose is brought onto.",
)
@click.option(
    "--rig", "rig_path", type=_path, help="rig.json.  [default: the one stored in each scan]"
)
@flags_of(workflows.JoinOptions, into="poses")
@flags_of(workflows.ReconstructOptions)
@base_option
@report_option(".html with pictures, or .json")
@format_options
def verb(
    sources: tuple[Path, ...],
    outputs: tuple[Path, ...],
    points_path: Path | None,
    reference: Path | None,
    rig_path: Path | None,
    reports: tuple[Path, ...],
    poses: workflows.JoinOptions,
    options: workflows.ReconstructOptions,
    base: str | None,
    formats: workflows.ExportOptions,
) -> None:
    """Register several poses of one part and write them as one surface.

    SOURCES are scan files (.turnscan), each read with its own settings, range scans of another
    scanner (.ply), or one .conf file with the approximate poses of its range scans. Without
    --points, --markers and --reference the poses are registered by their shape. The first one
    gives the frame, or the reference.
    Nothing is written where poses do not overlap, or fit in several ways.
    """
    inputs = [*sources, *(p for p in (rig_path, points_path, reference) if p is not None)]
    workflows.check_targets(outputs, inputs, reports, poses.unit)
    rig = None if rig_path is None else workflows.read_rig_file(rig_path)
    chosen, changes = options_for_each(options, base)
    with progress_bar() as progress:
        result = workflows.join(
            sources, chosen, points=points_path, markers=poses.markers, reference=reference,
            rig=rig, unit=poses.unit, progress=progress, **changes,
        )  # fmt: skip
    show_result(result, outputs, reports, formats)

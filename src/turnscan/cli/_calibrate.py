"""``turnscan calibrate``: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags
from turnscan.errors import InputError
from turnscan.findings import record

_NAMED = "[NAME=]PICTURES"
_path = click.Path(path_type=Path)


@click.command("calibrate")
@click.option("--camera", required=True, metavar="PICTURES",
              help="Board pictures in varied poses, laser off.")  # fmt: skip
@click.option("--board", required=True, metavar="SPEC",
              help="chessboard:COLSxROWS:SQUARE_MM (inner corners) or "
              "charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT (squares).")  # fmt: skip
@click.option("--laser", required=True, multiple=True, metavar=_NAMED,
              help="Board pictures with the stripe on the board or its white margin; "
              "once for each laser.")  # fmt: skip
@click.option("--laser-dark", multiple=True, metavar=_NAMED,
              help="The same with the laser off, one for each picture with it on.")  # fmt: skip
@click.option("--table", required=True, metavar="PICTURES",
              help="Pictures of the empty table, step by step.")  # fmt: skip
@click.option("--table-dark", metavar="PICTURES", help="The same with the laser off.")
@flags_of(workflows.CalibrateOptions)
@click.option("-o", "--output", required=True, type=_path, help="rig.json")
@click.option("--report", type=_path, help="HTML report to write.")
@click.option("--json", "as_json", is_flag=True, help="Print results and findings as JSON.")
def verb(
    camera: str,
    board: str,
    laser: tuple[str, ...],
    laser_dark: tuple[str, ...],
    table: str,
    table_dark: str | None,
    options: workflows.CalibrateOptions,
    output: Path,
    report: Path | None,
    as_json: bool,
) -> None:
    """Calibrate camera, laser sheets and table from pictures.

    PICTURES is a folder, a pattern in quotes or a file. Nominal sizes of markers and steps are
    compared with what the pictures say and never trusted; the board's square gives the scale.
    """
    lit, dark = _by_name(laser, "--laser"), _by_name(laser_dark, "--laser-dark")
    pictures = workflows.CalibrationPictures(camera, lit, table, dark, table_dark)
    with progress_bar() as bar:
        done = workflows.calibrate(pictures, board, output, options, report=report, progress=bar)
    for stage in done.stages:
        click.echo(stage, err=True)
    found = [with_flags(finding) for finding in done.findings]
    if as_json:
        body = {"figures": asdict(done.figures), "findings": [record(f) for f in found]}
        click.echo(json.dumps(body, indent=1, ensure_ascii=False))
        return
    for line in (*_lines(done), *(str(f) for f in found), f"wrote {output}"):
        click.echo(line)


def _by_name(specs: Sequence[str], flag: str) -> dict[str, str]:
    out: dict[str, str] = {}
    for spec in specs:
        name, equals, pictures = spec.partition("=")
        if not equals:
            name, pictures = "laser", spec
        if name in out:
            raise InputError(
                f"{flag}: two are called {name!r}", hint=f"name them: {flag} left=PICTURES"
            )
        out[name] = pictures
    return out


def _lines(done: workflows.CalibratedRig) -> list[str]:
    f, network = done.figures, done.calibration.network
    lines = [f"camera   {f.camera_rms_px:.3f} px rms over {f.camera_views} board views"]
    for laser in network.lasers:
        rms = f"{f.sheet_rms_mm[laser]:.3f} mm rms, {f.sheet_rms_px[laser]:.3f} px"
        lines.append(f"sheet    {rms}, over {f.sheet_views[laser]} stripes ({laser})")
    lines.append(f"table    {f.table_rms_px:.3f} px rms over {len(network.table)} pictures")
    for place, u in f.radius_k2_mm.items():
        height = f"height ± {f.height_k2_mm[place]:.2f} mm (k = 2)"
        lines.append(f"at radius / height {place} mm: radius ± {u:.2f} mm, {height}")
    return lines

"""``turnscan calibrate``: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict, Unpack

import click

from turnscan import workflows
from turnscan.cli._calibrate_report import body, lines
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.errors import InputError

_NAMED = "[NAME=]PICTURES"
_path = click.Path(path_type=Path)


class _Pictures(TypedDict):
    """What the flags of pictures give."""

    camera: str | None
    laser: tuple[str, ...]
    laser_dark: tuple[str, ...]
    table: str | None
    table_dark: str | None


@click.command("calibrate")
@click.option("--rig", type=_path, help="What is known already: a rig.json whose stages are added "
              "or calibrated again, or what a ruler says (.toml).")  # fmt: skip
@click.option("--camera", metavar="PICTURES",
              help="Board pictures in varied poses, laser off.")  # fmt: skip
@click.option("--board", metavar="SPEC", default=None,
              help="chessboard:COLSxROWS:SQUARE_MM (inner corners) or "
              "charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT (squares).")  # fmt: skip
@click.option("--laser", multiple=True, metavar=_NAMED,
              help="Board pictures with the stripe on the board or its white margin; "
              "once for each laser.")  # fmt: skip
@click.option("--laser-dark", multiple=True, metavar=_NAMED,
              help="The same with the laser off, one for each picture with it on.")  # fmt: skip
@click.option("--table", metavar="PICTURES",
              help="Pictures of the empty table, step by step.")  # fmt: skip
@click.option("--table-dark", metavar="PICTURES", help="The same with the laser off.")
@flags_of(workflows.CalibrateOptions)
@click.option("-o", "--output", required=True, type=_path, help="rig.json")
@click.option("--report", type=_path, help="HTML report to write.")
@click.option("--json", "as_json", is_flag=True, help="Print results and findings as JSON.")
def verb(
    rig: Path | None,
    board: str | None,
    options: workflows.CalibrateOptions,
    output: Path,
    report: Path | None,
    as_json: bool,
    **given: Unpack[_Pictures],
) -> None:
    """Calibrate camera, laser sheets and table from pictures, together or one by one.

    PICTURES is a folder, a pattern in quotes or a file. Stages without pictures are those of --rig,
    or follow later. Nominal sizes of markers and steps are compared with what the pictures say and
    never trusted; the board's square gives the scale.
    """
    lit = _by_name(given["laser"], "--laser")
    dark = _by_name(given["laser_dark"], "--laser-dark")
    pictures = workflows.CalibrationPictures(
        given["camera"], lit, given["table"], dark, given["table_dark"]
    )
    with progress_bar() as bar:
        done = workflows.calibrate(
            pictures, board, output, options, rig=rig, report=report, progress=bar
        )
    for stage in done.stages:
        click.echo(stage, err=True)
    click.echo(body(done) if as_json else "\n".join(lines(done)))


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

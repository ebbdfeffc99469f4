"""``turnscan doctor``: is everything ready for a scan?"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.cli._signals import ended_by_signals
from turnscan.cli._words import with_flags


@click.command("doctor")
@flags_of(workflows.DeviceOptions, into="devices")
@flags_of(workflows.DoctorOptions)
@click.option(
    "--history",
    type=click.Path(path_type=Path),
    help="History written by turnscan verify; the age of the last verification is checked.",
)
@click.option(
    "--rig",
    type=click.Path(path_type=Path),
    help="Calibrated rig file; without one, the next step is to calibrate.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def verb(
    devices: workflows.DeviceOptions,
    options: workflows.DoctorOptions,
    history: Path | None,
    rig: Path | None,
    as_json: bool,
) -> None:
    """Check camera, lasers and turntable, with a part on it, and report what is wrong.

    Takes dark pictures and one of each laser, then turns the table once. Reads the camera's
    settings back; measures noise, flicker, stripe width (focus) and brightness, which laser is on
    which side, the direction of turning and whether 360° are a turn. Ends with a verdict and
    the one step to take next. Exit code 1 when something is wrong, 4 when a laser is not known to
    be dark.
    """
    with ended_by_signals(), progress_bar() as bar:
        seen = workflows.doctor(devices, options, history=history, rig=rig, progress=bar)
    if as_json:
        click.echo(json.dumps(workflows.diagnosis_json(seen), indent=1, allow_nan=False))
    else:
        for line in [*workflows.diagnosis_lines(seen), *map(with_flags, seen.findings)]:
            click.echo(line)
        for line in seen.conclusion:
            click.echo(line)
    if seen.verdict != "ready":
        sys.exit(1)

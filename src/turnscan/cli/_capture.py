"""``turnscan capture``: pictures for ``turnscan calibrate``, taken with what is connected."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._signals import ended_by_signals, was_interrupted


@click.command("capture")
@click.argument("folder", metavar="FOLDER", type=click.Path(path_type=Path))
@flags_of(workflows.DeviceOptions, into="devices")
@flags_of(workflows.CaptureOptions)
@click.option(
    "--board", metavar="SPEC", help="Detect this board in each picture; written as for calibrate."
)
def verb(
    folder: Path,
    devices: workflows.DeviceOptions,
    options: workflows.CaptureOptions,
    board: str | None,
) -> None:
    """Take pictures of a board into FOLDER, for `turnscan calibrate`.

    They are written to camera/, laser-NAME/ with laser-NAME-dark/, and table/ (table-lit/ with
    --laser-name); numbering continues after existing pictures. With --board, what was detected in
    each picture is printed. Exit code 130 when interrupted; pictures already taken are kept.
    """
    with ended_by_signals():
        try:
            done = workflows.capture(
                folder, options, devices=devices, board=board, taken=lambda p: click.echo(str(p))
            )
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted; the pictures taken so far are stored", err=True)
            sys.exit(130)
    click.echo(str(done))

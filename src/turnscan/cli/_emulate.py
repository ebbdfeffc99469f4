"""``turnscan emulate``: an emulated controller and camera, behind real wires."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._signals import ended_by_signals

_path = click.Path(path_type=Path)


@click.command("emulate")
@click.argument("dialect", metavar="BOARD")
@click.argument("scene", metavar="[SCENE]", default=workflows.DEFAULT_DEVICE)
@click.option("--port", type=_path, metavar="PATH",
              help="Path of the emulated serial port.  [default: in a temporary "
                   "folder]")  # fmt: skip
@click.option("--rig", type=_path, metavar="FILE", help="File for the scene's true rig.json.")
@click.option("--truth", type=_path, metavar="FILE",
              help="File for the part's true surface (.stl, .ply, .obj).")  # fmt: skip
@flags_of(workflows.EmulateOptions)
def verb(
    dialect: str,
    scene: str,
    port: Path | None,
    rig: Path | None,
    truth: Path | None,
    options: workflows.EmulateOptions,
) -> None:
    """Emulate a controller BOARD (grbl, horus, fabscan, sardauscan) on a serial port, and a
    GigE Vision camera on this machine's own network, until Ctrl-C.

    Both belong to one simulated SCENE, named as for `turnscan simulate`: the camera sees what the
    controller turns and lights. Scan with it from another terminal as with real devices; the
    addresses are printed. At the end the time for which lasers were lit is printed.
    """

    def ready(at: workflows.EmulatedDevices) -> None:
        click.echo(f"turntable and lasers: {at.board}")
        if at.camera:
            click.echo(f"camera: {at.camera}")
            scan = f'turnscan scan part.turnscan --turntable "{at.board}" --camera {at.camera}'
            scan += f" --exposure {at.exposure:g}{f' --rig {rig}' if rig else ''}"
            click.echo(f"in another terminal: {scan}")
        click.echo("ready; Ctrl-C ends it")

    with ended_by_signals():
        log = workflows.emulate(
            dialect, scene, options, port=port, rig=rig, truth_mesh=truth, ready=ready
        )
    if log.trouble:
        click.echo(f"black instead of a picture: {log.trouble}", err=True)
    click.echo(
        f"pictures: {log.pictures}; lasers: lit {log.times} times, {log.total:.1f} s in all, "
        f"{log.longest:.2f} s at most; {'LIT' if log.lit else 'dark'} at the end"
    )

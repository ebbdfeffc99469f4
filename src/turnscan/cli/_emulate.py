"""``turnscan emulate``: a board and a camera that aren't there, behind real wires."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from turnscan.cli._hardware import ended_by_signals
from turnscan.cli._numbers import Finite
from turnscan.errors import InputError
from turnscan.formats import ExportOptions
from turnscan.rig import rig_to_json
from turnscan.simulate import simulated, wish_of
from turnscan.workflows import check_writable, save, write_atomically
from turnscan.workflows._simulated import truth

if TYPE_CHECKING:
    from turnscan.simulate.controllers import Emulator

_LOOK_EVERY = 0.2
"""s"""


@click.command("emulate")
@click.argument("dialect", metavar="BOARD")
@click.argument("scene", metavar="[SCENE]", default="sim:cup?seed=7")
@click.option("--port", type=click.Path(path_type=Path), metavar="PATH",
              help="Path of the emulated serial port.  [default: in a temporary "
                   "folder]")  # fmt: skip
@click.option("--no-camera", is_flag=True, help="Emulate the controller only.")
@click.option("--rig", "rig_file", type=click.Path(path_type=Path), metavar="FILE",
              help="File for the scene's true rig.json.")  # fmt: skip
@click.option("--truth", "truth_file", type=click.Path(path_type=Path), metavar="FILE",
              help="File for the part's true surface (.stl, .ply, .obj).")  # fmt: skip
@click.option("--hurry", type=Finite(), default=1.0, show_default=True, metavar="TIMES",
              help="Speed of the table as a multiple of a real one's.")  # fmt: skip
@click.option("--seconds", type=Finite(min=0, min_open=True, max=86400.0), default=3600.0,
              show_default=True, help="End automatically after this time, s.")  # fmt: skip
def verb(
    dialect: str,
    scene: str,
    port: Path | None,
    no_camera: bool,
    rig_file: Path | None,
    truth_file: Path | None,
    hurry: float,
    seconds: float,
) -> None:
    """Emulate a controller BOARD (grbl, horus, fabscan, sardauscan) on a serial port, and a
    GigE Vision camera on this machine's own network, until Ctrl-C.

    Both belong to one simulated SCENE, named as for `turnscan simulate`: the camera sees what the
    controller turns and lights. Scan with it from another terminal as with real devices; the
    addresses are printed. At the end the time for which lasers were lit is printed.
    """
    if os.name != "posix":
        raise InputError("a serial port can be emulated on Linux only")
    from turnscan.simulate.controllers import Emulator

    wish, faults = wish_of(scene if scene.startswith("sim:") else f"sim:{scene}")
    if faults.drop or faults.stale:
        raise InputError("drop, stale: faults of the simulated camera, not of the served one")
    for path in filter(None, (rig_file, truth_file)):
        check_writable(path)
    bench = simulated(wish, faults)
    emulator = Emulator(dialect, bench, port=port, camera=not no_camera, hurry=hurry)
    if rig_file is not None:
        write_atomically(rig_file, rig_to_json(bench.world.bench.rig).encode())
    if truth_file is not None:
        save({truth_file: truth(bench)}, ExportOptions())
    with ended_by_signals():
        try:
            with emulator:
                _tell(emulator, rig_file)
                end = time.monotonic() + seconds
                while (left := end - time.monotonic()) > 0:
                    time.sleep(min(left, _LOOK_EVERY))
        except KeyboardInterrupt:
            click.echo()
    if emulator.trouble is not None:
        click.echo(f"black instead of a picture: {emulator.trouble}", err=True)
    lasers = emulator.laser_times()
    click.echo(
        f"pictures: {emulator.pictures}; lasers: lit {lasers.times} times, {lasers.total:.1f} s in "
        f"all, {lasers.longest:.2f} s at most; {'LIT' if emulator.firmware.lit else 'dark'} at the "
        "end"
    )


def _tell(emulator: Emulator, rig: Path | None) -> None:
    """The addresses, and a command that uses them."""
    click.echo(f"turntable and lasers: {emulator.board}")
    scan = f'turnscan scan part.turnscan --turntable "{emulator.board}"'
    if emulator.camera:
        click.echo(f"camera: {emulator.camera}")
        scan += f" --camera {emulator.camera} --exposure {emulator.bench.seconds:g}"
        click.echo(f"in another terminal: {scan}{f' --rig {rig}' if rig else ''}")
    click.echo("ready; Ctrl-C ends it")

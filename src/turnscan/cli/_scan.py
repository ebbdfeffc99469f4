"""``turnscan scan``: a plan, devices, a scan file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from turnscan.cli._degrees import Degrees, DegreesRange
from turnscan.cli._hardware import addresses_of, device_options, ended_by_signals, was_interrupted
from turnscan.cli._numbers import Finite
from turnscan.cli._scanning import take
from turnscan.errors import InputError
from turnscan.scanner import USUAL_STEPS, Wishes, opened, prepare
from turnscan.workflows import check_output
from turnscan.workflows._reading import read_rig_file


@click.command("scan")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@device_options
@click.option(
    "--steps",
    type=int,
    help=f"Number of table positions.  [default: the simulated rig's, or {USUAL_STEPS} a turn]",
)
@click.option(
    "--step-deg", type=Degrees(), help="Angle between table positions, in place of --steps."
)
@click.option("--range-deg", type=DegreesRange(), default="0:360", show_default=True, metavar="A:B",
              help="First and last table angle.")  # fmt: skip
@click.option(
    "--passes",
    type=int,
    default=1,
    show_default=True,
    help="Number of passes over the same positions.",
)
@click.option("--laser-names", metavar="A,B", help="Lasers to use.  [default: all]")
@click.option("--together", is_flag=True, help="Light all lasers at the same time, in one picture.")
@click.option("--exposure", "exposures", type=Finite(), multiple=True, metavar="SECONDS",
              help="Exposure time; may be repeated (bracketing).  [default: the simulated rig's, "
                   "or 0.02]")  # fmt: skip
@click.option(
    "--auto-exposure",
    is_flag=True,
    help="Find the exposure time from the stripe at the first position.",
)
@click.option("--gain", type=Finite(), default=1.0, show_default=True, help="Camera gain, factor.")
@click.option("--dark-every", type=int, default=1, show_default=True, metavar="STEPS",
              help="Capture a laser-off picture every N steps; 0: never.")  # fmt: skip
@click.option(
    "--texture",
    type=Finite(),
    metavar="SECONDS",
    help="Also capture laser-off texture images, with this exposure time.",
)
@click.option("--texture-every", type=int, default=1, show_default=True, metavar="STEPS",
              help="Capture a texture image every N steps.")  # fmt: skip
@click.option(
    "--lamp", "lamps", multiple=True, help="Output that switches a lamp, lit for --texture."
)
@click.option("--settle", type=Finite(), metavar="SECONDS",
              help="Settling time before each picture.  [default: 0.1; simulated: 0]")  # fmt: skip
@click.option("--blind-steps", type=int, default=8, show_default=True,
              help="End the scan after N consecutive steps without a stripe.")  # fmt: skip
@click.option("--keep", type=click.Choice(["sparse", "full"]), default="sparse", show_default=True,
              help="Store the pixels around the stripe, or all; both losslessly.")  # fmt: skip
@click.option(
    "--threshold",
    type=Finite(),
    help="Threshold above the background, grey levels.  [default: from the image noise; printed]",
)
@click.option("--orientation", type=click.Choice(["vertical", "horizontal"]), default="vertical",
              show_default=True, help="Orientation of the stripe in the picture.")  # fmt: skip
@click.option(
    "--rig", "rig_file", type=click.Path(path_type=Path), help="rig.json to store in the scan."
)
def verb(
    name: Path,
    devices: dict[str, str | None],
    rig_file: Path | None,
    **wishes: Any,
) -> None:
    """Scan into NAME.turnscan with the connected devices, or with a simulated rig.

    An interrupted scan loses at most the picture being captured; `turnscan resume` completes it.
    While it runs, `turnscan check` and `turnscan reconstruct` work on the frames stored so far.
    Exit code 130 when interrupted.
    """
    check_output(name, (".turnscan",))
    if name.exists():
        raise InputError(
            f"{name}: already exists", hint="choose another name, or turnscan resume it"
        )
    at = addresses_of(devices)
    rig = read_rig_file(rig_file) if rig_file else None
    with ended_by_signals():
        try:
            with opened(at) as bench:
                wanted = _wishes(**wishes)
                ready = prepare(at, bench, wanted, rig, str(rig_file or "the rig"))
                plan, first = ready.plan, ready.first
                how = first.threshold_reason
                if wanted.threshold is not None:
                    how = f"threshold {wanted.threshold:g}"
                if ready.exposure_reason:
                    how = f"{ready.exposure_reason}; {how}"
                size = f"about {ready.size / 1e6:.1f} MB"
                click.echo(f"{plan.steps} steps × {', '.join(plan.sets)}; {how}; {size}")
                with ready.create(name) as scan:
                    take(plan, bench.hardware, scan, first)
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted before the first frame was stored", err=True)
            sys.exit(130)


def _wishes(laser_names: str | None, **others: Any) -> Wishes:
    """The options as wishes."""
    lasers = None if laser_names is None else tuple(filter(None, laser_names.split(",")))
    return Wishes(lasers=lasers, **others)

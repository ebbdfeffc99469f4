"""``turnscan scan``: a plan, devices, a scan file."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from turnscan.acquire import (
    Acquisition,
    Exposure,
    Plan,
    Texture,
    acquisition_to_json,
    check_room,
    estimate,
    look,
)
from turnscan.cli._hardware import (
    Opened,
    addresses_of,
    device_options,
    ended_by_signals,
    opened,
    was_interrupted,
)
from turnscan.cli._input import read_rig_file
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output
from turnscan.cli._scanning import take
from turnscan.cli._simulated import laser_colour
from turnscan.errors import InputError
from turnscan.rig import Rig
from turnscan.scan import Keep, Scan, ScanPlan

_STEPS = 400
_LONGEST_NUMBER = 40


class _Degrees(click.ParamType[Fraction]):
    """Decimal or fraction, exact."""

    name = "degrees"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Fraction:
        if isinstance(value, Fraction):
            return value
        try:
            text = str(value)
            if len(text) > _LONGEST_NUMBER or "e" in text.lower():
                raise ValueError
            return Fraction(text)
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is not a number of degrees, as 0.9 or 360/400", param, ctx)


class _Range(click.ParamType[tuple[Fraction, Fraction]]):
    name = "range"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Fraction, Fraction]:
        if isinstance(value, tuple):
            return value
        a, colon, b = str(value).partition(":")
        if not colon:
            self.fail(f"{value!r} is not a range, as 0:180", param, ctx)
        one = _Degrees()
        return one.convert(a, param, ctx), one.convert(b, param, ctx)


@click.command("scan")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@device_options
@click.option("--steps", type=int, help=f"Stops.  [default: the bench's, or {_STEPS} a turn]")
@click.option("--step-deg", type=_Degrees(), help="Angle between stops, instead of --steps.")
@click.option("--range-deg", type=_Range(), default="0:360", show_default=True, metavar="A:B")
@click.option("--passes", type=int, default=1, show_default=True, help="The same stops again.")
@click.option("--laser-names", metavar="A,B", help="Which to use.  [default: all there are]")
@click.option("--together", is_flag=True, help="All lasers in one picture.")
@click.option("--exposure", "exposures", type=Finite(), multiple=True, metavar="SECONDS",
              help="May be given several times.  [default: the bench's, or 0.02]")  # fmt: skip
@click.option("--gain", type=Finite(), default=1.0, show_default=True)
@click.option("--dark-every", type=int, default=1, show_default=True, metavar="STEPS",
              help="A picture without laser each so many steps; 0: none.")  # fmt: skip
@click.option(
    "--texture", type=Finite(), metavar="SECONDS", help="Also a whole picture, so exposed."
)
@click.option("--texture-every", type=int, default=1, show_default=True, metavar="STEPS")
@click.option("--lamp", "lamps", multiple=True, help="Output that is a lamp, lit for --texture.")
@click.option("--settle", type=Finite(), metavar="SECONDS",
              help="From rest to picture.  [default: 0.1; simulated: 0]")  # fmt: skip
@click.option("--blind-steps", type=int, default=8, show_default=True,
              help="So many steps on end without a stripe end the scan; 0: never.")  # fmt: skip
@click.option("--keep", type=click.Choice(["sparse", "full"]), default="sparse", show_default=True)
@click.option("--threshold", type=Finite(), help="Grey levels.  [default: chosen, and said]")
@click.option("--orientation", type=click.Choice(["vertical", "horizontal"]), default="vertical",
              show_default=True, help="Of the stripe in the picture.")  # fmt: skip
@click.option("--rig", "rig_file", type=click.Path(path_type=Path), help="rig.json to put into it.")
def verb(
    name: Path,
    devices: dict[str, str | None],
    rig_file: Path | None,
    keep: Keep,
    threshold: float | None,
    orientation: str,
    **wishes: Any,
) -> None:
    """Scan into NAME.turnscan with what is connected, or with a simulated bench.

    An interrupted scan loses at most the picture being taken; `turnscan resume` finishes it. While
    it runs, `turnscan check` and `turnscan reconstruct` show what is there. Exit code 130 when
    interrupted.
    """
    check_output(name, (".turnscan",))
    if name.exists():
        raise InputError(
            f"{name}: exists already", hint="choose another name, or turnscan resume it"
        )
    at = addresses_of(devices)
    rig = read_rig_file(rig_file) if rig_file else None
    with ended_by_signals():
        try:
            with opened(at) as bench:
                plan = _plan(bench, **wishes)
                first = look(
                    plan, bench.hardware, keep=keep, orientation=orientation, source=at.camera,
                    weigh=laser_colour, threshold=threshold,
                )  # fmt: skip
                rig = rig or bench.rig
                if rig is not None:
                    _check_rig(rig, plan, first.scan_plan, rig_file)
                check_room(name, estimate(plan, first))
                click.echo(
                    f"{plan.steps} steps × {', '.join(plan.sets)}; "
                    + (first.threshold_reason if threshold is None else f"threshold {threshold:g}")
                    + f"; about {estimate(plan, first) / 1e6:.1f} MB"
                )
                how = acquisition_to_json(Acquisition(plan, at.camera, at.turntable, at.lasers))
                with Scan.create(name, first.scan_plan, rig, how) as scan:
                    take(plan, bench.hardware, scan, first)
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted before the first frame was stored", err=True)
            sys.exit(130)


def _plan(
    bench: Opened,
    *,
    steps: int | None,
    step_deg: Fraction | None,
    range_deg: tuple[Fraction, Fraction],
    passes: int,
    laser_names: str | None,
    together: bool,
    exposures: tuple[float, ...],
    gain: float,
    dark_every: int,
    texture: float | None,
    texture_every: int,
    lamps: tuple[str, ...],
    settle: float | None,
    blind_steps: int,
) -> Plan:
    """The plan that the options ask for. Raises InputError."""
    usual = bench.steps or _STEPS
    step, stops = stops_of(range_deg, steps, step_deg, usual)
    names = bench.hardware.lasers.names
    if laser_names is not None:
        names = tuple(filter(None, laser_names.split(",")))
    else:
        names = tuple(n for n in names if n not in lamps)
    seconds = exposures or (bench.seconds or 0.02,)
    if settle is None:
        settle = 0.0 if bench.steps else 0.1
    shown = None
    if texture is not None:
        shown = Texture(Exposure(texture, gain), texture_every, lamps)
    return Plan(
        step_deg=step,
        stops=stops,
        lasers=names,
        exposures=tuple(Exposure(s, gain) for s in seconds),
        start_deg=range_deg[0],
        passes=passes,
        together=together,
        dark_every=dark_every,
        texture=shown,
        settle=settle,
        blind_steps=blind_steps,
    )


def stops_of(
    ends: tuple[Fraction, Fraction], steps: int | None, step_deg: Fraction | None, usual: int
) -> tuple[Fraction, int]:
    """Angle between stops and their number.

    Whole turns end one step before their first stop comes again; on other ranges both ends are
    stops. Raises InputError where range and steps do not go together.
    """
    if steps is not None and step_deg is not None:
        raise InputError("--steps and --step-deg", hint="give one of them")
    width = ends[1] - ends[0]
    closed = width != 0 and width % 360 == 0
    if step_deg is not None:
        if step_deg <= 0:
            raise InputError(f"--step-deg {float(step_deg):g}", hint="give an angle above 0")
        step = step_deg if width >= 0 else -step_deg
        count = width / step
        return step, (-(-count.numerator // count.denominator) if closed else int(count) + 1)
    if steps is None:
        steps = max(1, round(usual * abs(width) / 360) + (not closed))
    if steps < 1:
        raise InputError(f"--steps {steps}", hint="a scan has at least one step")
    gaps = steps if closed else steps - 1
    if gaps == 0 and width != 0 and not closed:
        raise InputError(f"one step over {float(width):g}°", hint="give 2 steps or more")
    return (width / gaps if gaps else Fraction(0)), steps


def _check_rig(rig: Rig, plan: Plan, scan_plan: ScanPlan, file: Path | None) -> None:
    where = file or "the rig"
    missing = set(plan.lasers) - {s.name for s in rig.sheets}
    if missing:
        there = ", ".join(s.name for s in rig.sheets) or "none"
        raise InputError(f"{where}: no laser {', '.join(sorted(missing))}", hint=f"it has {there}")
    have = (rig.camera.width, rig.camera.height)
    if have != (scan_plan.width, scan_plan.height):
        raise InputError(
            f"{where}: its camera gives {have[0]} × {have[1]} pixels, this one "
            f"{scan_plan.width} × {scan_plan.height}",
            hint="give the rig that belongs to this camera",
        )

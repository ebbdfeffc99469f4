"""Running a plan into a scan file from the command line: what ``scan`` and ``resume`` share."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import click

from turnscan.acquire import Event, FirstLook, Hardware, Missing, Plan, StepDone, run
from turnscan.cli._hardware import was_interrupted
from turnscan.cli._progress import progress
from turnscan.devices import Steady
from turnscan.errors import TurnscanError
from turnscan.scan import Scan
from turnscan.scanner import steps_left


@dataclass
class _Line:
    """Steps done and time left, a line each tenth of the scan where there is no terminal."""

    said: int = 0

    def tell(self, event: StepDone) -> None:
        """Say where the scan is."""
        tenth = 10 * event.done // event.total
        if tenth > self.said:
            self.said = tenth
            left = f"{event.seconds_left:.0f} s left"
            click.echo(f"{event.done} of {event.total} steps, {left}", err=True)


def take(
    plan: Plan, hardware: Hardware, scan: Scan, first: FirstLook | None, options: str = ""
) -> None:
    """Run the plan, with progress; say how to go on when it ends early.

    ``options`` are what the command to go on with needs, as " --device sim:cup".
    """
    line = _Line()
    left = steps_left(plan, scan)
    with _said_how_to_go_on(plan, scan, options), progress("scanning", left) as tick:

        def listen(event: Event) -> None:
            if isinstance(event, StepDone):
                tick()
                if not sys.stderr.isatty():
                    line.tell(event)
            elif isinstance(event, Missing):
                what = f"step {event.step} of laser {event.laser}: missing: {event.cause}"
                click.echo(what, err=True)

        outcome = run(plan, hardware, scan, first=first, listener=listen)
    if isinstance(hardware.camera, Steady) and (again := hardware.camera.retaken):
        click.echo(f"camera: {again}", err=True)
    lost = f", {outcome.missing} missing" if outcome.missing else ""
    click.echo(f"{scan.path}: {outcome.frames} frames taken{lost}; whole")


@contextmanager
def _said_how_to_go_on(plan: Plan, scan: Scan, options: str) -> Iterator[None]:
    try:
        yield
    except (KeyboardInterrupt, SystemError, TurnscanError) as e:
        if not (isinstance(e, TurnscanError) or was_interrupted(e)):
            raise
        scan.close()
        done = plan.steps - steps_left(plan, scan)
        command = f"turnscan resume {shlex.quote(str(scan.path))}{options}"
        where = f"{done} of {plan.steps} steps are stored → {command}"
        if isinstance(e, TurnscanError):
            click.echo(f"turnscan: {where}", err=True)
            raise
        click.echo(f"turnscan: interrupted: {where}", err=True)
        sys.exit(130)

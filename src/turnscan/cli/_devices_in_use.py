"""Verbs that drive devices: their end by a signal, and how to go on after it."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._signals import ended_by_signals, was_interrupted
from turnscan.errors import TurnscanError
from turnscan.progress import Progress


@dataclass
class Run:
    """A scan that is being taken, as the terminal shows it."""

    progress: Progress
    began: bool = False

    def planned(self) -> None:
        """From here on there is something to go on with."""
        self.began = True

    def missing(self, what: str) -> None:
        """Say that a frame is missing."""
        click.echo(what, err=True)


@contextmanager
def begun(
    name: Path, nothing: str, devices: workflows.DeviceOptions | None = None
) -> Iterator[Run]:
    """Take a scan; where it ends early, say how to go on, with these ``devices``.

    A signal ends it with exit code 130; ``nothing`` is said where nothing was taken.
    """
    with ended_by_signals(), progress_bar(lines=True) as bar:
        run = Run(bar)
        try:
            yield run
        except (KeyboardInterrupt, SystemError, TurnscanError) as e:
            failed = isinstance(e, TurnscanError)
            if not failed and not was_interrupted(e):
                raise
            where = _how_to_go_on(name, devices) if run.began and name.exists() else ""
            if failed:
                if where:
                    click.echo(f"turnscan: {where}", err=True)
                raise
            click.echo(f"turnscan: {f'interrupted: {where}' if where else nothing}", err=True)
            sys.exit(130)


def _how_to_go_on(name: Path, devices: workflows.DeviceOptions | None) -> str:
    left = workflows.scan_left(name)
    command = f"turnscan resume {shlex.quote(str(name))}{again(devices)}"
    return f"{left.done} of {left.steps} steps are stored → {command}"


def again(devices: workflows.DeviceOptions | None) -> str:
    """The addresses as they were given, to be typed once more after a command; "" for none."""
    given = {} if devices is None else devices.changed()
    return "".join(f" --{name} {shlex.quote(at)}" for name, at in given.items())


def show_taken(done: workflows.TakenScan) -> None:
    """Say what was taken."""
    if done.camera:
        click.echo(f"camera: {done.camera}", err=True)
    lost = f", {done.missing} missing" if done.missing else ""
    made = "SIMULATED, of no real part: " if done.simulated else ""
    click.echo(f"{done.path}: {made}{done.frames} frames taken{lost}; whole")

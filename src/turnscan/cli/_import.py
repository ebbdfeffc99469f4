"""``turnscan import``: pictures made elsewhere become a scan file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags
from turnscan.errors import InputError


@click.command("import")
@click.argument("pictures", nargs=-1, metavar="PICTURES...")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Scan file.")
@click.option(
    "--lit",
    multiple=True,
    metavar="NAME=PICTURES",
    help="Pictures of one of several lasers, in place of PICTURES; may be repeated.",
)
@click.option("--dark", multiple=True, metavar="[NAME=]PICTURES",
              help="Pictures with the laser off: one for each lit picture, or one for all. "
              "Without them the background is estimated from the scan itself "
              "(--background).")  # fmt: skip
@click.option("--rig", type=click.Path(path_type=Path), help="rig.json to store in the scan.")
@flags_of(workflows.SeriesOptions, into="series")
@flags_of(workflows.ImportOptions)
def verb(
    pictures: tuple[str, ...],
    output: Path,
    lit: tuple[str, ...],
    dark: tuple[str, ...],
    rig: Path | None,
    series: workflows.SeriesOptions,
    options: workflows.ImportOptions,
) -> None:
    """Make a scan file of pictures: folders, patterns, files, or one video.

    The numbers in the names (step_num133.jpg) say which step a picture belongs to; steps without
    a picture are recorded as missing. Nothing is written unless all of it is good.
    """
    on, off = _by_laser(pictures, lit, dark, series.laser)
    at = workflows.parse_angles(series.angles)
    with progress_bar() as bar:
        _tell(workflows.import_pictures(on, output, at, dark=off, rig=rig, options=options,
                                        progress=bar))  # fmt: skip


def _by_laser(
    pictures: Sequence[str], lit: Sequence[str], dark: Sequence[str], laser: str
) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    if bool(pictures) == bool(lit):
        raise InputError(
            "give PICTURES of one laser, or --lit NAME=PICTURES for each of several",
            hint="turnscan import --help",
        )
    on: dict[str, list[str]] = {laser: list(pictures)} if pictures else {}
    for text in lit:
        name, mark, spec = text.partition("=")
        if not mark or not name or not spec:
            raise InputError(f"--lit {text}: not NAME=PICTURES", hint="like --lit left=pics/left")
        on.setdefault(name, []).append(spec)
    off: dict[str, list[str]] = {}
    for text in dark:
        name, mark, spec = text.partition("=")
        plain = not mark or (name not in on and len(on) == 1)
        for one in on if plain else [name]:
            off.setdefault(one, []).append(text if plain else spec)
    return on, off


def _tell(done: workflows.ImportedScan) -> None:
    for line in done.summary:
        click.echo(line)
    for finding in done.findings:
        click.echo(str(with_flags(finding)))

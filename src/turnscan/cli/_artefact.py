"""``turnscan artefact``: targets and bodies to print, and the file of what is measured on them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from turnscan.cli._numbers import Finite
from turnscan.errors import ExportError, InputError
from turnscan.workflows import write_atomically

_length = Finite(min=0, min_open=True)


@click.command("artefact")
@click.argument("form", type=click.Choice(["target", "ball-bar", "step-block"]))
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="Folder for the files, made if new; files that are there are not replaced.",
)
@click.option("--name", default="", help="What it is called in its file.  [default: the form]")
@click.option("--board", help="Of a target.  [default: charuco:9x6:24:18:DICT_5X5_100]")
@click.option("--paper", type=click.Choice(["a4", "a3", "letter"]), default="a4", show_default=True)
@click.option(
    "--sheet",
    type=click.Choice(["pdf", "svg", "png"]),
    default="pdf",
    show_default=True,
    help="How target and drawings are written.",
)
@click.option("--diameter", type=_length, default=30.0, show_default=True, help="Of balls, mm.")
@click.option(
    "--distance", type=_length, default=100.0, show_default=True, help="Between balls, mm."
)
@click.option(
    "--heights",
    default="5,15,30",
    show_default=True,
    help="Levels of a step block above its first one, mm.",
)
def verb(
    form: str,
    output: Path,
    name: str,
    board: str | None,
    paper: str,
    sheet: Literal["pdf", "svg", "png"],
    diameter: float,
    distance: float,
    heights: str,
) -> None:
    """Make what a scanner is calibrated and verified with: print it, measure it once.

    target: a ChArUco board to scale, with rulers that tell whether the printer keeps it. ball-bar,
    step-block: an STL for a 3-D printer, a drawing of what is to be measured, and the file for
    turnscan verify, in which the measured values are written.
    """
    from turnscan.workflows import TARGET, artefact

    files = artefact(
        form,
        name=name,
        board=board or TARGET,
        paper=paper,
        sheet=sheet,
        diameter=diameter,
        distance=distance,
        heights=_numbers(heights),
    )
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: a file", hint="name a folder")
    for path in (output / f for f in files):
        if path.exists():
            raise InputError(f"{path}: exists already", hint="name another folder")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise ExportError(f"{output}: cannot be made ({e.strerror})") from None
    for file, data in files.items():
        write_atomically(output / file, data)
        click.echo(str(output / file))


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--heights {text!r}: not numbers", hint="write 5,15,30") from None

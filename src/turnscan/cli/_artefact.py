"""``turnscan artefact``: targets and artefacts to print, and the file for their measured values."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from turnscan import workflows
from turnscan.cli._numbers import Finite
from turnscan.errors import ExportError, InputError

_length = Finite(min=0, min_open=True)


@click.command("artefact")
@click.argument("form", type=click.Choice(["target", "dial", "ball-bar", "step-block"]))
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="Folder for the files, created if new; existing files are not replaced.",
)
@click.option("--name", default="", help="Name in the artefact file.  [default: the form]")
@click.option("--board", help="Board of a target.  [default: charuco:9x6:24:18:DICT_5X5_100]")
@click.option("--markers", help="Markers of a dial.  [default: DICT_4X4_50:24]")
@click.option("--paper", type=click.Choice(["a4", "a3", "letter"]), default="a4", show_default=True,
              help="Paper size of target, dial and drawings.")  # fmt: skip
@click.option(
    "--sheet",
    type=click.Choice(["pdf", "svg", "png"]),
    default="pdf",
    show_default=True,
    help="Format of target, dial and drawings.",
)
@click.option("--diameter", type=_length, help="Of balls (30) or a dial (all of the paper), mm.")
@click.option(
    "--distance", type=_length, default=100.0, show_default=True,
    help="Distance between ball centres, mm.",
)  # fmt: skip
@click.option(
    "--heights",
    default="5,15,30",
    show_default=True,
    help="Heights of a step block's levels above the first, mm.",
)
def verb(
    form: str,
    output: Path,
    name: str,
    board: str | None,
    markers: str | None,
    paper: str,
    sheet: Literal["pdf", "svg", "png"],
    diameter: float | None,
    distance: float,
    heights: str,
) -> None:
    """Make targets and artefacts for calibrating and verifying a scanner, to print and measure.

    target: a ChArUco board to scale, with rulers that show the scale of the print. dial: a disc of
    markers and degrees for a platter that is turned by hand. ball-bar, step-block: an STL for a 3-D
    printer, a drawing of the dimensions to measure, and the artefact file for turnscan verify, in
    which the measured values are entered.
    """
    from turnscan.workflows import TARGET, artefact

    files = artefact(
        form,
        name=name,
        board=board or TARGET,
        markers=markers,
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
            raise InputError(f"{path}: already exists", hint="name another folder")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise ExportError(f"{output}: cannot be made ({e.strerror})") from None
    for file, data in files.items():
        workflows.write_atomically(output / file, data)
        click.echo(str(output / file))


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--heights {text!r}: not numbers", hint="write 5,15,30") from None

"""``turnscan design``: what a rig will resolve, before it is built."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of, given
from turnscan.errors import InputError

_path = click.Path(path_type=Path)


@click.command("design")
@click.option(
    "--paper",
    "as_paper",
    is_flag=True,
    help="The paper's Table 1, and where its print and its equations disagree.",
)
@click.option("--theta-deg", multiple=True, metavar="ANGLES",
              help="Triangulation angle, degrees: 22.5, a list 10,20,30 or a range FROM:TO:STEP; "
              "may be repeated.")  # fmt: skip
@flags_of(workflows.DesignOptions)
@click.option("--json", "as_json", is_flag=True, help="Print all results as JSON, unrounded.")
@click.option(
    "--picture",
    type=_path,
    metavar="OUT.png",
    help="Chart of working volume, resolution and error (for the first angle), to write.",
)
@click.option(
    "--rig",
    type=_path,
    metavar="RIG.json",
    help="Also write this geometry as a nominal rig file; one angle, one laser. Other poses and "
    "more lasers: numbers of a ruler, with calibrate --rig.",
)
def verb(
    as_paper: bool,
    theta_deg: tuple[str, ...],
    options: workflows.DesignOptions,
    as_json: bool,
    picture: Path | None,
    rig: Path | None,
) -> None:
    """Resolution, working volume and physical limits of a rig before it is built.

    Lengths in mm. Without options: a 5 megapixel rig at 30°.
    """
    changed = given(*workflows.declared(workflows.DesignOptions), "theta_deg")
    if as_paper and changed:
        raise InputError(
            f"--paper prints the paper's own rig, {changed[0]} cannot change it",
            hint="use --preset paper to start from that rig",
        )
    if as_paper:
        done = workflows.published_design(picture=picture, rig=rig)
    else:
        thetas = [theta for text in theta_deg for theta in workflows.parse_theta(text)]
        done = workflows.design(options, thetas, picture=picture, rig=rig)
    if as_json:
        click.echo(json.dumps(done.body(), indent=2, ensure_ascii=False, allow_nan=False))
        return
    click.echo("\n".join(done.lines()))
    if picture is not None:
        click.echo(f"picture of θ = {math.degrees(done.designs[0].theta):g}°: {picture}")

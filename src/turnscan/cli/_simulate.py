"""``turnscan simulate``: pictures or a scan file of a part that isn't there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress
from turnscan.cli._simulated import plan_of, scan_into_file, scan_into_folder
from turnscan.scan import Keep
from turnscan.simulate import simulated, wish_of


@click.command("simulate")
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="Scan file (.turnscan), or a new folder for pictures, angles.csv and rig.json.",
)
@click.option("--rig", help="paper, modern or ciclop.  [default: paper]")
@click.option("--theta-deg", type=Finite(), help="Angle of triangulation.  [default: the rig's]")
@click.option("--lasers", type=int, help="1 or 2.  [default: what the scene needs]")
@click.option("--steps", type=int, help="Table positions in one turn.  [default: the rig's]")
@click.option("--tip-deg", type=Finite(), help="The part tipped over by so much: another pose.")
@click.option("--seed", type=int, help="Of speckle and noise.  [default: 0]")
@click.option("--exposure", type=Finite(), metavar="SECONDS", help="[default: the rig's]")
@click.option("--keep", type=click.Choice(["sparse", "full"]), default="sparse", show_default=True)
@click.option("--no-speckle", is_flag=True, help="A laser without speckle.")
@click.option("--perfect", is_flag=True, help="Thin sheet, no speckle, blur or noise, 16 bits.")
def verb(
    scene: str,
    output: Path,
    rig: str | None,
    theta_deg: float | None,
    lasers: int | None,
    steps: int | None,
    tip_deg: float | None,
    seed: int | None,
    exposure: float | None,
    keep: Keep,
    no_speckle: bool,
    perfect: bool,
) -> None:
    """Scan SCENE with a rig that isn't there.

    SCENE is a part (cup, head, bust, sphere, shaft, …), a board (charuco, chessboard), a mesh
    file, or an address like sim:cup?galvo=105&backlash_deg=0.2 with everything the simulator
    knows. The same arguments always give the same pictures. The scan file holds the true rig.
    """
    wish, faults = wish_of(scene if scene.startswith("sim:") else f"sim:{scene}")
    given: dict[str, Any] = {"rig": rig, "lasers": lasers, "steps": steps, "seed": seed}
    if theta_deg is not None:
        given["theta"] = math.radians(theta_deg)
    if tip_deg is not None:
        given["tip"] = math.radians(tip_deg)
    if no_speckle:
        given["waves"] = "diffraction"
    if perfect:
        given["perfect"] = True
    wish = replace(wish, **{k: v for k, v in given.items() if v is not None})
    devices = simulated(wish, faults)
    plan = plan_of(devices, exposure)
    with progress("scanning", plan.steps) as tick:
        if output.suffix == ".turnscan":
            scan_into_file(devices, plan, output, keep, tick)
        else:
            scan_into_folder(devices, plan, output, tick)
    what = (
        f"{plan.steps} steps × {', '.join(plan.lasers)}, {plan.exposures[0].seconds:g} s exposure"
    )
    click.echo(f"{output}: {wish.scene} on rig {wish.rig}, {what}")

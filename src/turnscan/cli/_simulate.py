"""``turnscan simulate``: pictures or a scan file of a part, made by a simulated rig."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar


@click.command("simulate")
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="Scan file (.turnscan), or a new folder for pictures, angles.csv and rig.json.",
)
@flags_of(workflows.SimulateOptions)
def verb(scene: str, output: Path, options: workflows.SimulateOptions) -> None:
    """Scan SCENE with a simulated rig.

    SCENE is a part (cup, head, bust, sphere, shaft, …), a board (charuco, chessboard), a mesh
    file, or an address like sim:cup?galvo=105&backlash_deg=0.2 with everything the simulator
    knows. The same arguments always give the same pictures. The scan file holds the true rig.
    """
    with progress_bar() as bar:
        done = workflows.simulate(scene, output, options, bar)
    what = f"{done.steps} steps × {', '.join(done.lasers)}, {done.exposure:g} s exposure"
    click.echo(f"{output}: {done.scene} on rig {done.rig}, {what}")

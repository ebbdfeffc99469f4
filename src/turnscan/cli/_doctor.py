"""``turnscan doctor``: is everything ready for a scan?"""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from turnscan.cli._hardware import addresses_of, device_options, ended_by_signals
from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress
from turnscan.findings import findings_json
from turnscan.scanner import USUAL_DAYS, Diagnosis, examine, opened, verification_findings


@click.command("doctor")
@device_options
@click.option(
    "--exposure",
    type=Finite(),
    metavar="SECONDS",
    help="Exposure time.  [default: the simulated rig's, or 0.02]",
)
@click.option("--gain", type=Finite(), default=1.0, show_default=True, help="Camera gain, factor.")
@click.option(
    "--still", is_flag=True, help="Leave the table at rest; skip the checks that turn it."
)
@click.option(
    "--history",
    type=click.Path(path_type=Path),
    help="History written by turnscan verify; the age of the last verification is checked.",
)
@click.option(
    "--verified-within",
    type=Finite(min=0, min_open=True),
    default=USUAL_DAYS,
    show_default=True,
    metavar="DAYS",
    help="Age in days above which a verification is outdated.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def verb(
    devices: dict[str, str | None],
    exposure: float | None,
    gain: float,
    still: bool,
    history: Path | None,
    verified_within: float,
    as_json: bool,
) -> None:
    """Check camera, lasers and turntable, with a part on it, and report what is wrong.

    Takes dark pictures and one of each laser, then turns the table once. Reads the camera's
    settings back; measures noise, flicker, stripe width (focus) and brightness, which laser is on
    which side, the direction of turning and whether 360° are a turn. Exit code 1 when something
    is wrong, 4 when a laser is not known to be dark.
    """
    at = addresses_of(devices)
    past = [] if history is None else verification_findings(history, time.time(), verified_within)
    with ended_by_signals(), opened(at) as bench, progress("looking", None) as tick:
        seen = examine(bench, exposure, gain, still=still, tick=tick)
    seen = replace(seen, findings=(*seen.findings, *past))
    if as_json:
        facts: dict[str, Any] = {
            "camera": _plain(asdict(seen.camera)),
            "lasers": [_plain(asdict(laser)) for laser in seen.lasers],
            "table": None if seen.table is None else asdict(seen.table),
            "findings": json.loads(findings_json(seen.findings)),
        }
        click.echo(json.dumps(facts, indent=1, allow_nan=False))
    else:
        for line in [*_lines(seen), *map(str, seen.findings)]:
            click.echo(line)
        if all(f.severity == "note" for f in seen.findings):
            click.echo("ready")
    if any(f.severity != "note" for f in seen.findings):
        sys.exit(1)


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in facts.items()}


def _lines(seen: Diagnosis) -> list[str]:
    camera, table = seen.camera, seen.table
    lines = [
        f"camera: {camera.width}×{camera.height}, exposure {camera.seconds:g} s, gain "
        f"{camera.gain:g}, dark level {100 * camera.level:.1f} %, noise {camera.noise:.2f} grey "
        f"levels, flicker {100 * camera.flicker:.2f} %"
    ]
    lines += [
        f"laser {x.name}: stripe in {100 * x.found:.0f} % of the lines, at {x.column:.0f} px, "
        f"{x.width:.1f} px wide (rms), {100 * x.peak:.0f} % of the scale, "
        f"{100 * x.saturated:.0f} % clipped"
        for x in seen.lasers
    ]
    if table is not None:
        way = {True: "counter-clockwise", False: "clockwise", None: "direction not observed"}
        turn = table.degrees_per_turn
        lines.append(
            f"table: {way[table.counter_clockwise]}, "
            + ("full turn not observed" if turn is None else f"a turn is {turn:g}° (± 2°)")
        )
    return lines

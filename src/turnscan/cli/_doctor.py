"""``turnscan doctor``: is everything ready for a scan?"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict
from typing import Any

import click

from turnscan.cli._doctor_measure import CameraFacts, Examination, LaserFacts
from turnscan.cli._hardware import addresses_of, device_options, ended_by_signals, opened
from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress
from turnscan.findings import Finding, findings_json

_LIES = 0.02
_FLICKER = 0.005
_BRIGHT_ROOM = 0.25
_DIM, _WIDE, _CLIPPED, _FEW = 0.1, 6.0, 0.05, 0.05


@click.command("doctor")
@device_options
@click.option(
    "--exposure", type=Finite(), metavar="SECONDS", help="[default: the bench's, or 0.02]"
)
@click.option("--gain", type=Finite(), default=1.0, show_default=True)
@click.option("--still", is_flag=True, help="Do not turn the table.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def verb(
    devices: dict[str, str | None], exposure: float | None, gain: float, still: bool, as_json: bool
) -> None:
    """Look at camera, lasers and table with a part on it, and say what is wrong.

    Takes dark pictures and one of each laser, then turns the table once. Reads the camera's
    settings back; measures noise, flicker, stripe width (focus) and brightness, which laser is on
    which side, the direction of turning and whether 360° are a turn. Exit code 1 when something
    is wrong, 4 when a laser is not known to be dark.
    """
    at = addresses_of(devices)
    with ended_by_signals(), opened(at) as bench:
        seconds = exposure or bench.seconds or 0.02
        look = Examination(bench.hardware, seconds, gain)
        with look.shooter.dark_at_the_end():
            camera = look.camera()
            found = _camera(camera, seconds, gain)
            lasers = [look.laser(name) for name in bench.hardware.lasers.names]
            for laser in lasers:
                found += _laser(laser)
            found += _sides(lasers)
            table = None if still else _table(look, found)
    if as_json:
        facts: dict[str, Any] = {
            "camera": _plain(asdict(camera)),
            "lasers": [_plain(asdict(laser)) for laser in lasers],
            "table": table,
            "findings": json.loads(findings_json(found)),
        }
        click.echo(json.dumps(facts, indent=1, allow_nan=False))
    else:
        for line in [*_lines(camera, lasers, table), *map(str, found)]:
            click.echo(line)
        if all(f.severity == "note" for f in found):
            click.echo("ready")
    if any(f.severity != "note" for f in found):
        sys.exit(1)


def _camera(camera: CameraFacts, seconds: float, gain: float) -> list[Finding]:
    found = []
    for what, asked, got in (("exposure", seconds, camera.seconds), ("gain", gain, camera.gain)):
        if math.isnan(got):
            found.append(Finding("doctor.untold", "note", f"the camera does not tell its {what}"))
        elif abs(got - asked) > _LIES * asked:
            found.append(
                Finding(
                    "doctor.setting",
                    "warning",
                    f"{what} {asked:g} was asked for, {got:g} is set",
                    where="camera",
                    remedy="ask for a value that the camera can have",
                )
            )
    if camera.flicker > _FLICKER:
        found.append(
            Finding(
                "doctor.flicker",
                "warning",
                f"dark pictures differ by {100 * camera.flicker:.1f} % of the scale",
                where="camera",
                remedy="darken the room, or expose for a whole period of its light",
            )
        )
    if camera.level > _BRIGHT_ROOM:
        found.append(
            Finding(
                "doctor.bright",
                "warning",
                f"without laser the picture is at {100 * camera.level:.0f} % of the scale",
                where="camera",
                remedy="darken the room, or use a filter for the laser's colour",
            )
        )
    return found


def _laser(laser: LaserFacts) -> list[Finding]:
    where = f"laser {laser.name}"
    if laser.found < _FEW:
        return [
            Finding(
                "doctor.no-stripe",
                "error",
                "no stripe in its picture",
                where=where,
                remedy="look whether it lights and meets the part; lengthen the exposure",
            )
        ]
    found = []
    if laser.saturated > _CLIPPED:
        found.append(
            Finding(
                "doctor.saturated",
                "warning",
                f"{100 * laser.saturated:.0f} % of the stripe is clipped",
                where=where,
                remedy="shorten the exposure, or bracket it",
            )
        )
    if laser.peak < _DIM:
        found.append(
            Finding(
                "doctor.dim",
                "warning",
                f"the stripe reaches {100 * laser.peak:.0f} % of the scale",
                where=where,
                remedy="lengthen the exposure",
            )
        )
    if laser.width > _WIDE:
        found.append(
            Finding(
                "doctor.focus",
                "warning",
                f"the stripe is {laser.width:.1f} px wide (rms)",
                where=where,
                remedy="focus the camera on the axis, then the laser's line",
            )
        )
    return found


def _sides(lasers: list[LaserFacts]) -> list[Finding]:
    """A laser from the left throws its stripe left of one from the right, on what is in front."""
    by_name = {laser.name: laser.column for laser in lasers if laser.found >= _FEW}
    if not {"left", "right"} <= by_name.keys() or by_name["left"] <= by_name["right"]:
        return []
    return [
        Finding(
            "doctor.swapped",
            "error",
            f"the stripe of laser left ({by_name['left']:.0f} px) is to the right of that of laser "
            f"right ({by_name['right']:.0f} px)",
            where="lasers",
            remedy="exchange their names or outputs",
        )
    ]


def _table(look: Examination, found: list[Finding]) -> dict[str, Any]:
    with progress("turning", None) as tick:
        as_told = look.turns_as_told()
        degrees, telling = look.full_turn(tick)
    if as_told is None:
        found.append(
            Finding(
                "doctor.direction",
                "note",
                "the direction of turning was not seen",
                where="table",
                remedy="put up something with a pattern, in more light",
            )
        )
    elif not as_told:
        found.append(
            Finding(
                "doctor.direction",
                "error",
                "the table turns clockwise seen from above when its angle grows",
                where="table",
                remedy="exchange the wires of one motor coil",
            )
        )
    if not telling:
        found.append(
            Finding(
                "doctor.turn",
                "note",
                "the part looks the same from all sides: whether 360° are a turn was not seen",
                where="table",
                remedy="put up something irregular",
            )
        )
    elif math.isnan(degrees) or degrees != 360.0:
        what = "another number" if math.isnan(degrees) else f"{degrees:.1f}°"
        found.append(
            Finding(
                "doctor.turn",
                "error",
                f"one turn of the part takes {what} instead of 360°",
                where="table",
                remedy="correct steps_per_rev in the table's address",
            )
        )
    return {
        "counter_clockwise": as_told,
        "degrees_per_turn": None if math.isnan(degrees) else degrees,
    }


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in facts.items()}


def _lines(
    camera: CameraFacts, lasers: list[LaserFacts], table: dict[str, Any] | None
) -> list[str]:
    lines = [
        f"camera: {camera.width}×{camera.height}, exposure {camera.seconds:g} s, gain "
        f"{camera.gain:g}, dark level {100 * camera.level:.1f} %, noise {camera.noise:.2f} grey "
        f"levels, flicker {100 * camera.flicker:.2f} %"
    ]
    lines += [
        f"laser {x.name}: stripe in {100 * x.found:.0f} % of the lines, at {x.column:.0f} px, "
        f"{x.width:.1f} px wide (rms), {100 * x.peak:.0f} % of the scale, "
        f"{100 * x.saturated:.0f} % clipped"
        for x in lasers
    ]
    if table is not None:
        way = {True: "counter-clockwise", False: "clockwise", None: "direction unseen"}
        turn = table["degrees_per_turn"]
        lines.append(
            f"table: {way[table['counter_clockwise']]}, "
            + ("turn unseen" if turn is None else f"a turn is {turn:g}° (± 2°)")
        )
    return lines

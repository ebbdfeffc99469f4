"""``turnscan calibrate``: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate import (
    Calibration,
    CalibrationSettings,
    Figures,
    LaserPicture,
    calibrate_rig,
    figures,
    findings_of,
    parse_board,
)
from turnscan.cli._calibrate_pictures import (
    SameSize,
    camera_views,
    colour_weights,
    laser_pictures,
    table_pictures,
    with_dark,
)
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output, write_atomically
from turnscan.cli._progress import progress
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import rig_to_json
from turnscan.scan import list_pictures
from turnscan.stripes import Orientation


@click.command("calibrate")
@click.option("--camera", required=True, metavar="PICTURES", help="Board, anyhow held, laser off.")
@click.option(
    "--board",
    required=True,
    metavar="SPEC",
    help="chessboard:COLSxROWS:SQUARE_MM (inner corners) or "
    "charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT (squares).",
)
@click.option(
    "--laser",
    "lasers",
    multiple=True,
    required=True,
    metavar="[NAME=]PICTURES",
    help="Board with the stripe on it or on its white margin; once for every laser.",
)
@click.option(
    "--laser-dark",
    multiple=True,
    metavar="[NAME=]PICTURES",
    help="The same with the laser off: as many pictures as with it on.",
)
@click.option("--laser-board", metavar="SPEC", help="Board in those pictures, if another one.")
@click.option("--margin-mm", type=Finite(min=0), help="Flat part around the pattern.")
@click.option("--table", required=True, metavar="PICTURES", help="The table, step by step.")
@click.option("--table-dark", metavar="PICTURES", help="The same with the laser off.")
@click.option(
    "--table-laser",
    metavar="NAME",
    help="Laser lit in the table pictures; none for a dark table.  [default: the only laser]",
)
@click.option("--markers", metavar="DICT:SIDE_MM", help="Markers on the platter, nominal side.")
@click.option("--table-board", metavar="SPEC", help="Or: a board that rides on the table.")
@click.option(
    "--table-board-mm",
    type=Finite(),
    default=0.0,
    help="Height of its lowest corner between squares above the table.",
)
@click.option(
    "--table-step-deg", type=Finite(), help="Nominal step between pictures; compared only."
)
@click.option(
    "--colour",
    default="learn",
    show_default=True,
    metavar="COLOUR",
    help="Of the lasers: red, green, blue, grey, three weights R,G,B, or learn.",
)
@click.option(
    "--orientation",
    type=click.Choice(["vertical", "horizontal"]),
    default="vertical",
    show_default=True,
    help="Of the stripe in the picture.",
)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="rig.json")
@click.option("--report", type=click.Path(path_type=Path), help="HTML report.")
@click.option("--json", "as_json", is_flag=True, help="Figures and findings as JSON on stdout.")
def verb(
    camera: str,
    board: str,
    lasers: tuple[str, ...],
    laser_dark: tuple[str, ...],
    laser_board: str | None,
    margin_mm: float | None,
    table: str,
    table_dark: str | None,
    table_laser: str | None,
    markers: str | None,
    table_board: str | None,
    table_board_mm: float,
    table_step_deg: float | None,
    colour: str,
    orientation: Orientation,
    output: Path,
    report: Path | None,
    as_json: bool,
) -> None:
    """Calibrate camera, laser sheets and table from pictures.

    PICTURES is a folder, a pattern in quotes or a file. Nominal sizes of markers and steps are
    compared with what the pictures say and never trusted; the board's square gives the scale.
    """
    check_output(output, (".json",))
    if report is not None:
        check_output(report, (".html",))
    if (markers is None) == (table_board is None):
        raise InputError("table: give either --markers or --table-board")
    plain = parse_board(board)
    dictionary, side = _markers(markers)
    settings = CalibrationSettings(
        dictionary=dictionary,
        marker_side=side,
        step=None if table_step_deg is None else float(np.radians(table_step_deg)),
        margin=margin_mm,
        orientation=orientation,
        table_board=None if table_board is None else parse_board(table_board),
        lowest=table_board_mm,
    )
    groups = _named(lasers, "--laser")
    darks = _named(laser_dark, "--laser-dark") if laser_dark else {}
    lit_on_table = _lit_on_table(table_laser, list(groups))
    size = SameSize()
    views = camera_views(list_pictures(camera), plain, size)
    on_boards: dict[str, Sequence[LaserPicture]] = {}
    weights: dict[str, Floats | None] = {}
    second = plain if laser_board is None else parse_board(laser_board)
    for name, spec in groups.items():
        pairs = with_dark(list_pictures(spec), darks.get(name), f"--laser {name}")
        weights[name] = colour_weights(colour, pairs, second)
        on_boards[name] = laser_pictures(pairs, second, weights[name], orientation, size)
    pairs = with_dark(list_pictures(table), table_dark, "--table")
    mix = None if lit_on_table is None else weights[lit_on_table]
    turned = table_pictures(pairs, settings, lit_on_table, mix, size)
    with progress("adjusting", None):
        result = calibrate_rig(
            views, on_boards, turned, settings, lambda s: click.echo(s, err=True)
        )
    found = figures(result)
    remarks = findings_of(result, found)
    if report is not None:
        from turnscan.cli._calibrate_report import report_html

        roles = {"camera": camera, "table": table}
        roles |= {f"laser {name}": spec for name, spec in groups.items()}
        paths = {(role, p.name): p for role, spec in roles.items() for p in list_pictures(spec)}
        write_atomically(report, report_html(result, found, remarks, paths).encode())
    write_atomically(output, rig_to_json(result.rig).encode())
    if as_json:
        click.echo(_as_json(found, remarks))
    else:
        _tell(result, found, remarks, output)


def _markers(text: str | None) -> tuple[str, float]:
    if text is None:
        return "DICT_4X4_50", 0.0
    name, _, side = text.partition(":")
    try:
        length = float(side)
    except ValueError:
        length = -1.0
    if not 0 < length < 1e5:
        raise InputError(f"--markers {text!r}: no side in mm", hint="write DICT_4X4_50:30")
    from turnscan.calibrate import aruco_dictionary

    aruco_dictionary(name)
    return name, length


def _named(specs: Sequence[str], option: str) -> dict[str, str]:
    out: dict[str, str] = {}
    for spec in specs:
        name, equals, pictures = spec.partition("=")
        if not equals:
            name, pictures = "laser", spec
        if name in out:
            raise InputError(
                f"{option}: two are called {name!r}", hint=f"name them: {option} left=PICTURES"
            )
        out[name] = pictures
    return out


def _lit_on_table(wanted: str | None, names: list[str]) -> str | None:
    if wanted == "none":
        return None
    if wanted is None:
        if len(names) > 1:
            raise InputError(
                f"--table-laser is missing: which of {', '.join(names)} is lit in the table "
                "pictures?",
                hint="name one of them, or none",
            )
        return names[0]
    if wanted not in names:
        raise InputError(f"--table-laser {wanted!r}: there is {', '.join(names)}")
    return wanted


def _as_json(found: Figures, remarks: Sequence[Finding]) -> str:
    body = {"figures": asdict(found), "findings": [asdict(f) for f in remarks]}
    return json.dumps(body, indent=1, ensure_ascii=False)


def _tell(c: Calibration, f: Figures, remarks: Sequence[Finding], output: Path) -> None:
    click.echo(f"camera   {f.camera_rms_px:.3f} px rms over {f.camera_views} board views")
    for laser in c.network.lasers:
        click.echo(
            f"sheet    {f.sheet_rms_mm[laser]:.3f} mm rms, {f.sheet_rms_px[laser]:.3f} px, over "
            f"{f.sheet_views[laser]} stripes ({laser})"
        )
    click.echo(f"table    {f.table_rms_px:.3f} px rms over {len(c.network.table)} pictures")
    for place, u in f.radius_k2_mm.items():
        click.echo(
            f"at radius / height {place} mm: radius ± {u:.2f} mm, height ± "
            f"{f.height_k2_mm[place]:.2f} mm (k = 2)"
        )
    for remark in remarks:
        click.echo(str(remark))
    click.echo(f"wrote {output}")

"""``turnscan calibrate``: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import click
import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.calibrate import (
    Board,
    BoardView,
    Calibration,
    CalibrationSettings,
    Figures,
    LaserPicture,
    TablePicture,
    calibrate_rig,
    detect_board,
    detect_markers,
    figures,
    findings_of,
    laser_weights,
    parse_board,
    stripe_candidates,
)
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output, write_atomically
from turnscan.cli._progress import progress
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import rig_to_json
from turnscan.scan import list_pictures, numbers_apart, picture_numbers, read_picture

_COLOURS = {
    "grey": (1.0, 1.0, 1.0),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
}
_LESSONS = 8

Orientation = Literal["vertical", "horizontal"]


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
    size = _SameSize()
    views = _camera_views(list_pictures(camera), plain, size)
    on_boards: dict[str, Sequence[LaserPicture]] = {}
    weights: dict[str, Floats | None] = {}
    second = plain if laser_board is None else parse_board(laser_board)
    for name, spec in groups.items():
        pairs = _pairs(list_pictures(spec), darks.get(name), f"--laser {name}")
        weights[name] = _weights(colour, pairs, second)
        on_boards[name] = _laser_pictures(pairs, second, weights[name], orientation, size)
    pairs = _pairs(list_pictures(table), table_dark, "--table")
    mix = None if lit_on_table is None else weights[lit_on_table]
    turned = _table_pictures(pairs, settings, lit_on_table, mix, size)
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


class _SameSize:
    """Checks that all pictures come from one camera at one resolution."""

    def __init__(self) -> None:
        self.first: tuple[str, tuple[int, ...]] | None = None

    def check(self, path: Path, picture: Image) -> Image:
        """The picture; raises InputError where its size is not that of the first one."""
        shape = picture.shape[:2]
        if self.first is None:
            self.first = (str(path), shape)
        elif self.first[1] != shape:
            a, (h, w) = self.first
            raise InputError(
                f"pictures of different size: {a} is {w}×{h}, {path} is {shape[1]}×{shape[0]}",
                hint="calibrate with pictures of one camera at one resolution",
            )
        return picture


def _camera_views(paths: list[Path], board: Board, size: _SameSize) -> list[BoardView]:
    out = []
    with progress("camera boards", len(paths)) as tick:
        for p in paths:
            out.append(detect_board(size.check(p, read_picture(p)), board, p.name))
            tick()
    return out


def _pairs(lit: list[Path], dark: str | None, option: str) -> list[tuple[Path, Path | None]]:
    if dark is None:
        return [(p, None) for p in lit]
    off = list_pictures(dark)
    if len(off) not in (1, len(lit)):
        raise InputError(
            f"{option}: {len(lit)} pictures with the laser on, {len(off)} with it off",
            hint="give as many, or one for all",
        )
    return [(p, off[0] if len(off) == 1 else q) for p, q in zip(lit, off * len(lit), strict=False)]


def _weights(colour: str, pairs: list[tuple[Path, Path | None]], board: Board) -> Floats | None:
    """Weights (3,) of the colours; None where the pictures are grey."""
    if colour in _COLOURS:
        return np.array(_COLOURS[colour])
    if colour != "learn":
        try:
            weights = np.array([float(x) for x in colour.split(",")])
        except ValueError:
            weights = np.zeros(0)
        if weights.shape != (3,) or not np.isfinite(weights).all() or not weights.any():
            raise InputError(
                f"--colour {colour!r} is no colour",
                hint="give red, green, blue, grey, three weights like -0.5,1,-0.5, or learn",
            )
        return weights
    lessons = []
    few = np.linspace(0, len(pairs) - 1, min(len(pairs), _LESSONS)).astype(int)
    for k in few:
        lit, dark = pairs[k]
        picture = read_picture(lit)
        if picture.ndim == 2:
            return None
        view = detect_board(picture, board)
        off = None if dark is None else read_picture(dark)
        excess = laser_weights(picture, off, view.corners)
        if excess is not None:
            lessons.append(excess)
    if not lessons:
        return np.array(_COLOURS["grey"])
    # One channel, not a mix: a lens puts the colours at slightly different places.
    best: Floats = np.eye(3)[int(np.mean(lessons, axis=0).argmax())]
    return best


def _laser_pictures(
    pairs: list[tuple[Path, Path | None]],
    board: Board,
    weights: Floats | None,
    orientation: Orientation,
    size: _SameSize,
) -> list[LaserPicture]:
    out = []
    with progress("laser boards", len(pairs)) as tick:
        for lit, dark in pairs:
            picture = size.check(lit, read_picture(lit))
            off = None if dark is None else size.check(dark, read_picture(dark))
            view = detect_board(picture if off is None else off, board, lit.name)
            light = np.zeros((0, 2))
            if not view.failure:
                light = stripe_candidates(picture, off, weights, orientation)
            out.append(LaserPicture(view, light))
            tick()
    return out


def _table_pictures(
    pairs: list[tuple[Path, Path | None]],
    settings: CalibrationSettings,
    laser: str | None,
    weights: Floats | None,
    size: _SameSize,
) -> list[TablePicture]:
    steps = _steps([p.name for p, _ in pairs])
    out = []
    with progress("table", len(pairs)) as tick:
        for (lit, dark), step in zip(pairs, steps, strict=True):
            picture = size.check(lit, read_picture(lit))
            off = None if dark is None else size.check(dark, read_picture(dark))
            clear = picture if off is None else off
            light = {}
            if laser is not None:
                light[laser] = stripe_candidates(picture, off, weights, settings.orientation)
            if settings.table_board is None:
                seen = detect_markers(clear, settings.dictionary)
                out.append(TablePicture(seen, light, lit.name, step))
            else:
                view = detect_board(clear, settings.table_board, lit.name)
                out.append(TablePicture(view, light, lit.name, step))
            tick()
    return out


def _steps(names: list[str]) -> list[float]:
    """Step numbers from the numbers in the names, or 0, 1, 2 …"""
    numbers = picture_numbers(names)
    if numbers is None:
        return [float(k) for k in range(len(names))]
    first = min(numbers)
    apart = numbers_apart(numbers, first)
    return [float((n - first) // apart) for n in numbers]


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

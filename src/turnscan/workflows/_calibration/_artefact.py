"""Artefact: things to print and to measure once, and the file that says what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, get_args

from turnscan.calibrate import Charuco, parse_board
from turnscan.errors import InputError
from turnscan.formats import export
from turnscan.shapes.verification import (
    artefact_from_text,
    ball_bar_body,
    stand_body,
    step_block_body,
)
from turnscan.workflows._calibration._drawings import (
    Drawing,
    bar_drawing,
    block_drawing,
    dial_sheet,
    drawn,
    target_sheet,
)
from turnscan.workflows._options._calibrate import marker_kind

Form = Literal["target", "dial", "ball-bar", "step-block"]
Sheet = Literal["pdf", "svg", "png"]

TARGET = "charuco:9x6:24:18:DICT_5X5_100"
_MARKERS = "DICT_4X4_50:24"
_BALL = 30.0
"""mm: diameter of a bar's balls."""
PAPERS: Mapping[str, tuple[float, float]] = {
    "a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4),
}  # fmt: skip
"""mm, upright."""
_PRINTED = 0.2
"""mm: expanded uncertainty of a nominal dimension of a print, until it is measured."""


def artefact(
    form: str,
    *,
    name: str = "",
    board: str = TARGET,
    markers: str | None = None,
    paper: str = "a4",
    sheet: Sheet = "pdf",
    diameter: float | None = None,
    distance: float = 100.0,
    heights: Sequence[float] = (5.0, 15.0, 30.0),
) -> dict[str, bytes]:
    """The files of an artefact, by name: what is printed, its drawing, and its file to fill in.

    ``form`` is ``target`` (the ``board``, charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT, to scale on
    ``paper`` with rulers of 100 mm both ways), ``dial`` (a disc for the platter with ``markers``,
    DICT:SIDE_MM or the usual ones, whose turn `import_pictures` reads; ``diameter`` mm, or all of
    the paper), ``ball-bar`` (two balls of ``diameter`` mm, 30 where None, ``distance`` mm between
    their centres) or ``step-block`` (levels ``heights`` mm above the first). Bodies
    come as STL (mm). ``name`` is what the artefact is called in its file.

    The TOML file holds the nominal dimensions, and says so until somebody writes in what was
    measured; `turnscan.workflows.verify` reads it. Raises InputError for another form, for sizes
    that cannot be, and for a board that is larger than the paper.
    """
    if form not in get_args(Form):
        raise InputError(f"no artefact {form!r}", hint=f"there is {', '.join(get_args(Form))}")
    if paper not in PAPERS:
        raise InputError(f"no paper {paper!r}", hint=f"there is {', '.join(PAPERS)}")
    if form == "target":
        return {f"target.{sheet}": drawn(_target(board, PAPERS[paper]), sheet)}
    if form == "dial":
        dial = dial_sheet(*marker_kind(markers or _MARKERS), diameter, PAPERS[paper])
        return {f"dial.{sheet}": drawn(dial, sheet)}
    called = name or form
    if form == "ball-bar":
        diameter = _BALL if diameter is None else diameter
        bodies = {form: ball_bar_body(diameter, distance), f"{form}-stand": stand_body(diameter)}
        drawing = bar_drawing(called, diameter, distance, PAPERS[paper])
        text = _bar_file(called, diameter, distance)
    else:
        bodies = {form: step_block_body(heights)}
        drawing = block_drawing(called, heights, PAPERS[paper])
        text = _block_file(called, heights)
    artefact_from_text(text, f"{form}.toml")
    return {
        **{f"{part}.stl": export(body, ".stl") for part, body in bodies.items()},
        f"{form}-drawing.{sheet}": drawn(drawing, sheet),
        f"{form}.toml": text.encode(),
    }


def _target(text: str, paper: tuple[float, float]) -> Drawing:
    board = parse_board(text)
    if not isinstance(board, Charuco):
        raise InputError(f"board {text!r}: no ChArUco board", hint=f"write {TARGET}")
    return target_sheet(board, text, paper)


_HEAD = """\
# What is known of this artefact, for turnscan verify. Lengths in millimetres.
# The numbers below are those of the drawing. Measure each once (micrometer, calliper, or a
# laboratory), write in what was found with its expanded uncertainty U (k = 2), and say under
# "measured" who did it, when and with what. While that is empty, verify warns.
format = "turnscan-artefact"
version = 1
kind = "{kind}"
name = {name}
measured = ""                   # "J. Doe, 2026-05-02, micrometer No. 7, 20 °C"
"""
_TAIL = """
form_mm = 0.05                  # largest deviation of {what} from their form
{limits}
[drift]
# scatter_mm = 0.005            # standard deviation of a value when the artefact is set up again;
                                # without it, it is judged from the history
"""
_LIMITS = """
[limits_mm]                     # what the values may be at most; take # away where wanted
"""


def _bar_file(name: str, diameter: float, distance: float) -> str:
    r = f"{diameter:g}"
    lengths = (
        f"\ndiameters_mm = [{r}, {r}]     # lower ball, upper ball"
        f"\ndiameters_U_mm = [{_PRINTED}, {_PRINTED}]"
        f"\ndistance_mm = {distance:g}               # between their centres: the length over both"
        f"\n                                # balls minus half of each diameter"
        f"\ndistance_U_mm = {_PRINTED}\n"
    )
    limits = _LIMITS + (
        "# form = 0.3                    # range of the radii of a ball, without the outer 0.3 %\n"
        "# form95 = 0.2                  # shell that holds 95 % of the points\n"
        "# size = 0.1                    # diameter\n"
        "# distance = 0.1                # between the centres\n"
        "# repeatability = 0.02          # standard deviation over several scans\n"
    )
    head = _HEAD.format(kind="ball-bar", name=_quoted(name))
    return head + lengths + _TAIL.format(what="the balls", limits=limits)


def _block_file(name: str, heights: Sequence[float]) -> str:
    levels = ", ".join(f"{h:g}" for h in heights)
    U = ", ".join([str(_PRINTED)] * len(heights))
    lengths = (
        f"\nheights_mm = [{levels}]       # of the further levels above the first\n"
        f"heights_U_mm = [{U}]\n"
    )
    limits = _LIMITS + (
        "# flatness = 0.3                # range of a face, without the outer 0.3 %\n"
        "# height = 0.1                  # of a level above the first\n"
        "# repeatability = 0.02          # standard deviation over several scans\n"
    )
    head = _HEAD.format(kind="step-block", name=_quoted(name))
    return head + lengths + _TAIL.format(what="the faces", limits=limits)


def _quoted(name: str) -> str:
    """A TOML string. Raises InputError for a name that is none."""
    if not name.strip() or len(name) > 100 or not name.isprintable():
        raise InputError(f"name {name!r}", hint="take 1 to 100 printable characters")
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'

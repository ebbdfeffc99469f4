"""Calibrate: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from turnscan.arrays import Floats
from turnscan.calibrate import (
    Board,
    Calibration,
    Figures,
    LaserPicture,
    calibrate_rig,
    figures,
    findings_of,
    parse_board,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option
from turnscan.rig import Rig, rig_to_json
from turnscan.scan import list_pictures
from turnscan.workflows._calibrate_options import CalibrateOptions
from turnscan.workflows._calibrate_pictures import (
    SameSize,
    camera_views,
    colour_weights,
    laser_pictures,
    table_pictures,
    with_dark,
)
from turnscan.workflows._declare import chosen
from turnscan.workflows._files import check_output, write_atomically

_STAGES = 4
"""How often an adjustment says how far it is."""


@dataclass(frozen=True)
class CalibrationPictures:
    """Where the pictures of a calibration are: each a folder, a pattern or a file."""

    camera: str
    """The board in many poses, the laser off."""
    laser: Mapping[str, str]
    """The board with the stripe on it or on its white margin, by the names of the lasers."""
    table: str
    """Pictures of the empty table, step by step."""
    laser_dark: Mapping[str, str] | None = None
    """The same as ``laser`` with the laser off: as many pictures as with it on, or one."""
    table_dark: str | None = None
    """The same as ``table`` with the laser off."""


@dataclass(frozen=True)
class CalibratedRig:
    """A rig file, and how well the rig is known."""

    path: Path
    calibration: Calibration
    figures: Figures
    stages: tuple[str, ...]
    """What each stage of the calibration had to go by, in words."""
    findings: tuple[Finding, ...]

    @property
    def rig(self) -> Rig:
        """The rig, with its uncertainty."""
        return self.calibration.rig

    def _repr_html_(self) -> str:
        f = self.figures
        rows: list[tuple[str, object]] = [
            ("boards", f"{f.camera_rms_px:.3f} px rms in {f.camera_views} pictures"),
            *((f"sheet {n}", f"{mm:.3f} mm rms") for n, mm in f.sheet_rms_mm.items()),
            *((f"radius at {at}", f"± {k2:.3f} mm (k = 2)") for at, k2 in f.radius_k2_mm.items()),
            *((finding.severity, finding.message) for finding in self.findings),
        ]
        return self.rig.html(f"Calibration {self.path.name}", rows)

    def __fspath__(self) -> str:
        """Its path: it stands for the rig file wherever a file is wanted."""
        return fspath(self.path)


def calibrate(
    pictures: CalibrationPictures,
    board: str,
    output: str | PathLike[str],
    options: CalibrateOptions | None = None,
    *,
    report: str | PathLike[str] | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> CalibratedRig:
    """Calibrate camera, laser sheets and table from pictures; the board's square gives the scale.

    Parameters
    ----------
    pictures
        Where they are.
    board
        ``chessboard:COLSxROWS:SQUARE_MM`` (inner corners) or
        ``charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT`` (squares).
    output
        The rig file, ``….json``.
    options
        What there is on the table and in the pictures; ``markers`` or ``table_board`` is needed.
    report
        A report to write, ``….html``; None for none.
    progress
        Told how far it is; it may cancel.
    changes
        Options to change by name, as in ``markers="DICT_4X4_50:30"``.

    Returns
    -------
    CalibratedRig
        The calibration, with figures and findings; it stands for the rig file wherever one is
        wanted.

    Raises
    ------
    InputError, FormatError
        Pictures and options that do not fit together, or cannot be read.
    NotEnoughViews, Degenerate, DidNotConverge
        The pictures do not determine the rig.
    ExportError
        A file cannot be written.
    Cancelled
        By ``progress``; nothing is written then, as after any error.

    >>> import turnscan as ts
    >>> board = "charuco:7x5:8:6:DICT_5X5_50"
    >>> taken = ts.CalibrationPictures("boards", {"left": "boards"}, "table")
    >>> ts.calibrate(taken, board, "rig.json", markers="DICT_4X4_50:20")
    Traceback (most recent call last):
    turnscan.errors.InputError: boards: no such file or folder → check the path
    """
    output, report = Path(output), None if report is None else Path(report)
    wanted = chosen(CalibrateOptions, options, changes)
    check_output(output, (".json",))
    if report is not None:
        check_output(report, (".html",))
    if not pictures.laser:
        raise InputError("no pictures of a laser are named", option=Option("laser"))
    result, stages = _adjusted(pictures, parse_board(board), wanted, progress)
    found = figures(result)
    remarks = findings_of(result, found)
    if report is not None:
        from turnscan.workflows._calibrate_report import report_html

        text = report_html(result, found, remarks, _paths(pictures))
        write_atomically(report, text.encode())
    write_atomically(output, rig_to_json(result.rig).encode())
    return CalibratedRig(output, result, found, tuple(stages), tuple(remarks))


def _adjusted(
    pictures: CalibrationPictures, board: Board, options: CalibrateOptions, progress: Progress
) -> tuple[Calibration, Sequence[str]]:
    """All pictures read and adjusted, and what each stage had to go by."""
    settings = options.settings()
    lit_on_table = options.lit_on_table(list(pictures.laser))
    size = SameSize()
    views = camera_views(
        list_pictures(pictures.camera), board, size, progress.subrange(0, 0.2, "camera boards")
    )
    boards = progress.subrange(0.2, 0.4, "laser boards")
    on_boards, weights = _on_boards(pictures, board, options, size, boards)
    pairs = with_dark(list_pictures(pictures.table), pictures.table_dark, Option("table"))
    mix = None if lit_on_table is None else weights[lit_on_table]
    turning = progress.subrange(0.4, 0.7, "table")
    turned = table_pictures(pairs, settings, lit_on_table, mix, size, turning)
    adjusting = progress.subrange(0.7, 1.0, "adjusting")
    stages: list[str] = []

    def stage(text: str) -> None:
        stages.append(text)
        adjusting(len(stages) / _STAGES)

    adjusting(0.0)
    return calibrate_rig(views, on_boards, turned, settings, stage), stages


def _on_boards(
    pictures: CalibrationPictures,
    board: Board,
    options: CalibrateOptions,
    size: SameSize,
    progress: Progress,
) -> tuple[dict[str, Sequence[LaserPicture]], dict[str, Floats | None]]:
    """What each laser drew on the board, and the weights of its colour."""
    on_boards: dict[str, Sequence[LaserPicture]] = {}
    weights: dict[str, Floats | None] = {}
    second = board if options.laser_board is None else parse_board(options.laser_board)
    darks = pictures.laser_dark or {}
    count = len(pictures.laser)
    for k, (name, spec) in enumerate(pictures.laser.items()):
        pairs = with_dark(list_pictures(spec), darks.get(name), Option("laser", name))
        weights[name] = colour_weights(options.colour, pairs, second)
        mine = progress.subrange(k / count, (k + 1) / count)
        on_boards[name] = laser_pictures(
            pairs, second, weights[name], options.orientation, size, mine
        )
    return on_boards, weights


def _paths(pictures: CalibrationPictures) -> dict[tuple[str, str], Path]:
    """Where each picture lies, by its role and name."""
    roles = {"camera": pictures.camera, "table": pictures.table}
    roles |= {f"laser {name}": spec for name, spec in pictures.laser.items()}
    return {(role, p.name): p for role, spec in roles.items() for p in list_pictures(spec)}

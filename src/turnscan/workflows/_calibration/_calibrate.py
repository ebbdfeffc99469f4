"""Calibrate: pictures of boards and of the turning table become a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from turnscan.arrays import Floats
from turnscan.calibrate import (
    Advice,
    Board,
    Calibration,
    CalibrationQuality,
    CalibrationSettings,
    KnownRig,
    LaserPicture,
    TablePicture,
    advice_of,
    calibrate_rig,
    figures,
    findings_of,
    parse_board,
    refuse_poor,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig, rig_to_json
from turnscan.scan import list_pictures
from turnscan.workflows._calibration._calibrate_look import (
    check_sizes,
    look_for_board,
    look_for_markers,
    look_for_part,
)
from turnscan.workflows._calibration._calibrate_pictures import (
    camera_views,
    laser_pictures,
    table_pictures,
    weights_for,
    with_dark,
)
from turnscan.workflows._files._reading import read_rig_file
from turnscan.workflows._files._writing import check_output, write_atomically
from turnscan.workflows._importing._colour import LEARN, colour_weights
from turnscan.workflows._options._calibrate import CalibrateOptions
from turnscan.workflows._options._declare import chosen

_STAGES = (0.45, 0.5, 0.8)
"""How far it is when an adjustment has done with the camera, the sheets, the table."""


@dataclass(frozen=True)
class CalibrationPictures:
    """Where the pictures of a calibration are: each a folder, a pattern or a file.

    Any of the stages may be left out where the rig that is started from knows it, or where it is
    to follow later.
    """

    camera: str | None = None
    """The board in many poses, the laser off."""
    laser: Mapping[str, str] = field(default_factory=dict)
    """The board with the stripe on it or on its white margin, by the names of the lasers."""
    table: str | None = None
    """Pictures of the empty table, step by step."""
    laser_dark: Mapping[str, str] | None = None
    """The same as ``laser`` with the laser off: as many pictures as with it on, or one."""
    table_dark: str | None = None
    """The same as ``table`` with the laser off."""


@dataclass(frozen=True)
class CalibratedRig:
    """A rig file, and how well the rig is known."""

    path: Path
    rig: Rig
    calibration: Calibration | None
    """None where there were no pictures, only what a ruler says."""
    figures: CalibrationQuality | None
    stages: tuple[str, ...]
    """What each stage of the calibration had to go by, in words."""
    advice: Advice
    """What is still undetermined, and which pictures would help most."""
    findings: tuple[Finding, ...]

    def _repr_html_(self) -> str:
        f = self.figures
        if f is None:
            return self.rig.html(f"Calibration {self.path.name}")
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
    board: str | None,
    output: str | PathLike[str],
    options: CalibrateOptions | None = None,
    *,
    rig: Rig | str | PathLike[str] | None = None,
    report: str | PathLike[str] | None = None,
    progress: Progress = no_progress,
    **changes: Any,
) -> CalibratedRig:
    """Calibrate a rig, or stages of one, from pictures; the board's square gives the scale.

    Parameters
    ----------
    pictures
        Where they are, of all stages or of some: camera alone; lasers or the table of a rig whose
        camera is known.
    board
        ``chessboard:COLSxROWS:SQUARE_MM`` (inner corners) or
        ``charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT`` (squares); None where no stage needs it.
    output
        The rig file, ``….json``.
    options
        What there is on the table and in the pictures; with pictures of the table, ``markers`` or
        ``table_board`` is needed.
    rig
        What is known already: a rig or its file, whose stages without pictures are held by their
        uncertainty while the others start anew; or what a ruler says (``….toml``), which counts,
        by its wide uncertainty, for stages with pictures, too.
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
        Pictures and options that do not fit together, cannot be read, or show something else.
    NotEnoughViews, Degenerate, DidNotConverge
        The pictures do not determine the rig, or it does not fit them.
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
    known = _known(rig)
    _check_stages(pictures, board, wanted, known)
    if not pictures.camera and not pictures.laser and not pictures.table:
        assert known is not None
        write_atomically(output, rig_to_json(known.rig).encode())
        return CalibratedRig(output, known.rig, None, None, (), advice_of(known.rig), ())
    target = None if board is None else parse_board(board)
    result, stages = _adjusted(pictures, target, wanted, known, progress)
    return _written(result, stages, output, report, pictures)


def _written(
    result: Calibration,
    stages: Sequence[str],
    output: Path,
    report: Path | None,
    pictures: CalibrationPictures,
) -> CalibratedRig:
    found = figures(result)
    refuse_poor(result, found)
    advice = advice_of(result.rig, result)
    remarks = findings_of(result, found)
    if report is not None:
        from turnscan.workflows._calibration._calibrate_report import report_html

        text = report_html(result, found, advice, remarks, _paths(pictures))
        write_atomically(report, text.encode())
    write_atomically(output, rig_to_json(result.rig).encode())
    return CalibratedRig(output, result.rig, result, found, tuple(stages), advice, tuple(remarks))


def _known(rig: Rig | str | PathLike[str] | None) -> KnownRig | None:
    if rig is None:
        return None
    if isinstance(rig, Rig):
        return KnownRig(rig)
    return KnownRig(read_rig_file(rig, partial=True), Path(rig).suffix.lower() == ".toml")


def _check_stages(
    pictures: CalibrationPictures,
    board: str | None,
    options: CalibrateOptions,
    known: KnownRig | None,
) -> None:
    """Raise InputError where a stage lacks what it begins with."""
    some = bool(pictures.camera or pictures.laser or pictures.table)
    if not some and (known is None or not known.counts):
        raise InputError(
            "no pictures are named",
            hint=Remedy("give ", Option("camera"), ", ", Option("laser"), " or ", Option("table")),
        )
    if (pictures.camera or pictures.laser) and board is None:
        raise InputError("which board do the pictures show?", option=Option("board"))
    if not pictures.camera and known is None:
        stage = "laser" if pictures.laser else "table"
        raise InputError(
            "the camera is not known, and this stage begins with it",
            hint=Remedy("give the pictures of the board (", Option("camera"),
                        "), or the rig whose camera is calibrated (", Option("rig"), ")"),
            option=Option(stage),
        )  # fmt: skip
    for name in pictures.laser:
        if name in ("camera", "table"):
            raise InputError(
                "this name has another meaning, a laser cannot have it",
                hint="give it another name",
                option=Option("laser", name),
            )
    if pictures.table and options.markers is None and options.table_board is None:
        raise InputError(
            "table: neither markers nor a board on it is named",
            hint=Remedy("give either ", Option("markers"), " or ", Option("table_board")),
        )


@dataclass(frozen=True)
class _Found:
    """The pictures of a calibration, as paths: lit and dark ones."""

    camera: list[Path]
    laser: dict[str, list[tuple[Path, Path | None]]]
    table: list[tuple[Path, Path | None]]

    def all(self) -> list[Path]:
        """Every picture once."""
        pairs = [*(pair for some in self.laser.values() for pair in some), *self.table]
        every = [*self.camera, *(p for pair in pairs for p in pair if p is not None)]
        return list(dict.fromkeys(every))


def _listed(pictures: CalibrationPictures) -> _Found:
    darks = pictures.laser_dark or {}
    camera = [] if pictures.camera is None else list_pictures(pictures.camera)
    laser = {
        name: with_dark(list_pictures(spec), darks.get(name), Option("laser", name))
        for name, spec in pictures.laser.items()
    }
    table: list[tuple[Path, Path | None]] = []
    if pictures.table is not None:
        table = with_dark(list_pictures(pictures.table), pictures.table_dark, Option("table"))
    return _Found(camera, laser, table)


def _first_look(
    found: _Found, board: Board | None, second: Board | None, settings: CalibrationSettings
) -> None:
    """Refuse pictures that are not of one size, or of another stage or target, by the first."""
    check_sizes(found.all())
    if found.camera and board is not None:
        look_for_board(found.camera, board, Option("camera"), settings.dictionary)
    for name, pairs in found.laser.items():
        if second is not None:
            clear = [lit if dark is None else dark for lit, dark in pairs]
            look_for_board(clear, second, Option("laser", name), settings.dictionary)
    if found.table:
        clear = [lit if dark is None else dark for lit, dark in found.table]
        if settings.table_board is None:
            look_for_markers(clear, settings.dictionary, board)
        else:
            look_for_board(clear, settings.table_board, Option("table"), settings.dictionary)


def _adjusted(
    pictures: CalibrationPictures,
    board: Board | None,
    options: CalibrateOptions,
    known: KnownRig | None,
    progress: Progress,
) -> tuple[Calibration, Sequence[str]]:
    """All pictures read and adjusted, and what each stage had to go by."""
    settings = options.settings()
    if options.colour != LEARN:
        colour_weights(options.colour)  # a wrong one is refused before pictures are searched
    lasers = list(dict.fromkeys([*pictures.laser, *_sheets_of(known)]))
    lit_on_table = options.lit_on_table(lasers) if pictures.table else None
    found = _listed(pictures)
    second = board if options.laser_board is None else parse_board(options.laser_board)
    progress(0.0, "first look")
    _first_look(found, board, second, settings)
    mix = None
    if found.table and lit_on_table is not None:
        mix = weights_for(options.colour, found.table, settings.table_board or settings.dictionary)
        if settings.table_board is None:
            look_for_part(found.table, settings.dictionary, mix, options.orientation)
    views = []
    if board is not None and found.camera:
        views = camera_views(found.camera, board, progress.subrange(0.05, 0.25, "camera boards"))
    boards = progress.subrange(0.25, 0.4, "laser boards")
    on_boards, weights = _on_boards(found, second, options, boards)
    if lit_on_table in weights:
        mix = weights[lit_on_table]
    stages: list[str] = []
    progress(0.4, "adjusting")

    def stage(text: str) -> None:
        stages.append(text)
        progress(_STAGES[len(stages) - 1], "adjusting")

    def turned() -> Sequence[TablePicture]:
        mine = progress.subrange(0.5, 0.75, "table")
        return table_pictures(found.table, settings, lit_on_table, mix, mine)

    return calibrate_rig(views, on_boards, turned, settings, stage, known), stages


def _sheets_of(known: KnownRig | None) -> list[str]:
    return [] if known is None else [sheet.name for sheet in known.rig.sheets]


def _on_boards(
    found: _Found, board: Board | None, options: CalibrateOptions, progress: Progress
) -> tuple[dict[str, Sequence[LaserPicture]], dict[str, Floats | None]]:
    """What each laser drew on the board, and the weights of its colour."""
    on_boards: dict[str, Sequence[LaserPicture]] = {}
    weights: dict[str, Floats | None] = {}
    count = len(found.laser)
    for k, (name, pairs) in enumerate(found.laser.items()):
        assert board is not None
        weights[name] = weights_for(options.colour, pairs, board)
        mine = progress.subrange(k / count, (k + 1) / count)
        on_boards[name] = laser_pictures(pairs, board, weights[name], options.orientation, mine)
    return on_boards, weights


def _paths(pictures: CalibrationPictures) -> dict[tuple[str, str], Path]:
    """Where each picture lies, by its role and name."""
    roles = {"camera": pictures.camera, "table": pictures.table}
    roles |= {f"laser {name}": spec for name, spec in pictures.laser.items()}
    return {(role, p.name): p for role, spec in roles.items() if spec for p in list_pictures(spec)}

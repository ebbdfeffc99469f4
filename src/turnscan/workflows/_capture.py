"""Capture: pictures for a calibration, taken with what is connected."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from turnscan.arrays import Floats, Image
from turnscan.calibrate import Board, coverage, detect_board, parse_board
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.scanner import Opened, Shot, photograph
from turnscan.workflows._capture_options import CaptureOptions
from turnscan.workflows._device_options import DeviceOptions
from turnscan.workflows._png import write_png
from turnscan.workflows._scan import opened_devices


@dataclass(frozen=True)
class CapturedPicture:
    """One picture of a series, and what was seen in it."""

    stage: str
    name: str
    """Of its file."""
    laser: str
    """Lit in it; empty for none."""
    corners: int | None = None
    """Corners of the board that were found; None where none was looked for."""
    failure: str = ""
    """Why it is of no use; empty where it is."""

    def __str__(self) -> str:
        words = f"{self.stage} {self.name}"
        if self.laser:
            words += f", {self.laser}"
        if self.corners is not None:
            words += f": {self.failure or f'{self.corners} corners'}"
        return words


@dataclass(frozen=True)
class CapturedPictures:
    """The pictures that a series came to."""

    folder: Path
    pictures: tuple[CapturedPicture, ...]
    coverage: float | None = None
    """Fraction of the picture in which board corners were seen; None where none were searched."""

    def __str__(self) -> str:
        text = f"{self.folder}: {len(self.pictures)} pictures"
        if self.coverage is not None:
            good = sum(not picture.failure for picture in self.pictures)
            text += f", the board in {good}; {self.coverage:.0%} of the picture has been covered"
        return text


def _ignore(picture: CapturedPicture) -> None:
    """Show nothing."""


def capture(
    folder: str | Path,
    options: CaptureOptions | None = None,
    *,
    devices: DeviceOptions | Opened | None = None,
    board: str | None = None,
    taken: Callable[[CapturedPicture], None] = _ignore,
    progress: Progress = no_progress,
) -> CapturedPictures:
    """Take pictures of a board into a folder, for `calibrate`.

    Parameters
    ----------
    folder
        Where they go: camera/, laser-NAME/ with laser-NAME-dark/, table/ and table-lit/, numbered
        on from those that are there.
    options
        What is taken; None takes one picture of a board.
    devices
        Their addresses, or devices that are open; None takes a simulated rig.
    board
        The board to look for in each picture, as in `calibrate`; None looks for none.
    taken
        Called after each picture with what was seen in it.
    progress
        Told how far it is; it may cancel. What was taken stays.

    Returns
    -------
    CapturedPictures
        Each picture, and how much of the camera's picture the board has covered.

    Raises
    ------
    InputError
        Where ``folder`` is a file, and for pictures that cannot be.
    FormatError
        For a board that is none.
    DeviceError, SafetyError
        As the devices do; the lasers are dark then.
    """
    folder, chosen = Path(folder), options or CaptureOptions()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder", hint="name a folder for the pictures")
    album = _Album(folder, chosen.stage, None if board is None else parse_board(board))
    with opened_devices(devices) as bench:
        series = chosen.series(bench.hardware.lasers.names)
        shots = len(series.angles_deg()) * max(len(series.lasers), 1)

        def keep(shot: Shot) -> None:
            taken(album.keep(shot))
            progress(len(album.pictures) / shots, "taking pictures")

        def wait(seconds: float) -> None:
            progress(len(album.pictures) / shots, "taking pictures")
            time.sleep(seconds)

        photograph(bench, series, keep, wait)
    return album.all


class _Album:
    """A folder of pictures, and what is seen in them."""

    def __init__(self, folder: Path, stage: str, board: Board | None) -> None:
        self._folder, self._stage, self._board = folder, stage, board
        self._first = 1 + max(map(_number, folder.glob(f"{stage}*/*.png")), default=0)
        self._corners: list[Floats] = []
        self._size = (1, 1)
        self.pictures: list[CapturedPicture] = []

    def keep(self, shot: Shot) -> CapturedPicture:
        """Write a picture, with and without laser; what is seen in it."""
        name = f"{self._first + shot.stop:04d}.png"
        if self._stage == "laser":
            self._write(f"laser-{shot.laser}-dark", name, shot.dark)
            self._write(f"laser-{shot.laser}", name, shot.lit)
        else:
            self._write(self._stage, name, shot.dark)
            self._write(f"{self._stage}-lit", name, shot.lit)
        self.pictures.append(self._seen(shot, name))
        return self.pictures[-1]

    def _seen(self, shot: Shot, name: str) -> CapturedPicture:
        if self._board is None:
            return CapturedPicture(self._stage, name, shot.laser)
        view = detect_board(shot.dark, self._board, name)
        if not view.failure:
            self._corners.append(view.corners)
            self._size = view.size
        return CapturedPicture(self._stage, name, shot.laser, len(view.corners), view.failure)

    @property
    def all(self) -> CapturedPictures:
        """What there is of them."""
        corners: Sequence[Floats] = self._corners
        share = None if self._board is None else coverage(corners, *self._size)
        return CapturedPictures(self._folder, tuple(self.pictures), share)

    def _write(self, kind: str, name: str, picture: Image | None) -> None:
        if picture is not None:
            folder = self._folder / kind
            folder.mkdir(parents=True, exist_ok=True)
            write_png(folder / name, picture)


def _number(path: Path) -> int:
    return int(path.stem) if path.stem.isdigit() else 0

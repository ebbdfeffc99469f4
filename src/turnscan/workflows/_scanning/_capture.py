"""Capture: pictures for a calibration, taken with what is connected."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.calibrate import Board, BoardView, coverage, detect_board, parse_board
from turnscan.errors import InputError
from turnscan.progress import Progress, no_progress
from turnscan.scanner import Addresses, Opened, Shot, opened, photograph
from turnscan.stripes import Orientation
from turnscan.workflows._options._capture import CaptureOptions
from turnscan.workflows._options._device import DeviceOptions
from turnscan.workflows._pages._png import write_png
from turnscan.workflows._scanning._live_look import seen_stripe
from turnscan.workflows._scanning._scan import opened_devices

_LINE, _BEND = 0.3, 2.0
"""Of a board's rows: fewer with a line show none. px: a line bends by less from row to row."""


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
    album = Album(folder, chosen.stage, None if board is None else parse_board(board))
    with _bench(devices, chosen) as bench:
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


def _bench(
    devices: DeviceOptions | Opened | None, options: CaptureOptions
) -> AbstractContextManager[Opened]:
    """The devices that the pictures need: a camera alone where nothing is lit or driven."""
    if isinstance(devices, DeviceOptions) and devices.camera is not None:
        lit = options.stage == "laser" or options.laser_name is not None
        by_hand = devices.turntable == "manual:" or (
            devices.turntable is None and options.stage == "camera" and options.range_deg is None
        )
        if by_hand and not lit and devices.lasers is None and devices.device is None:
            return opened(Addresses(devices.camera, "manual:", ""))
    return opened_devices(devices)


class Album:
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
        why = view.failure or self._no_line(shot, view)
        return CapturedPicture(self._stage, name, shot.laser, len(view.corners), why)

    def _no_line(self, shot: Shot, view: BoardView) -> str:
        """Why the laser's picture is of no use; empty where a line crosses the board."""
        if self._stage != "laser" or shot.lit is None:
            return ""
        low, high = view.corners.min(axis=0), view.corners.max(axis=0)
        ways: tuple[tuple[Orientation, int], ...] = (("vertical", 1), ("horizontal", 0))
        for way, k in ways:
            part = seen_stripe(shot.lit, shot.dark, way).position[int(low[k]) : int(high[k]) + 1]
            if len(part) and np.sum(np.abs(np.diff(part, 2)) < _BEND) > _LINE * len(part):
                return ""
        return f"no line of laser {shot.laser} on the board: is it lit, and does it reach there?"

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

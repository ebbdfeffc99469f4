"""``turnscan capture``: pictures for ``turnscan calibrate``, taken with what is connected."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import click

from turnscan.arrays import Floats, Image
from turnscan.calibrate import Board, coverage, detect_board, parse_board
from turnscan.cli._degrees import DegreesRange
from turnscan.cli._hardware import addresses_of, device_options, ended_by_signals, was_interrupted
from turnscan.cli._numbers import Finite
from turnscan.errors import InputError
from turnscan.scanner import Series, Shot, opened, photograph
from turnscan.workflows._png import write_png

_STAGES = ("camera", "laser", "table")


@click.command("capture")
@click.argument("folder", metavar="FOLDER", type=click.Path(path_type=Path))
@click.option("--stage", type=click.Choice(_STAGES), required=True,
              help="What is photographed: the board, the board with each laser, or the table "
                   "with its markers or board.")  # fmt: skip
@device_options
@click.option(
    "--count", type=int, default=1, show_default=True, help="Number of pictures or table positions."
)
@click.option("--every", type=Finite(), default=0.0, show_default=True, metavar="SECONDS",
              help="Delay before each picture, for moving the board.")  # fmt: skip
@click.option("--range-deg", type=DegreesRange(), metavar="A:B",
              help="Turn the table from A to B.  [default: no motion; for stage table "
                   "0:360]")  # fmt: skip
@click.option(
    "--laser-name", metavar="NAME", help="For stage table: laser lit for a second picture."
)
@click.option(
    "--exposure",
    type=Finite(),
    metavar="SECONDS",
    help="Exposure time.  [default: the simulated rig's, or 0.02]",
)
@click.option("--gain", type=Finite(), default=1.0, show_default=True, help="Camera gain, factor.")
@click.option(
    "--board", metavar="SPEC", help="Detect this board in each picture; written as for calibrate."
)
def verb(
    folder: Path,
    stage: str,
    devices: dict[str, str | None],
    count: int,
    every: float,
    range_deg: tuple[Fraction, Fraction] | None,
    laser_name: str | None,
    exposure: float | None,
    gain: float,
    board: str | None,
) -> None:
    """Take pictures of a board into FOLDER, for `turnscan calibrate`.

    They are written to camera/, laser-NAME/ with laser-NAME-dark/, and table/ (table-lit/ with
    --laser-name); numbering continues after existing pictures. With --board, what was detected in
    each picture is printed. Exit code 130 when interrupted; pictures already taken are kept.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder", hint="name a folder for the pictures")
    target = None if board is None else parse_board(board)
    if laser_name is not None and stage != "table":
        raise InputError("--laser-name is for --stage table", hint="laser lights them all")
    if stage == "table" and range_deg is None:
        range_deg = Fraction(0), Fraction(360)
    with ended_by_signals():
        try:
            with opened(addresses_of(devices)) as bench:
                lasers: tuple[str, ...] = () if laser_name is None else (laser_name,)
                if stage == "laser":
                    lasers = bench.hardware.lasers.names
                series = Series(count, range_deg, every, lasers, exposure, gain)
                album = _Album(folder, stage, target)
                photograph(bench, series, album.keep)
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted; the pictures taken so far are stored", err=True)
            sys.exit(130)
    album.tell()


class _Album:
    """A folder of pictures, and what is seen in them."""

    def __init__(self, folder: Path, stage: str, board: Board | None) -> None:
        self._folder, self._stage, self._board = folder, stage, board
        self._first = 1 + max((_number(p) for p in folder.glob(f"{stage}*/*.png")), default=0)
        self._corners: list[Floats] = []
        self._size = (1, 1)
        self._taken = self._good = 0

    def keep(self, shot: Shot) -> None:
        """Write a picture, with and without laser, and say what is seen in it."""
        name = f"{self._first + shot.stop:04d}.png"
        if self._stage == "laser":
            self._write(f"laser-{shot.laser}-dark", name, shot.dark)
            self._write(f"laser-{shot.laser}", name, shot.lit)
        else:
            self._write(self._stage, name, shot.dark)
            self._write(f"{self._stage}-lit", name, shot.lit)
        self._taken += 1
        words = f"{self._stage} {name}"
        if shot.laser:
            words += f", {shot.laser}"
        if self._board is not None:
            view = detect_board(shot.dark, self._board, name)
            words += f": {view.failure or f'{len(view.corners)} corners'}"
            if not view.failure:
                self._good += 1
                self._corners.append(view.corners)
                self._size = view.size
        click.echo(words)

    def tell(self) -> None:
        """Say how many there are, and how much of the picture they cover."""
        text = f"{self._folder}: {self._taken} pictures"
        if self._board is not None:
            share = coverage(self._corners, *self._size)
            text += f", the board in {self._good}; {share:.0%} of the picture has been covered"
        click.echo(text)

    def _write(self, kind: str, name: str, picture: Image | None) -> None:
        if picture is not None:
            folder = self._folder / kind
            folder.mkdir(parents=True, exist_ok=True)
            write_png(folder / name, picture)


def _number(path: Path) -> int:
    return int(path.stem) if path.stem.isdigit() else 0

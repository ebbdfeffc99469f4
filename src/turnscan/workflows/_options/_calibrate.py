"""What a user knows about a rig that is calibrated from pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.workflows._options import _choices as choices
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.calibrate import CalibrationSettings
    from turnscan.stripes import Orientation


@dataclass(frozen=True)
class BoardOptions(Checked):
    """The board in the pictures."""

    board: str | None = option(
        None, "text",
        "chessboard:COLSxROWS:SQUARE_MM (inner corners) or "
        "charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT (squares).",
    )  # fmt: skip


@dataclass(frozen=True)
class CalibrateOptions(Checked):
    """What is known about a rig besides its pictures; None where it is not known.

    Nominal sizes of markers and steps are compared with what the pictures say and never trusted.
    """

    laser_board: str | None = option(
        None, "text", "Board in the laser pictures, if it differs from that of the camera pictures."
    )
    margin_mm: float | None = option(
        None, "number", "Width of the flat margin around the pattern, mm.", least=0
    )
    table_laser: str | None = option(
        None, "text",
        "Laser lit in the table pictures, or none where no laser is lit.  [default: the only "
        "laser]",
    )  # fmt: skip
    markers: str | None = option(
        None, "text", "Markers on the platter: dictionary and nominal side length in mm."
    )
    table_board: str | None = option(
        None, "text", "A board fixed to the table, in place of markers."
    )
    table_board_mm: float = option(
        0.0, "number", "Height of the lowest inner corner of the table board above the platter, mm."
    )
    table_step_deg: float | None = option(
        None, "number", "Nominal table step between pictures, degrees; for comparison only."
    )
    colour: str = option(
        "learn", "text",
        "Colour of the lasers: red, green, blue, grey, three weights R,G,B, or learn (from the "
        "pictures).",
    )  # fmt: skip
    orientation: Orientation = option(
        "vertical",
        "choice",
        "Orientation of the stripe in the picture.",
        choices=choices.ORIENTATION,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.markers is not None and self.table_board is not None:
            raise InputError(
                "table: it has either markers or a board",
                hint=Remedy("give either ", Option("markers"), " or ", Option("table_board")),
            )

    def settings(self) -> CalibrationSettings:
        """The settings of the calibration. Raises InputError for an unknown board or marker."""
        from turnscan.calibrate import CalibrationSettings, parse_board

        dictionary, side = marker_kind(self.markers)
        return CalibrationSettings(
            dictionary=dictionary,
            marker_side=side,
            step=None if self.table_step_deg is None else math.radians(self.table_step_deg),
            margin=self.margin_mm,
            orientation=self.orientation,
            table_board=None if self.table_board is None else parse_board(self.table_board),
            lowest=self.table_board_mm,
        )

    def lit_on_table(self, lasers: list[str]) -> str | None:
        """Which of these lasers is lit in the table pictures; None where none is.

        Raises InputError where that is not known.
        """
        if self.table_laser == "none":
            return None
        if not lasers and self.table_laser is None:
            return None
        if self.table_laser is None and len(lasers) > 1:
            raise InputError(
                f"one of {', '.join(lasers)} must be named as lit in the table pictures",
                hint="name one of them, or none",
                option=Option("table_laser"),
            )
        if self.table_laser is not None and self.table_laser not in lasers:
            raise InputError(
                f"there is {', '.join(lasers)}", option=Option("table_laser", self.table_laser)
            )
        return self.table_laser or lasers[0]


def marker_kind(text: str | None) -> tuple[str, float]:
    """Dictionary and nominal side, mm, of markers like ``DICT_4X4_50:30``."""
    if text is None:
        return "DICT_4X4_50", 0.0
    name, _, side = text.partition(":")
    try:
        length = float(side)
    except ValueError:
        length = -1.0
    if not 0 < length < 1e5:
        raise InputError(
            "not a side length in mm", hint="write DICT_4X4_50:30", option=Option("markers", text)
        )
    from turnscan.calibrate import aruco_dictionary

    aruco_dictionary(name)
    return name, length

"""Requests of calibrations and verifications."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from turnscan.app._protocol import Count, Name
from turnscan.app._requests._base import Angle, Request, Ruler, Seconds, Stage
from turnscan.workflows import LONGEST_PAUSE, MOST_PICTURES, Orientation


class BeginCalibration(Request):
    """Start a new calibration; ``calibration`` tells from now on how far it is.

    ``board`` as ``chessboard:8x6:40`` (inner corners, mm) or ``charuco:7x5:25:19:DICT_4X4_50``;
    ``table`` says what is fixed to the table: ``markers:DICT_4X4_50:30``, or a board.
    """

    kind: Literal["calibrate_begin"] = "calibrate_begin"
    board: Name
    table: Name
    lowest_mm: Annotated[float, Field(ge=-1000, le=1000)] = 0.0
    """Height of the lowest corner of the board on the table."""
    orientation: Orientation = "vertical"
    rulers_mm: tuple[Ruler, Ruler] = (100.0, 100.0)
    """What the two printed rulers of 100 mm measure."""


class Capture(Request):
    """Take pictures for the calibration, of its board or of what is fixed to the table: a job.

    With a range the table turns, a picture at each stop; without, it rests, and ``every`` s before
    each picture a hand has time to move the board. ``laser`` names the laser that is lit for a
    second picture; the stage laser takes one with each there is.
    """

    kind: Literal["capture"] = "capture"
    stage: Stage
    count: Annotated[int, Field(ge=1, le=MOST_PICTURES)] = 1
    every: Annotated[float, Field(ge=0, le=LONGEST_PAUSE)] = 0.0
    range_deg: tuple[Angle, Angle] | None = None
    laser: Name | None = None
    seconds: Seconds | None = None


class ForgetView(Request):
    """Take a picture of the calibration away."""

    kind: Literal["forget_view"] = "forget_view"
    view: Count


class FinishCalibration(Request):
    """Calibrate with the pictures there are: a job whose findings name every picture not used.

    The rig is kept in the folder under this name, and used from now on.
    """

    kind: Literal["calibrate_finish"] = "calibrate_finish"
    name: Name


class ListVerifications(Request):
    """Answered by ``verifications``."""

    kind: Literal["list_verifications"] = "list_verifications"

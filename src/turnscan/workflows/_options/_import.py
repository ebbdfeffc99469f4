"""What a user may choose about an import of pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from turnscan.errors import FormatError, InputError
from turnscan.remedy import Option
from turnscan.workflows._options import _choices as choices
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.scan import Keep
    from turnscan.stripes import Orientation

Background = Literal["auto", "median", "beside", "darkest"]


@dataclass(frozen=True)
class EvenSteps:
    """The table turned by the same angle from each step to the next."""

    step_deg: float
    """Degrees, counter-clockwise seen from above; negative for clockwise; up to 180, not 0."""

    def __post_init__(self) -> None:
        given = Option("angles", str(self))
        if not math.isfinite(self.step_deg):
            raise FormatError(
                f"{self.step_deg} is not an angle", hint="give finite degrees", option=given
            )
        if self.step_deg == 0.0 or abs(self.step_deg) > 180.0:
            raise InputError("not a step", hint="give degrees, like step:1.8", option=given)

    def __str__(self) -> str:
        return f"step:{self.step_deg:g}"


@dataclass(frozen=True)
class MarkerAngles:
    """The markers on the platter tell the angle of each picture."""

    def __str__(self) -> str:
        return "markers"


@dataclass(frozen=True)
class ListedAngles:
    """A CSV file lists the angles.

    One line of ``angle_deg`` for each picture in order, or lines of ``number,angle_deg`` or
    ``number,angle_deg,sigma_deg`` with the number in the picture's name; all in degrees.
    """

    path: Path

    def __str__(self) -> str:
        return str(self.path)


AngleSource = EvenSteps | MarkerAngles | ListedAngles


def parse_angles(text: str) -> AngleSource:
    """The source of angles that ``step:DEG``, ``markers`` or the name of a CSV file stands for.

    Raises FormatError and InputError for what is not a step.
    """
    if text == "markers":
        return MarkerAngles()
    if not text.startswith("step:"):
        return ListedAngles(Path(text))
    try:
        return EvenSteps(float(text[5:]))
    except ValueError as e:
        if isinstance(e, InputError):
            raise
        raise FormatError(f"{text[5:]!r} is not a number", option=Option("angles", text)) from None


@dataclass(frozen=True)
class SeriesOptions(Checked):
    """What a series of pictures shows."""

    angles: str = option(
        None, "text",
        "Table angle of each picture: step:DEG between neighbouring pictures (counter-clockwise "
        "seen from above, negative for clockwise), markers (of a rig), or a CSV file of angle_deg "
        "a line, or of number,angle_deg[,sigma_deg].",
        optional=False,
    )  # fmt: skip
    laser: str = option("laser", "text", "Name of the laser.")


@dataclass(frozen=True)
class ImportOptions(Checked):
    """What a user may choose about an import; InputError names a value that none can have."""

    colour: str = option(
        "learn", "text",
        "Colour of the laser in colour pictures: red, green, blue, grey, three weights R,G,B, or "
        "learn (from the pictures).", group="Pictures",
    )  # fmt: skip
    keep: Keep = option(
        "sparse", "choice", "Store the pixels around the stripe, or all; both losslessly.",
        choices=choices.KEEP, group="Pictures",
    )  # fmt: skip
    threshold: float | None = option(
        None, "number",
        "Threshold above the background from which pixels are stored, grey levels.  [default: "
        "from the noise]",
        least=0.0, unit="grey levels", group="Pictures",
    )  # fmt: skip
    orientation: Orientation = option(
        "vertical",
        "choice",
        "Orientation of the stripe in the picture.",
        choices=choices.ORIENTATION,
        group="Pictures",
    )
    background: Background = option(
        "auto", "choice",
        "Background without laser-off pictures: per pixel, the median over the scan, the median "
        "over pictures in which the stripe is elsewhere (beside), or the darkest value; auto "
        "takes the one that shows more of the stripe.",
        choices=get_args(Background), group="Pictures",
    )  # fmt: skip
    every: int = option(1, "count", "Import every N-th step only.", least=1, group="Pictures")
    first_step: int | None = option(
        None,
        "count",
        "Number in the file name of step 0.  [default: lowest]",
        group="Pictures",
    )

"""What a user may choose about pictures for a calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._degrees import degrees_range

if TYPE_CHECKING:
    from turnscan.scanner import Series

Stage = Literal["camera", "laser", "table"]


@dataclass(frozen=True)
class CaptureOptions(Checked):
    """Pictures for a calibration; None leaves it to the devices."""

    stage: Stage = option(
        "camera", "choice",
        "What is photographed: the board, the board with each laser, or the table with its "
        "markers or board.",
        choices=("camera", "laser", "table"),
    )  # fmt: skip
    count: int = option(1, "count", "Number of pictures or table positions.")
    every: float = option(0.0, "number", "Delay before each picture, for moving the board, s.")
    range_deg: str | None = option(
        None, "text", "Turn the table from A to B, degrees.  [default: no motion; for stage table "
        "0:360]",
        parse=degrees_range,
    )  # fmt: skip
    laser_name: str | None = option(
        None, "text", "For stage table: laser lit for a second picture."
    )
    exposure: float | None = option(
        None, "number", "Exposure time, s.  [default: the simulated rig's, or 0.02]"
    )
    gain: float = option(1.0, "number", "Camera gain, factor.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.laser_name is not None and self.stage != "table":
            raise InputError(
                "only for stage table",
                hint="the stage laser lights them all",
                option=Option("laser_name", self.laser_name),
            )

    def series(self, lasers: tuple[str, ...]) -> Series:
        """The same for the devices, which have these lasers. Raises InputError."""
        from turnscan.scanner import Series

        ends = "0:360" if self.range_deg is None and self.stage == "table" else self.range_deg
        one = () if self.laser_name is None else (self.laser_name,)
        return Series(
            count=self.count,
            range_deg=None if ends is None else degrees_range(ends),
            every=self.every,
            lasers=lasers if self.stage == "laser" else one,
            seconds=self.exposure,
            gain=self.gain,
        )

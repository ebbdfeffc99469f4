"""What a user may choose about a scan that is taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.workflows._options._choices import KEEP, ORIENTATION
from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._degrees import degrees_range, exact_degrees

if TYPE_CHECKING:
    from turnscan.scan import Keep
    from turnscan.scanner import ScanRequest
    from turnscan.stripes import Orientation


def check_texture(exposure: float | None, every: int) -> None:
    """Raises InputError where texture images are counted, but none are captured."""
    if exposure is None and every != 1:
        raise InputError(
            f"a texture image every {every} steps, but no texture images are captured",
            hint=Remedy("give their exposure time, too: ", Option("texture")),
        )


@dataclass(frozen=True)
class ScanOptions(Checked):
    """How a scan is taken; None leaves it to the devices."""

    steps: int | None = option(
        None, "count", "Number of table positions.  [default: the simulated rig's, or 400 a turn]"
    )
    step_deg: str | None = option(
        None,
        "text",
        "Angle between table positions, degrees, in place of their number.",
        parse=exact_degrees,
    )
    range_deg: str = option(
        "0:360", "text", "First and last table angle, degrees.", parse=degrees_range
    )
    passes: int = option(1, "count", "Number of passes over the same positions.")
    laser_names: str | None = option(None, "text", "Lasers to use.  [default: all]")
    together: bool = option(False, "switch", "Light all lasers at the same time, in one picture.")
    exposures: tuple[float, ...] = option(
        (), "number",
        "Exposure time, s; may be repeated (bracketing).  [default: the simulated rig's, or 0.02]",
        many=True,
    )  # fmt: skip
    auto_exposure: bool = option(
        False, "switch", "Find the exposure time from the stripe at the first position."
    )
    gain: float = option(1.0, "number", "Camera gain, factor.")
    dark_every: int = option(1, "count", "Capture a laser-off picture every N steps; 0: never.")
    texture: float | None = option(
        None, "number", "Also capture laser-off texture images, with this exposure time, s."
    )
    texture_every: int = option(1, "count", "Capture a texture image every N steps.")
    lamps: tuple[str, ...] = option(
        (), "text", "Output that switches a lamp, lit for texture images.", many=True
    )
    settle: float | None = option(
        None, "number", "Settling time before each picture, s.  [default: 0.1; simulated: 0]"
    )
    blind_steps: int = option(
        8, "count", "End the scan after N consecutive steps without a stripe; 0: never."
    )
    keep: Keep = option(
        "sparse", "choice", "Store the pixels around the stripe, or all; both losslessly.",
        choices=KEEP,
    )  # fmt: skip
    threshold: float | None = option(
        None,
        "number",
        "Threshold above the background, grey levels.  [default: from the image noise; printed]",
    )
    orientation: Orientation = option(
        "vertical", "choice", "Orientation of the stripe in the picture.", choices=ORIENTATION
    )

    def request(self) -> ScanRequest:
        """The same for the devices. Raises InputError for options that contradict each other."""
        from turnscan.scanner import ScanRequest

        check_texture(self.texture, self.texture_every)

        names = self.laser_names
        return ScanRequest(
            steps=self.steps,
            step_deg=None if self.step_deg is None else exact_degrees(self.step_deg),
            range_deg=degrees_range(self.range_deg),
            passes=self.passes,
            lasers=None if names is None else tuple(filter(None, names.split(","))),
            together=self.together,
            exposures=self.exposures,
            auto_exposure=self.auto_exposure,
            gain=self.gain,
            dark_every=self.dark_every,
            texture=self.texture,
            texture_every=self.texture_every,
            lamps=self.lamps,
            settle=self.settle,
            blind_steps=self.blind_steps,
            keep=self.keep,
            threshold=self.threshold,
            orientation=self.orientation,
        )

"""What a user may choose about a rig that is designed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from turnscan.errors import InputError
from turnscan.remedy import Option
from turnscan.workflows._options import _choices as choices
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.rig import Design

_MOST_ANGLES = 100
_UM, _NM = 1e-3, 1e-6
_SAME = ("distance", "focal", "f_number", "electrons", "read_noise", "speckle_contrast")
"""Options that are fields of a `Design` by the same name and unit."""


def _number(help: str) -> Any:
    return option(None, "number", help)


@dataclass(frozen=True)
class DesignOptions(Checked):
    """Geometry and optics of a rig before it is built; None leaves what the preset has."""

    preset: Literal["paper", "modern", "ciclop"] = option(
        "modern", "choice", "The rig to start from; the other options change it.",
        choices=choices.PRESETS,
    )  # fmt: skip
    distance: float | None = _number("Distance from camera to rotation axis, L, mm.")
    focal: float | None = _number("Principal distance of the lens, f, mm.")
    pixel_um: str | None = option(None, "text", "Pixel pitch, micrometres.")
    sensor: str | None = option(None, "text", "Pixels across and along the laser line.")
    pan_deg: float | None = _number(
        "Camera pan angle away from the rotation axis, towards the laser, degrees."
    )
    laser_offset: float | None = _number("Distance of the laser line from the rotation axis, mm.")
    f_number: float | None = _number("Aperture of the lens, f-number N.")
    step_deg: float | None = _number("Table angle between two profiles, degrees.")
    wavelength_nm: float | None = _number("Wavelength of the laser, nm.")
    stripe_sigma_px: float | None = _number("RMS width of the stripe in the picture, pixels.")
    electrons: float | None = _number("Peak signal of the stripe, electrons.")
    read_noise: float | None = _number("Noise of a dark pixel, electrons.")
    speckle_contrast: float | None = _number(
        "Speckle contrast: 1 polarised, 0.71 depolarised, 0 none."
    )

    def designs(self, theta_deg: Sequence[float] = ()) -> tuple[Design, ...]:
        """A design for each angle of triangulation, in degrees; without them the preset's.

        Raises InputError naming what cannot be.
        """
        if len(theta_deg) > _MOST_ANGLES:
            raise InputError(
                f"{len(theta_deg)} angles, at most {_MOST_ANGLES}", option=Option("theta_deg")
            )
        fields: dict[str, Any] = {name: getattr(self, name) for name in _SAME}
        fields |= {"offset": self.laser_offset, "stripe_sigma": self.stripe_sigma_px}
        fields |= {
            "pan": None if self.pan_deg is None else math.radians(self.pan_deg),
            "step": None if self.step_deg is None else math.radians(self.step_deg),
            "wavelength": None if self.wavelength_nm is None else self.wavelength_nm * _NM,
        }
        if self.pixel_um is not None:
            fields["pixel_width"], fields["pixel_height"] = _pixel(self.pixel_um)
        if self.sensor is not None:
            fields["columns"], fields["rows"] = _sensor(self.sensor)
        changes = {name: value for name, value in fields.items() if value is not None}
        from turnscan.rig import design_preset

        base = design_preset(self.preset)
        thetas = [math.radians(t) for t in theta_deg]
        return tuple(replace(base, theta=t, **changes) for t in thetas or [base.theta])


def parse_theta(text: str) -> list[float]:
    """Degrees: ``22.5``, a list ``10,20,30`` or a range ``FROM:TO:STEP``. Raises InputError."""
    given = Option("theta_deg", text)
    parts = text.split(":")
    if len(parts) != 3:
        return [_finite(p, given) for p in text.split(",")]
    first, last, step = (_finite(p, given) for p in parts)
    if not (step > 0 and last >= first) or (last - first) / step >= _MOST_ANGLES:
        raise InputError(
            f"this range does not run upwards in 1 to {_MOST_ANGLES} angles",
            hint="write FROM:TO:STEP, like 10:60:5",
            option=given,
        )
    # A range reaches its end although 0.1 is not a binary number.
    count = math.floor((last - first) / step + 1e-9) + 1
    return [first + i * step for i in range(count)]


def _pixel(text: str) -> tuple[float, float]:
    given = Option("pixel_um", text)
    sizes = [_finite(p, given) * _UM for p in text.split(",")]
    if len(sizes) > 2:
        raise InputError(f"{text!r} is not WIDTH or WIDTH,HEIGHT", option=Option("pixel_um"))
    return sizes[0], sizes[-1]


def _sensor(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,9})[x×]([0-9]{1,9})", text.strip())
    if match is None:
        raise InputError(
            f"{text!r} is not COLUMNSxROWS", hint="like 2448x2048", option=Option("sensor")
        )
    return int(match[1]), int(match[2])


def _finite(text: str, given: Option) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{text!r} in {given.value!r} is not a number", option=Option(given.name))
    return value

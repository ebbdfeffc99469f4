"""ScanPlan: what a scan file holds, decided before its first frame; Frame: one exposure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from turnscan.arrays import Image
from turnscan.errors import FormatError, InputError
from turnscan.json_text import strict_json
from turnscan.picture import Picture, brightened
from turnscan.scan._limits import (
    EXPOSURES,
    IMAGE_PIXELS,
    NAME_BYTES,
    STEPS,
    check_pixels,
)

Keep = Literal["sparse", "full"]
Setting = str | int | float | bool
NAN = float("nan")


@dataclass(frozen=True)
class ScanPlan:
    """What a scan file holds. Every frame of it has this size, type and number of channels."""

    width: int
    """px."""
    height: int
    """px."""
    dtype: Literal["uint8", "uint16"]
    channels: Literal[1, 3]
    """1 for grey pictures, 3 for red, green, blue."""
    lasers: tuple[str, ...]
    """Names of the lasers (or of sets lit together), each with its own frames."""
    steps: int
    """Table positions 0 … steps − 1 of each laser."""
    threshold: float
    """Grey levels above the median of the signal from which a pixel of a sparse frame is kept."""
    keep: Keep = "sparse"
    margin: int = 32
    """px kept on both sides of every pixel above the threshold, along the scan direction: the
    window of a stripe up to 5 px wide (rms) and the flanks its background is taken from."""
    orientation: Literal["vertical", "horizontal"] = "vertical"
    """Of the stripe: a vertical one is cut by image rows, a horizontal one by image columns."""
    weights: tuple[float, float, float] | None = None
    """The signal of a colour picture is weights · (red, green, blue); None for grey ones."""
    source: str = ""
    """Where the frames come from, in words."""
    exposures: int = 1
    """Pictures of each step and laser, each exposed in its own way."""

    @property
    def simulated(self) -> str:
        """The simulated rig that takes the frames, by its address (of a scan) or in words (of a
        simulation); empty for those of a real part."""
        return self.source if self.source.startswith(("sim:", "simulated ")) else ""

    def __post_init__(self) -> None:
        _wanted(self.width >= 1 and self.height >= 1, "size", (self.width, self.height))
        check_pixels(self.width, self.height, "plan")
        _wanted(self.dtype in ("uint8", "uint16"), "dtype", self.dtype)
        _wanted(self.channels in (1, 3), "channels", self.channels)
        _wanted(bool(self.lasers), "lasers", self.lasers)
        _wanted(len(set(self.lasers)) == len(self.lasers), "lasers (twice the same)", self.lasers)
        for name in self.lasers:
            _wanted(0 < len(name.encode()) <= NAME_BYTES and name.isprintable(), "laser", name)
        _wanted(1 <= self.steps <= STEPS, "steps", self.steps)
        _wanted(1 <= self.exposures <= EXPOSURES, "exposures", self.exposures)
        _wanted(math.isfinite(self.threshold) and self.threshold >= 0, "threshold", self.threshold)
        _wanted(self.keep in ("sparse", "full"), "keep", self.keep)
        _wanted(0 <= self.margin <= 10_000, "margin", self.margin)
        _wanted(self.orientation in ("vertical", "horizontal"), "orientation", self.orientation)
        _wanted((self.weights is not None) == (self.channels == 3), "weights", self.weights)
        if self.weights is not None:
            _wanted(all(math.isfinite(w) for w in self.weights), "weights", self.weights)
            _wanted(any(w != 0 for w in self.weights), "weights", self.weights)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a picture: (H, W) or (H, W, 3)."""
        return (self.height, self.width) + ((3,) if self.channels == 3 else ())


@dataclass(frozen=True)
class Frame:
    """One exposure: a table angle, a laser, and what the camera saw with it on and off."""

    step: int
    laser: str
    lit: Image
    """(H, W) or (H, W, 3), the laser on. Pixels that a sparse frame does not hold are equal to
    those of ``dark``, so that nothing is above any threshold there."""
    dark: Image | None = None
    """Like ``lit``, the laser off, or the background of the scan; None where there is neither."""
    exposure: int = 0
    """Number among several exposures of the same step and laser."""
    commanded: float = NAN
    """rad, the angle the table was sent to; NaN where unknown."""
    measured: float = NAN
    """rad, the angle seen (by markers, an encoder); NaN where not observed."""
    angle_sigma: float = NAN
    """rad, standard uncertainty of ``angle``; NaN where unknown."""
    noise: float = NAN
    """Grey levels, robust standard deviation of the signal over the whole picture; of the
    projected signal where the pictures are projected. `Scan.add`
    measures it where it is NaN; detectors that set their threshold by the noise need this one,
    because a sparse frame no longer shows it."""
    level: float = NAN
    """Grey levels, median of the signal over the whole picture; measured like ``noise``."""
    time: float = NAN
    """s since 1970-01-01 UTC; NaN where unknown."""
    settings: Mapping[str, Setting] = field(default_factory=lambda: MappingProxyType({}))
    """Camera settings as read back, name of the source picture, and the like."""

    def show(self) -> Picture:
        """The laser-on picture as an eye would see it, for a notebook; `lit` has the pixels."""
        return Picture(brightened(self.lit))

    @property
    def angle(self) -> float:
        """The table's angle, rad: measured where there is a measurement, else commanded."""
        return self.commanded if math.isnan(self.measured) else self.measured


class _PlanText(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    width: int = Field(strict=True, ge=1, le=IMAGE_PIXELS)
    height: int = Field(strict=True, ge=1, le=IMAGE_PIXELS)
    dtype: Literal["uint8", "uint16"]
    channels: Literal[1, 3]
    lasers: tuple[str, ...]
    steps: int = Field(strict=True)
    threshold: float
    keep: Keep
    margin: int = Field(strict=True)
    orientation: Literal["vertical", "horizontal"]
    weights: tuple[float, float, float] | None
    source: str
    exposures: int = Field(default=1, strict=True)

    @model_validator(mode="after")
    def _as_plan(self) -> _PlanText:
        ScanPlan(**self.model_dump())
        return self


def plan_to_json(plan: ScanPlan) -> str:
    """Write a plan as JSON text; `plan_from_json` gives an equal plan back."""
    return json.dumps(
        {name: getattr(plan, name) for name in _PlanText.model_fields}, allow_nan=False
    )


def plan_from_json(text: str, where: str) -> ScanPlan:
    """Parse a plan strictly. Raises FormatError naming the key and the value."""
    try:
        return ScanPlan(**_PlanText.model_validate(strict_json(text, where)).model_dump())
    except ValidationError as e:
        first = e.errors()[0]
        key = ".".join(str(p) for p in first["loc"]) or "plan"
        raise FormatError(f"{where}: {key}: {first['msg']}") from None


def settings_from_json(text: str, where: str) -> Mapping[str, Setting]:
    """Parse a flat object of names and plain values. Raises FormatError."""
    body = strict_json(text, where)
    if not isinstance(body, dict) or any(
        not isinstance(v, str | int | float | bool) for v in body.values()
    ):
        raise FormatError(f"{where}: settings are not names with plain values")
    return MappingProxyType(body)


def settings_to_json(settings: Mapping[str, Setting]) -> str:
    """Write settings as JSON text. Raises InputError where they are not plain."""
    odd = [k for k, v in settings.items() if not isinstance(v, str | int | float | bool)]
    if odd:
        raise InputError(f"frame settings: {odd[0]} is {settings[odd[0]]!r}, not a plain value")
    try:
        return json.dumps(dict(settings), allow_nan=False, sort_keys=True)
    except ValueError as e:
        raise InputError(f"frame settings: {e}") from None


def _wanted(good: bool, name: str, value: object) -> None:
    if not good:
        raise InputError(f"plan: {name} {value!r} is not possible")

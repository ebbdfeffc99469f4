"""Plan: what a scan does, decided before its first picture and kept in the scan file."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from turnscan.errors import FormatError, InputError
from turnscan.scan import STEPS, strict_json

_LONGEST_EXPOSURE = 60.0
_MOST_TURNS = 1000


@dataclass(frozen=True)
class Exposure:
    """One way to expose: s and gain factor."""

    seconds: float
    gain: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds <= _LONGEST_EXPOSURE:
            raise InputError(
                f"exposure {self.seconds:g} s", hint=f"above 0 to {_LONGEST_EXPOSURE:g} s"
            )
        if not 0.0 < self.gain < math.inf:
            raise InputError(f"gain {self.gain:g}", hint="give a gain above 0")


@dataclass(frozen=True)
class Texture:
    """Whole pictures without laser light, for the colour of the surface."""

    exposure: Exposure
    every: int = 1
    """Steps from one to the next."""
    lamps: tuple[str, ...] = ()
    """Outputs of the laser board that are lamps, lit for these pictures alone."""

    def __post_init__(self) -> None:
        if self.every < 1:
            raise InputError(f"texture every {self.every} steps", hint="1 or more")


@dataclass(frozen=True)
class Plan:
    """Where the table stops, and which pictures are taken there.

    Degrees are exact fractions, so that any number of steps ends where it should; `angle` gives
    radians. Raises InputError, naming the value, where it cannot be done.
    """

    step_deg: Fraction
    """From one stop to the next; negative turns the other way."""
    stops: int
    """Of one pass."""
    lasers: tuple[str, ...]
    exposures: tuple[Exposure, ...]
    """Each step is taken with each of them."""
    start_deg: Fraction = Fraction(0)
    passes: int = 1
    """The same stops again so many times, always turning on, whole turns later."""
    together: bool = False
    """All lasers in one picture, instead of one after the other."""
    dark_every: int = 1
    """Steps from one picture without laser to the next; 0 for none at all."""
    texture: Texture | None = None
    settle: float = 0.0
    """s from the table's rest to the first picture."""
    blind_steps: int = 8
    """A laser that shows nothing in so many consecutive steps is in no known state; 0 trusts it."""

    def __post_init__(self) -> None:
        if self.stops < 1 or self.passes < 1:
            raise InputError(
                f"{self.stops} steps in {self.passes} passes", hint="a scan has at least one step"
            )
        if self.steps > STEPS:
            raise InputError(f"{self.steps} steps", hint=f"a scan has at most {STEPS}")
        if self.step_deg == 0 and self.steps > 1:
            raise InputError("steps of 0°", hint="give an angle or a number of steps")
        if max(abs(self.degrees(0)), abs(self.degrees(self.steps - 1))) > 360 * _MOST_TURNS:
            raise InputError(
                f"turning to {float(self.degrees(self.steps - 1)):g}°",
                hint=f"at most {_MOST_TURNS} turns",
            )
        if not self.lasers or len(set(self.lasers)) != len(self.lasers):
            raise InputError(
                f"lasers {', '.join(self.lasers) or 'none'}",
                hint="name each laser once, one or more",
            )
        if self.together and any("+" in name for name in self.lasers):
            raise InputError("a laser with + in its name cannot be lit together with others")
        if not self.exposures:
            raise InputError("a scan needs at least one exposure")
        if self.dark_every < 0 or self.blind_steps < 0 or not 0.0 <= self.settle <= 60.0:
            raise InputError(
                f"dark every {self.dark_every}, settle {self.settle:g} s, blind {self.blind_steps}"
                " steps",
                hint="none may be negative; settle for 60 s at most",
            )

    @property
    def steps(self) -> int:
        """Stops of all passes."""
        return self.stops * self.passes

    @property
    def sets(self) -> dict[str, frozenset[str]]:
        """Lasers lit for each kind of picture, under the name its frames have in the scan file."""
        if self.together:
            return {"+".join(self.lasers): frozenset(self.lasers)}
        return {name: frozenset({name}) for name in self.lasers}

    def degrees(self, step: int) -> Fraction:
        """The angle of a step, exact."""
        turn, stop = divmod(step, self.stops)
        covered = abs(self.step_deg) * self.stops
        onwards = 360 * max(1, math.ceil(covered / 360)) * (1 if self.step_deg >= 0 else -1)
        return self.start_deg + self.step_deg * stop + onwards * turn

    def angle(self, step: int) -> float:
        """The angle of a step, rad."""
        return 2 * math.pi * float(self.degrees(step) / 360)

    def has_texture(self, step: int) -> bool:
        """Whether a picture for the colour of the surface is taken at this step."""
        return self.texture is not None and step % self.texture.every == 0


def turn_of(
    steps: int,
    lasers: tuple[str, ...],
    seconds: float,
    gain: float = 1.0,
) -> Plan:
    """One whole turn in even steps. Raises InputError as `Plan` does."""
    step = Fraction(360, steps) if steps > 0 else Fraction(0)
    return Plan(step, steps, lasers, (Exposure(seconds, gain),))


@dataclass(frozen=True)
class Acquisition:
    """A plan and the addresses of the devices that carry it out: all that `resume` needs."""

    plan: Plan
    camera: str
    turntable: str
    lasers: str
    counting: str = ""
    """The table's own, in which its angles are those of the scan; empty where it has none."""
    at: float = 0.0
    """rad, angle of the scan at the table's zero."""


_Degrees = Annotated[str, Field(pattern=r"^-?\d{1,18}(/[1-9]\d{0,17})?$")]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Whole = Annotated[int, Field(strict=True)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _ExposureText(_Strict):
    seconds: float
    gain: float


class _TextureText(_Strict):
    exposure: _ExposureText
    every: _Whole
    lamps: tuple[_Name, ...]


class _PlanText(_Strict):
    step_deg: _Degrees
    stops: _Whole
    lasers: tuple[_Name, ...]
    exposures: tuple[_ExposureText, ...]
    start_deg: _Degrees
    passes: _Whole
    together: bool
    dark_every: _Whole
    texture: _TextureText | None
    settle: float
    blind_steps: _Whole


class _AcquisitionText(_Strict):
    version: Literal[1]
    plan: _PlanText
    camera: str
    turntable: str
    lasers: str
    counting: str = ""
    at: float = 0.0


def acquisition_to_json(what: Acquisition) -> str:
    """Write as JSON text; `acquisition_from_json` gives an equal value back."""
    return json.dumps({"version": 1, **asdict(what)}, default=str, allow_nan=False)


def acquisition_from_json(text: str, where: str) -> Acquisition:
    """Parse strictly. Raises FormatError naming the key, InputError for what cannot be done."""
    try:
        found = _AcquisitionText.model_validate(strict_json(text, where))
    except ValidationError as e:
        first = e.errors()[0]
        key = ".".join(str(p) for p in first["loc"]) or "acquisition"
        raise FormatError(f"{where}: {key}: {first['msg']}") from None
    p = found.plan
    plan = Plan(
        step_deg=Fraction(p.step_deg),
        stops=p.stops,
        lasers=p.lasers,
        exposures=tuple(Exposure(e.seconds, e.gain) for e in p.exposures),
        start_deg=Fraction(p.start_deg),
        passes=p.passes,
        together=p.together,
        dark_every=p.dark_every,
        texture=None
        if p.texture is None
        else Texture(
            Exposure(p.texture.exposure.seconds, p.texture.exposure.gain),
            p.texture.every,
            p.texture.lamps,
        ),
        settle=p.settle,
        blind_steps=p.blind_steps,
    )
    return Acquisition(plan, found.camera, found.turntable, found.lasers, found.counting, found.at)

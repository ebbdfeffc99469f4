"""What a person wants of a scan → a plan for the devices there are, and its first pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from turnscan.acquire import (
    Acquisition,
    Exposure,
    FirstLook,
    FoundExposure,
    Plan,
    Texture,
    acquisition_to_json,
    auto_exposure,
    check_room,
    counting_of,
    estimate,
    look,
    stripe_peak,
)
from turnscan.arrays import Image
from turnscan.devices import burning, frame_deadline
from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan import Keep, Scan, ScanPlan
from turnscan.scanner._open import Opened
from turnscan.stripes import Orientation

USUAL_STEPS = 400
"""Of a turn, where neither a person nor a simulated rig says otherwise."""
SETTLE = 0.1
"""s from rest to picture, likewise."""
_FIRST_MOVE = 120.0
"""s that the way to the first stop may take."""
_NOTHING = 0.1
"""Of the scale: what a stripe has at least more than the picture without laser."""


@dataclass(frozen=True)
class ScanRequest:
    """What a person wants; None leaves it to the devices."""

    steps: int | None = None
    step_deg: Fraction | None = None
    """Between stops, instead of ``steps``."""
    range_deg: tuple[Fraction, Fraction] = (Fraction(0), Fraction(360))
    passes: int = 1
    lasers: tuple[str, ...] | None = None
    together: bool = False
    exposures: tuple[float, ...] = ()
    """s; none takes what suits the bench."""
    auto_exposure: bool = False
    """Find one exposure that suits the brightest stripe at the first stop."""
    gain: float = 1.0
    dark_every: int = 1
    texture: float | None = None
    """s of a whole picture without laser light, too."""
    texture_every: int = 1
    lamps: tuple[str, ...] = ()
    settle: float | None = None
    """s."""
    blind_steps: int = 8
    keep: Keep = "sparse"
    threshold: float | None = None
    """Grey levels; None chooses it by the noise."""
    orientation: Orientation = "vertical"


@dataclass(frozen=True)
class Prepared:
    """All that is known before the first step of a scan is taken."""

    plan: Plan
    first: FirstLook
    rig: Rig | None
    size: int
    """Bytes, about."""
    acquisition: str
    """For the scan file, to resume by."""
    exposure_reason: str = ""
    """Why the exposure is what it is, in words, where it was found."""

    def create(self, path: Path) -> Scan:
        """The scan file, to be filled. Raises InputError, ScanError, StorageFull for no room."""
        check_room(path, self.size)
        return Scan.create(path, self.first.scan_plan, self.rig, self.acquisition)


def prepare(
    bench: Opened, request: ScanRequest, rig: Rig | None = None, rig_name: str = "the rig"
) -> Prepared:
    """Plan a scan and take its first pictures; the lasers are dark when this returns.

    ``rig`` None takes that of a simulated rig. Raises InputError where request, devices and rig do
    not go together, and DeviceError and SafetyError as the devices do.
    """
    plan, reason = plan_of(request, bench), ""
    if request.auto_exposure:
        plan, reason = _exposed(plan, bench, request)
    first = look(
        plan, bench.hardware, keep=request.keep, orientation=request.orientation,
        source=bench.at.camera, weigh=laser_colour, threshold=request.threshold,
    )  # fmt: skip
    used = rig or bench.rig
    if used is not None:
        _check_rig(used, plan, first.scan_plan, rig_name)
    counting = counting_of(bench.hardware.turntable)
    how = acquisition_to_json(
        Acquisition(plan, bench.at.camera, bench.at.turntable, bench.at.lasers, counting)
    )
    return Prepared(plan, first, used, estimate(plan, first), how, reason)


def _exposed(plan: Plan, bench: Opened, request: ScanRequest) -> tuple[Plan, str]:
    """The plan with the exposure at which no laser's stripe clips, and how that came about."""
    if request.exposures:
        raise InputError(
            "fixed and automatic exposure are mutually exclusive", hint="give one of them"
        )
    hardware, gain = bench.hardware, plan.exposures[0].gain
    seconds, found = plan.exposures[0].seconds, list[FoundExposure]()
    hardware.turntable.move_to(plan.angle(0), _FIRST_MOVE)
    hardware.camera.configure(seconds, gain)
    hardware.camera.grab(frame_deadline(seconds, first=True))  # what takes long needs no light
    for lit in plan.sets.values():
        light = partial(burning, hardware.lasers, lit)
        found.append(auto_exposure(hardware.camera, seconds, gain=gain, light=light))
    best = min(found, key=lambda f: f.seconds)
    hardware.camera.configure(best.seconds, gain)
    dark = hardware.camera.grab(frame_deadline(best.seconds))
    if best.peak - stripe_peak(dark) < _NOTHING:
        raise InputError(
            "no stripe is found at the first position at any exposure",
            hint=Remedy("turn the part into the laser line, or give ", Option("exposure")),
        )
    text = f"exposure {1000 * best.seconds:.3g} ms: the stripe reaches {best.peak:.0%} of the scale"
    return replace(plan, exposures=(Exposure(best.seconds, gain),)), text


def plan_of(request: ScanRequest, bench: Opened) -> Plan:
    """The plan that the request comes to with these devices. Raises InputError."""
    step, stops = stops_of(
        request.range_deg, request.steps, request.step_deg, bench.steps or USUAL_STEPS
    )
    names = request.lasers
    if names is None:
        names = tuple(n for n in bench.hardware.lasers.names if n not in request.lamps)
    shown = None
    if request.texture is not None:
        shown = Texture(
            Exposure(request.texture, request.gain), request.texture_every, request.lamps
        )
    settle = request.settle
    if settle is None:
        settle = 0.0 if bench.steps else SETTLE
    return Plan(
        step_deg=step,
        stops=stops,
        lasers=names,
        exposures=tuple(Exposure(s, request.gain) for s in request.exposures or (bench.exposure,)),
        start_deg=request.range_deg[0],
        passes=request.passes,
        together=request.together,
        dark_every=request.dark_every,
        texture=shown,
        settle=settle,
        blind_steps=request.blind_steps,
    )


def stops_of(
    ends: tuple[Fraction, Fraction], steps: int | None, step_deg: Fraction | None, usual: int
) -> tuple[Fraction, int]:
    """Angle between stops and their number.

    Whole turns end one step before their first stop comes again; on other ranges both ends are
    stops. Raises InputError where range and steps do not go together.
    """
    if steps is not None and step_deg is not None:
        raise InputError(
            "mutually exclusive with the number of steps",
            hint="give one of them",
            option=Option("step_deg"),
        )
    width = ends[1] - ends[0]
    closed = width != 0 and width % 360 == 0
    if step_deg is not None:
        if step_deg <= 0:
            given = Option("step_deg", float(step_deg))
            raise InputError("not a step", hint="give an angle above 0", option=given)
        step = step_deg if width >= 0 else -step_deg
        count = width / step
        return step, (-(-count.numerator // count.denominator) if closed else int(count) + 1)
    if steps is None:
        steps = max(1, round(usual * abs(width) / 360) + (not closed))
    if steps < 1:
        raise InputError(
            "too few", hint="a scan has at least one step", option=Option("steps", steps)
        )
    gaps = steps if closed else steps - 1
    if gaps == 0 and width != 0 and not closed:
        raise InputError(f"one step over {float(width):g}°", hint="give 2 steps or more")
    return (width / gaps if gaps else Fraction(0)), steps


def laser_colour(lit: Image, dark: Image) -> tuple[float, float, float]:
    """How much of red, green and blue is laser, learnt from a lit and a dark picture."""
    from turnscan.stripes import learn_colour

    red, green, blue = learn_colour(lit, dark)
    return float(red), float(green), float(blue)


def _check_rig(rig: Rig, plan: Plan, scan_plan: ScanPlan, where: str) -> None:
    missing = set(plan.lasers) - {s.name for s in rig.sheets}
    if missing:
        there = ", ".join(s.name for s in rig.sheets) or "none"
        raise InputError(f"{where}: no laser {', '.join(sorted(missing))}", hint=f"it has {there}")
    have = (rig.camera.width, rig.camera.height)
    if have != (scan_plan.width, scan_plan.height):
        raise InputError(
            f"{where}: its camera gives {have[0]} × {have[1]} pixels, this one "
            f"{scan_plan.width} × {scan_plan.height}",
            hint="give the rig that belongs to this camera",
        )

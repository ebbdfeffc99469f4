"""``sim:SCENE?key=value&…``: a simulated rig by its address."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import parse_qsl, unquote

from turnscan.errors import InputError
from turnscan.simulate._devices import Faults, SimCamera, SimLasers, SimTurntable, World
from turnscan.simulate._hand import Hand
from turnscan.simulate._motion import Motion
from turnscan.simulate._presets import SimulationSpec, bench, seconds_of, steps_of


@dataclass(frozen=True)
class Simulated:
    """A bench as devices."""

    spec: SimulationSpec
    world: World
    camera: SimCamera
    turntable: SimTurntable
    lasers: SimLasers

    @property
    def seconds(self) -> float:
        """The exposure that suits this bench."""
        return seconds_of(self.spec)

    @property
    def steps(self) -> int:
        """Number of table positions per turn."""
        return steps_of(self.spec)


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def _angle(text: str) -> float:
    return math.radians(_number(text))


def _yes(text: str) -> bool:
    return {"1": True, "yes": True, "0": False, "no": False}[text.lower()]


_Change = Callable[[Any], dict[str, Any]]
_SPEC: Mapping[str, tuple[Callable[[str], Any], _Change]] = {
    "rig": (str, lambda x: {"rig": x}),
    "hand": (str, lambda x: {"hand": x}),
    "seed": (int, lambda x: {"seed": x}),
    "steps": (int, lambda x: {"steps": x}),
    "theta_deg": (_angle, lambda x: {"theta": x}),
    "lasers": (int, lambda x: {"lasers": x}),
    "speckle": (_yes, lambda x: {"waves": "speckle" if x else "diffraction"}),
    "perfect": (_yes, lambda x: {"perfect": x}),
    "tip_deg": (_angle, lambda x: {"tip": x}),
    "room": (_number, lambda x: {"room": x}),
    "pattern": (str, lambda x: {"pattern": x}),
    "lying": (_yes, lambda x: {"lying": x}),
    "galvo": (_number, lambda x: {"galvo": x}),
}
_MOTION: Mapping[str, tuple[Callable[[str], Any], _Change]] = {
    "microsteps": (int, lambda x: {"microsteps": x}),
    "backlash_deg": (_angle, lambda x: {"backlash": x}),
    "jitter_deg": (_angle, lambda x: {"jitter": x}),
    "wobble_deg": (_angle, lambda x: {"wobble": x}),
    "runout": (_number, lambda x: {"runout": x}),
    "axis_tilt_deg": (_angle, lambda x: {"axis_tilt": x}),
    "axis_shift": (_number, lambda x: {"axis_shift": x}),
    "axial": (_number, lambda x: {"axial": x}),
    "clockwise": (_yes, lambda x: {"clockwise": x}),
    "eccentric_deg": (_angle, lambda x: {"harmonics": ((1, x, 0.0),)}),
    "missed": (int, lambda x: {"missed": {x: math.radians(1.8)}}),
}
_FAULTS: Mapping[str, tuple[Callable[[str], Any], _Change]] = {
    "stale": (_number, lambda x: {"stale": x}),
    "drop": (_number, lambda x: {"drop": x}),
    "stuck_on": (str, lambda x: {"stuck_on": frozenset(x.split(","))}),
    "stuck_off": (str, lambda x: {"stuck_off": frozenset(x.split(","))}),
}


def spec_of(address: str) -> tuple[SimulationSpec, Faults]:
    """Parse ``sim:SCENE?key=value&…``. Raises InputError naming the key and the value."""
    if not address.startswith("sim:"):
        raise InputError(f"{address}: not a simulated device", hint="write sim:cup?seed=7")
    scene, _, query = address[4:].partition("?")
    spec, motion, faults = SimulationSpec(scene=unquote(scene) or "cup"), Motion(), Faults()
    given = parse_qsl(query, keep_blank_values=True)
    if len({k for k, _ in given}) != len(given):
        raise InputError(f"{address}: a key is given twice")
    x = y = 0.0
    lean = [0.0, 0.0]
    for key, text in given:
        if key in ("x", "y"):
            value = _parsed(_number, key, text)
            x, y = (value, y) if key == "x" else (x, value)
        elif key in ("lean_x_deg", "lean_y_deg"):
            lean[key == "lean_y_deg"] = _parsed(_angle, key, text)
        elif key in _SPEC:
            spec = replace(spec, **_change(_SPEC, key, text))
        elif key in _MOTION:
            motion = _motion(motion, _change(_MOTION, key, text))
        elif key in _FAULTS:
            faults = replace(faults, **_change(_FAULTS, key, text))
        else:
            keys = ", ".join([*_SPEC, "x", "y", "lean_x_deg", "lean_y_deg", *_MOTION, *_FAULTS])
            raise InputError(f"{address}: no key {key!r}", hint=f"there is {keys}")
    return replace(spec, motion=motion, shift=(x, y), lean=(lean[0], lean[1])), faults


def simulated(address: str | SimulationSpec, faults: Faults | None = None) -> Simulated:
    """The devices of a bench, from its address or its spec.

    Raises InputError as `spec_of` and `bench` do.
    """
    spec = address
    if isinstance(spec, str):
        spec, from_address = spec_of(spec)
        faults = faults or from_address
    made = bench(spec)
    world = World(made, faults, None if spec.hand is None else Hand(made, spec.hand))
    return Simulated(spec, world, SimCamera(world), SimTurntable(world), SimLasers(world))


def sim_camera(address: str) -> SimCamera:
    """The camera of a bench of its own; of one with lasers and turntable, see `simulated`."""
    return simulated(address).camera


def _motion(motion: Motion, change: dict[str, Any]) -> Motion:
    try:
        return replace(motion, **change)
    except ValueError as e:
        raise InputError(str(e)) from None


def _change(
    keys: Mapping[str, tuple[Callable[[str], Any], _Change]], key: str, text: str
) -> dict[str, Any]:
    parse, change = keys[key]
    return change(_parsed(parse, key, text))


def _parsed(parse: Callable[[str], Any], key: str, text: str) -> Any:
    try:
        return parse(text)
    except (ValueError, KeyError):
        raise InputError(f"{key}={text!r}: not a value for {key}") from None
